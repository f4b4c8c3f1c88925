#!/usr/bin/python3
"""Fits the mixing model of a printer profile to patches whose colour a Monte Carlo walk of light predicts.

    samples/colour/characterize.py PROFILE.json OUT.json [--program build/release/vdbdither] [--patches N] [--photons N]
        [--changed SEED] [--steps "dither --mask none ! halftone --white absolute"] [--verify N] [--json FILE]

Each patch is a plate of one colour, printed by the program; without --program, by error diffusion (oracles.py) of random
coverages. Its upper 1 mm on a white core, together 2 mm, is lit from above and seen from everywhere (monte_carlo.cpp, built
with g++). OUT gets what fits best for red, green and blue: "kubelka_munk" with the "absorption" and "scattering" of each
material, by which the program mixes, and "yule_nielsen" with "linear_rgb", by which it shows colours and mixes fewer than four
inks. --verify prints colours with OUT, and compares their walks with what was wanted. The table also says how well other models
(mixing_models.py) fit the same patches.

The coefficients of the inks are those that Elek, Sumin, Zhang, Weyrich, Myszkowski, Bickel, Wilkie, Krivanek measured on the
Vero inks of Stratasys: Scattering-aware Texture Reproduction for 3D Printing, ACM TOG 36(6), 2017: albedo and extinction in
1/mm for red, green and blue, with isotropic scattering and a refractive index of 1.5. For other inks, and for the clear one, they
are an assumption.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

import mixing_models as models
import numpy as np
import optics
import oracles
import study

# Parts of the names of materials in lower case, albedo, extinction in 1/mm.
INKS = (
    (("cyan",), (0.05, 0.7, 0.98), (9.0, 4.5, 7.5)),
    (("magenta", "mgnt"), (0.98, 0.1, 0.9), (2.5, 3.0, 10.0)),
    (("yellow",), (0.997, 0.995, 0.15), (2.25, 3.75, 19.0)),
    (("black",), (0.35, 0.35, 0.35), (5.0, 5.5, 6.5)),
    (("white", "wht"), (0.9991, 0.9997, 0.999), (6.0, 9.0, 24.0)),
    (("clear",), (0.5, 0.5, 0.5), (0.01, 0.01, 0.01)),
)
WHITE = INKS[4][0]
REFRACTIVE_INDEX = 1.5
SHELL_MM, THICKNESS_MM = 1.0, 2.0
PATCH_MM, CUT_MM = (2.4, 2.4, 1.8), 0.4
SEED = 5


def ink_of(name):
    """Returns albedo and extinction, [3] each, of the material with this name. Raises ValueError if nothing is known of it."""
    for words, albedo, extinction in INKS:
        if any(word in name.lower() for word in words):
            return np.array(albedo), np.array(extinction)
    raise ValueError(f"no optical coefficients are known of the material {name}")


def white_of(materials):
    """Returns the place of the white material. Raises ValueError if there is none."""
    for m, entry in enumerate(materials):
        if any(word in entry["name"].lower() for word in WHITE):
            return m
    raise ValueError("the profile has no white material for the core")


class Walker:
    """Builds monte_carlo.cpp in a folder and runs it there."""

    def __init__(self, folder, photons):
        self.folder, self.photons = pathlib.Path(folder), photons
        source = pathlib.Path(__file__).resolve().parent / "monte_carlo.cpp"
        subprocess.run(["g++", "-std=c++20", "-O3", "-pthread", source, "-o", self.folder / "monte_carlo"], check=True)

    def reflectances(self, block, pitch_mm, coefficients, illumination="normal", refractive_index=REFRACTIVE_INDEX):
        """Returns reflectance, its standard error, transmittance and its standard error of each channel, [channels, 4].

        block         uint8 [z, y, x]: indices of materials from 1
        coefficients  [materials, channels, 3]: absorption and scattering in 1/mm, anisotropy
        """
        lines = ["size " + " ".join(map(str, block.shape[::-1])), "pitch_mm " + " ".join(map(repr, map(float, pitch_mm))),
                 f"refractive_index {refractive_index}", f"illumination {illumination}", f"photons {self.photons}",
                 f"seed {SEED}"]
        lines += ["material " + " ".join(repr(float(value)) for value in np.ravel(material)) for material in coefficients]
        (self.folder / "scene.txt").write_text("\n".join(lines) + "\n")
        (self.folder / "voxels").write_bytes(np.ascontiguousarray(block, np.uint8).tobytes())
        done = subprocess.run([self.folder / "monte_carlo", self.folder / "scene.txt", self.folder / "voxels"],
                              capture_output=True, text=True)
        if done.returncode:
            raise ValueError(done.stderr.strip())
        return np.array([line.split() for line in done.stdout.splitlines()], float)


def coefficients_of(materials, changed=0):
    """Returns [materials, 3, 3] for Walker: isotropic scattering.

    changed  seed by which every coefficient is multiplied by 0.8 or 1.2 at random; 0 leaves them
    """
    factors = np.random.default_rng(changed).choice((0.8, 1.2), (len(materials), 2, 3)) if changed else np.ones((len(materials), 2, 3))
    result = []
    for entry, (of_absorption, of_scattering) in zip(materials, factors):
        albedo, extinction = ink_of(entry["name"])
        result.append(np.stack([extinction * (1 - albedo) * of_absorption, extinction * albedo * of_scattering, np.zeros(3)], axis=1))
    return np.array(result)


def block_of(stack):
    """Returns the upper SHELL_MM of the middle of a plate that faces up, uint8 [z, y, x]; all of it is printed."""
    cut = [int(np.ceil(CUT_MM / pitch)) for pitch in stack.pitch_mm[:2]]
    middle = stack.voxels[:, cut[1]:-cut[1], cut[0]:-cut[0]]
    full = np.flatnonzero((middle > 0).all(axis=(1, 2)))
    count = round(SHELL_MM / stack.pitch_mm[2])
    block = middle[full[-1] + 1 - count:full[-1] + 1]
    if len(block) < count or not block.all():
        raise ValueError("there is no printed block under the top of the plate")
    return block


def on_core(block, pitch_mm, white):
    """Returns the block on a core of the material `white`, THICKNESS_MM high in all."""
    count = round(THICKNESS_MM / pitch_mm[2]) - len(block)
    return np.concatenate([np.full((count, *block.shape[1:]), white, np.uint8), block])


def coverages_of(block, count):
    return np.bincount(block.ravel(), minlength=count + 1)[1:] / block.size


class Press:
    """Makes blocks of wanted colours on the lattice of a profile. Materials are those of the profile, in its order."""

    def __init__(self, profile, folder, program=None, steps=None, profile_path=None, changed=0):
        self.profile, self.materials = profile, profile["materials"]
        self.inks = study.inks_of(self.materials)
        self.pitch_mm = np.array([length_mm(text) for text in profile["pitch_mm"]])
        self.program = study.Program(program, folder, steps) if program else None
        self.path = str(profile_path)
        self.coefficients = coefficients_of(self.materials, changed)
        self.count = 0

    def mixed(self, coverages):
        """Returns the linear colours [..., 3] that the profile predicts for mixtures [..., inks]."""
        if "kubelka_munk" in self.profile:
            model = models.kubelka_munk_of_profile(self.profile, self.inks)
            return models.predict_kubelka_munk(np.atleast_2d(coverages), model).reshape(*np.shape(coverages)[:-1], 3)
        return optics.mixed(coverages, optics.material_colours(self.materials)[self.inks], optics.yule_nielsen(self.profile))

    def block(self, coverages):
        """Returns the block of a mixture of the inks; with the program, of the colour that the profile predicts for it."""
        self.count += 1
        if not self.program:
            everything = np.zeros(len(self.materials))
            everything[self.inks] = coverages
            shape = [round(length / pitch) for length, pitch in zip((1.6, 1.6, SHELL_MM), self.pitch_mm)][::-1]
            return oracles.diffused(np.ones(shape, bool), everything, oracles.SERIAL)
        stack = self.program.stack(self.path, (0, 0, 1), PATCH_MM, study.place_of(self.count),
                                   self.mixed(coverages))
        index = {entry["name"]: m + 1 for m, entry in enumerate(self.materials)}
        return np.array([0] + [index[entry["name"]] for entry in stack.materials], np.uint8)[block_of(stack)]


def length_mm(text):
    """Returns a length of a profile in mm: a number of mm, or a text with dpi, um or mm."""
    if isinstance(text, (int, float)):
        return float(text)
    for unit, convert in {"dpi": lambda x: 25.4 / x, "um": lambda x: x / 1000, "mm": lambda x: x}.items():
        if text.endswith(unit):
            return convert(float(text[:-len(unit)]))
    return float(text)


def patch_mixtures(inks, count):
    """Returns coverages [count, inks]: each ink alone, halves of two, and random mixtures of all and of few."""
    rows = list(np.eye(inks))
    rows += [(np.eye(inks)[a] + np.eye(inks)[b]) / 2 for a in range(inks) for b in range(a)]
    random = np.random.default_rng(SEED)
    while len(rows) < count:
        rows.append(random.dirichlet(np.full(inks, 1.0 if len(rows) % 2 else 0.4)))
    return np.array(rows[:count])


def line_of(title, wanted, found):
    de = study.differences(wanted, found)
    return f"{title:40}{len(de):6}{np.median(de):10.3f}{np.percentile(de, 95):10.3f}{de.max():10.3f}"


def with_models(profile, n, colours, kubelka_munk, covered):
    """Returns the profile with the fitted models; materials that no patch had stay as they were."""
    def digits(values):
        return [float(f"{value:.6g}") for value in values]

    mirror, absorption, scattering = models.profile_of_kubelka_munk(kubelka_munk, int(covered.sum()))
    materials = list(profile["materials"])
    for place, m in enumerate(np.flatnonzero(covered)):
        materials[m] = {**materials[m], "linear_rgb": digits(np.clip(colours[m], 0, 1)), "absorption": digits(absorption[place]),
                        "scattering": digits(scattering[place])}
    note = "colours of mixtures: fitted to a simulation with the coefficients of Elek et al., ACM TOG 36(6), 2017"
    source = "; ".join(text for text in (profile.get("source"), note) if text)
    return {**profile, "name": profile["name"] + "-simulated", "source": source,
            "yule_nielsen": [min(16, max(1, round(float(value), 4))) for value in n], "kubelka_munk": mirror, "materials": materials}


def walk(press, walker, mixtures):
    """Returns coverages [patches, materials], reflectances [patches, 3] and their standard errors [patches, 3]."""
    coefficients, white = press.coefficients, white_of(press.materials) + 1
    coverages, results = [], []
    for number, mixture in enumerate(mixtures):
        block = press.block(mixture)
        coverages.append(coverages_of(block, len(press.materials)))
        results.append(walker.reflectances(on_core(block, press.pitch_mm, white), press.pitch_mm, coefficients))
        if number % 25 == 24:
            study.note(f"{press.profile['name']}: patch {number + 1} of {len(mixtures)}")
    results = np.array(results)
    return np.array(coverages), results[..., 0], results[..., 1]


def characterized(profile, press, walker, patches):
    """Returns the fitted profile, a table as lines, and the patches as dictionaries."""
    coverages, reflectances, errors = walk(press, walker, patch_mixtures(len(press.inks), patches))
    covered = coverages.max(axis=0) > 0.05
    seen = coverages[:, covered]
    n, colours = models.fit_yule_nielsen(seen, reflectances)
    everything = np.zeros((len(press.materials), 3))
    everything[covered] = colours
    kubelka_munk = models.fit_kubelka_munk(seen, reflectances)
    new = with_models(profile, n, everything, kubelka_munk, covered)
    before = optics.mixed(coverages, optics.material_colours(press.materials), optics.yule_nielsen(profile))
    lines = [f"{'CIEDE2000 to the walk of light':40}{'cases':>6}{'median':>10}{'95 %':>10}{'worst':>10}",
             line_of("the profile as it was", reflectances, before),
             line_of("fitted: Yule and Nielsen", reflectances, optics.mixed(seen, colours, n)),
             line_of("fitted: Kubelka and Munk", reflectances, models.predict_kubelka_munk(seen, kubelka_munk)),
             "patches that the fit had not seen:"]
    def any_sign(*rows):
        return models.fit_yule_nielsen(*rows, negative=True)

    for title, fit, predict in (("  Yule and Nielsen", models.fit_yule_nielsen, models.predict_yule_nielsen),
                                ("  Yule and Nielsen, n of any sign", any_sign, models.predict_yule_nielsen),
                                ("  Kubelka and Munk", models.fit_kubelka_munk, models.predict_kubelka_munk)):
        lines.append(line_of(title, reflectances, models.left_out(seen, reflectances, fit, predict)))
    lines = [*lines,
             line_of("the standard error of the walk itself", reflectances, reflectances + errors),
             "n: " + " ".join(f"{value:.3f}" for value in n)]
    for entry, colour, known in zip(press.materials, everything, covered):
        if known:
            lines.append(f"{entry['name']:16} linear RGB " + " ".join(f"{value:.4f}" for value in colour) + "   was "
                         + " ".join(f"{value:.4f}" for value in optics.material_colours([entry])[0]))
    cases = [{"coverage": dict(zip((entry["name"] for entry in press.materials), row.tolist())),
              "linear_rgb": found.tolist(), "standard_error": error.tolist()}
             for row, found, error in zip(coverages, reflectances, errors)]
    return new, lines, cases


def verified(press, walker, count):
    """Returns a line: the walks of random colours that `press` prints against the colours that were wanted."""
    mixtures = np.random.default_rng(SEED + 1).dirichlet(np.ones(len(press.inks)), count)
    wanted = press.mixed(mixtures)
    _, reflectances, _ = walk(press, walker, mixtures)
    return line_of("wanted colours, printed with the fit", wanted, reflectances)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("profile", metavar="PROFILE.json")
    parser.add_argument("out", metavar="OUT.json")
    parser.add_argument("--program", help="path of vdbdither; without it, error diffusion prints the patches")
    parser.add_argument("--steps", default="dither --mask none ! halftone --white absolute", help="stages between mesh2sdf and slice-export")
    parser.add_argument("--patches", type=int, default=150)
    parser.add_argument("--photons", type=int, default=100000, help="for each patch and channel")
    parser.add_argument("--changed", type=int, default=0, metavar="SEED",
                        help="multiplies every coefficient of the inks by 0.8 or 1.2 at random")
    parser.add_argument("--verify", type=int, default=0, metavar="N", help="colours to print with the result")
    parser.add_argument("--json", metavar="FILE", help="writes the patches")
    arguments = parser.parse_args()
    profile = json.loads(pathlib.Path(arguments.profile).read_text())
    out = pathlib.Path(arguments.out)
    with tempfile.TemporaryDirectory(prefix="vdbdither-patches-") as folder:
        try:
            walker = Walker(folder, arguments.photons)
            press = Press(profile, folder, arguments.program, arguments.steps, pathlib.Path(arguments.profile).resolve(),
                          arguments.changed)
            new, lines, cases = characterized(profile, press, walker, arguments.patches)
            print(*lines, sep="\n", flush=True)
            out.write_text(json.dumps(new, indent=2, ensure_ascii=False) + "\n")
            if arguments.verify:
                press = Press(new, folder, arguments.program, arguments.steps, out.resolve(), arguments.changed)
                print(verified(press, walker, arguments.verify))
        except ValueError as problem:
            raise SystemExit(f"characterize: {problem}")
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(cases, indent=1) + "\n")


if __name__ == "__main__":
    main()
