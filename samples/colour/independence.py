#!/usr/bin/python3
"""Tests whether the mask of `halftone` is independent of the default mask of `dither`.

    samples/colour/independence.py --program build/release/vdbdither [--lattice NAME]... [--json FILE] [--plot FILE.png]

Both are read at the same voxels. Where they depend on each other, the shape dither prints some thresholds of the halftone more
often than others, or low frequencies appear. The masks are compared over a common period, grey and thresholded at LEVELS. The
reference is what independent masks give: the same two masks at every other offset, and pairs of other seeds. Scores are in
standard deviations over all offsets:

correlation  of the thresholds at the same voxel, its score, those of thresholded masks, and the greatest score of any offset
bands        the greatest score of a band of |f|: the real part of A(f) conj B(f), summed over the band
halves       half layers (64 x 32 voxels), each alone: the greatest score and the rms, if voxels were independent
by index     the correlation of the thresholds in the order of the random start (x fastest), where both masks have as many
product      voxels that both masks select: their share, and their power below LOW relative to that at OFFSETS other offsets, to
             that with the thresholds of the dither shuffled, and the power of the halftone mask alone relative to the latter

The pairs are those of the options `--seed` of `halftone` and `dither`. The program takes another seed for the mask of `halftone`
than `--seed` says (SEED_OF_MASK), because masks of one seed and of as many voxels start from one random order; "equal" are pairs
whose masks have one seed. The last two rows are controls, which must be found: a mask with a little of the halftone mask in
noise, and one that equals it in one half layer.
"""

import argparse
import json
import pathlib
import tempfile

import numpy as np
from tiles import LATTICES_MM, SHAPE_SIZE, halftone_tile, shape_tile

# The tile of `halftone` is 64 x 32 x 128 on those of the printers and as large as that of `dither` on these.
LATTICES = LATTICES_MM | {"cubes of 42 um": (0.042, 0.042, 0.042)}
LEVELS = (0.1, 0.25, 0.5, 0.75)
SEEDS = (1, 2, 3)
# `halftone` adds this to --seed for its mask.
SEED_OF_MASK = 2**30
# Cycles / mm. The eye sees few above 5 at 30 cm. No lattice reaches less far than the last band.
BANDS = np.arange(0, 21, 2)
LOW = 4
OFFSETS = 100
HALF = 32
SEED = 7


def on_common_period(first, second):
    """Returns both tiles, repeated to the smallest period that they share."""
    period = np.lcm(first.shape, second.shape)
    return np.tile(first, period // first.shape), np.tile(second, period // second.shape)


def frequencies(shape, pitch):
    """Returns |f| in cycles / mm [x, y, z / 2 + 1]."""
    along = [np.fft.fftfreq(shape[0], pitch[0]), np.fft.fftfreq(shape[1], pitch[1]), np.fft.rfftfreq(shape[2], pitch[2])]
    return np.sqrt(sum(np.meshgrid(*(axis**2 for axis in along), indexing="ij")))


def cross_spectrum(first, second):
    """Returns A conj B of two masks without their means, scaled so that the sum over all f is their correlation."""
    a, b = (np.fft.rfftn((values - values.mean()) / values.std()) for values in (first, second))
    return a * np.conj(b) / first.size


def correlations(first, second, pitch=None):
    """Returns the correlation of two masks at the same voxel, its score, the greatest of all offsets, and those of bands."""
    product = cross_spectrum(first, second)
    values = np.fft.irfftn(product, first.shape)
    result = {"correlation": values[0, 0, 0], "score": values[0, 0, 0] / values.std(),
              "greatest": np.abs(values).max() / values.std()}
    if pitch is not None:
        radius = frequencies(first.shape, pitch)
        bands = [np.fft.irfftn(product * ((radius >= low) & (radius < high)), first.shape) for low, high in zip(BANDS, BANDS[1:])]
        result["bands"] = [band[0, 0, 0] / band.std() for band in bands]
    return result


def scores_of_halves(first, second):
    """Returns the scores [y halves, z] of the correlations of half layers."""
    a, b = (np.reshape(values, (len(values), -1, HALF, values.shape[2])).astype(float) for values in (first, second))
    a, b = ((values - values.mean(axis=(0, 2), keepdims=True)) / values.std(axis=(0, 2), keepdims=True) for values in (a, b))
    return (a * b).mean(axis=(0, 2)) * np.sqrt(len(first) * HALF)


def compare(halftone, shape, pitch):
    """Returns the figures for a halftone and a shape mask."""
    a, b = on_common_period(halftone, shape)
    result = {"grey": correlations(a, b, pitch)}
    for level in LEVELS:
        result[f"below {level:g}"] = correlations(a < level, b < level)
    halves = scores_of_halves(a, b)
    result["halves"] = {"greatest": np.abs(halves).max(), "rms": np.sqrt((halves**2).mean())}
    if halftone.size == shape.size:
        result["by_index"] = np.corrcoef(halftone.ravel("F"), shape.ravel("F"))[0, 1]
    return result


def products(halftone, shape, pitch):
    """Returns for each level the share of voxels that both masks select, and the low frequencies of their pattern."""
    rng = np.random.default_rng(SEED)
    rows = []
    for level in LEVELS:
        a, b = on_common_period(halftone < level, shape < level)
        radius = frequencies(a.shape, pitch)
        low = (radius > 0) & (radius < LOW)

        def power_of(values):
            return (np.abs(np.fft.rfftn(values.astype(np.float32))[low]) ** 2).sum()

        power = power_of(a & b)
        moved = np.array([power_of(a & np.roll(b, rng.integers(b.shape), axis=(0, 1, 2))) for _ in range(OFFSETS)])
        shuffled = np.mean([power_of(np.logical_and(*on_common_period(halftone < level, rng.permuted(shape.ravel()).reshape(
            shape.shape) < level))) for _ in range(OFFSETS // 10)])
        rows.append({"level": level, "share": (a & b).mean(), "expected": level**2, "power": power / moved.mean(),
                     "power_score": (power - moved.mean()) / moved.std(), "of_shuffled": power / shuffled,
                     "alone_of_shuffled": power_of(a) / shuffled})
    return rows


def controls(halftone, pitch):
    """Returns two masks of the size of that of `dither` that do depend on the halftone mask, by name."""
    rng = np.random.default_rng(SEED)
    repeated, _ = on_common_period(halftone, np.empty(SHAPE_SIZE, bool))
    noisy, planted = rng.random(SHAPE_SIZE, np.float32), rng.random(SHAPE_SIZE, np.float32)
    noisy += 0.05 * repeated[tuple(map(slice, SHAPE_SIZE))]
    planted[:, :HALF, 0] = repeated[:SHAPE_SIZE[0], :HALF, 0]
    return {"a little in noise": noisy, "one half layer": planted}


def study(program, folder, pitch, shapes):
    """Returns the figures of a lattice. shapes: the masks of `dither` by seed."""
    tiles, equal = ({seed: halftone_tile(program, folder, pitch, seed + added) for seed in SEEDS} for added in (SEED_OF_MASK, 0))
    pairs = {f"{a}, {b}": (tiles[a], shapes[b]) for a in SEEDS for b in SEEDS}
    pairs |= {f"equal, {seed}": (equal[seed], shapes[seed]) for seed in SEEDS}
    pairs |= {name: (tiles[1], mask) for name, mask in controls(tiles[1], pitch).items()}
    return rounded({"pairs": {name: compare(*pair, pitch) for name, pair in pairs.items()},
                    "products": {name: products(*pairs[name], pitch) for name in ("1, 1", "equal, 1")}})


def lines_of(lattice, result):
    heads = "".join(f"{f'< {level:g}':>7}" for level in LEVELS)
    lines = [lattice, f"{'seeds of halftone, dither':26}{'correlation':>12}{'score':>7}{heads}"
             f"{'greatest':>10}{'bands':>7}{'halves':>8}{'rms':>6}{'by index':>10}"]
    for name, figures in result["pairs"].items():
        columns = [figures["grey"], *(figures[f"below {level:g}"] for level in LEVELS)]
        scores = "".join(f"{entry['score']:7.2f}" for entry in columns)
        greatest, band = max(entry["greatest"] for entry in columns), np.abs(columns[0]["bands"]).max()
        lines.append(f"{name:26}{columns[0]['correlation']:12.5f}{scores}{greatest:10.2f}{band:7.2f}"
                     f"{figures['halves']['greatest']:8.2f}{figures['halves']['rms']:6.2f}"
                     f"{figures.get('by_index', np.nan):10.4f}")
    for name, rows in result["products"].items():
        lines.append(f"product, seeds {name:9}{'share':>10}{'expected':>10}{'power':>8}{'score':>8}{'of shuffled':>13}"
                     f"{'alone':>8}")
        lines += ["< {level:<22g}{share:10.5f}{expected:10.5f}{power:8.3f}{power_score:8.2f}{of_shuffled:13.3f}"
                  "{alone_of_shuffled:8.3f}".format(**row) for row in rows]
    return lines


def plot(path, results):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    picture, axes = plt.subplots(1, len(results), figsize=(11, 3.4), sharey=True, squeeze=False)
    centres = (BANDS[:-1] + BANDS[1:]) / 2
    for axis, (lattice, result) in zip(axes[0], results.items()):
        for name, figures in result["pairs"].items():
            if "," in name:
                equal = name.startswith("equal")
                axis.plot(centres, figures["grey"]["bands"], color="C3" if equal else "0.6", lw=1, zorder=3 - equal)
        axis.set(title=lattice, xlabel="cycles / mm")
        axis.grid(alpha=0.3)
    axes[0, 0].set(ylabel="cross spectrum,\nstandard deviations")
    lines = [plt.Line2D([], [], color=colour) for colour in ("C3", "0.6")]
    axes[0, 0].legend(lines, ["masks of one seed", "masks of the program"], fontsize=8)
    picture.savefig(path, dpi=90, bbox_inches="tight")


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(f"{value:.4g}") if isinstance(value, (float, np.floating)) else value


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--program", type=pathlib.Path, required=True)
    parser.add_argument("--lattice", action="append", choices=LATTICES)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--plot", type=pathlib.Path)
    arguments = parser.parse_args()
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        shapes = {seed: shape_tile(arguments.program, folder, seed) for seed in SEEDS}
        for lattice in arguments.lattice or LATTICES:
            results[lattice] = study(arguments.program, folder, LATTICES[lattice], shapes)
            print("\n".join(lines_of(lattice, results[lattice])), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(results) + "\n")
    if arguments.plot:
        plot(arguments.plot, results)


main()
