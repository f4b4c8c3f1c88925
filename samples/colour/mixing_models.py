"""Models of the colour of mixtures, fitted to coverages and reflectances of patches.

Yule-Nielsen      R = (sum c_i R_i^(1/n))^n for each channel of linear RGB; the one that printer profiles hold (optics.py)
Kubelka-Munk      absorption K and scattering S of each material, mixed by coverage; reflectance of an opaque layer, under a
                  surface that mirrors: Saunderson: Calculation of the Color of Pigmented Plastics, Journal of the Optical
                  Society of America 32(12), 1942, pp. 727-736
"""

import numpy as np
import optics

# Beyond, the law hardly differs from the geometric mean.
MOST_YULE_NIELSEN = 20
LEAST_REFLECTANCE = 1e-5
OUTER_MIRROR, INNER_MIRROR = 0.04, 0.6


def nonnegative(matrix, wanted):
    """Returns the solution of least squares that is not negative (Lawson, Hanson: Solving Least Squares Problems, 1974)."""
    columns = matrix.shape[1]
    chosen, solution = np.zeros(columns, bool), np.zeros(columns)
    for _ in range(10 * columns):
        gradient = matrix.T @ (wanted - matrix @ solution)
        if chosen.all() or gradient[~chosen].max() < 1e-12:
            break
        chosen[np.flatnonzero(~chosen)[gradient[~chosen].argmax()]] = True
        while True:
            trial = np.zeros(columns)
            trial[chosen] = np.linalg.lstsq(matrix[:, chosen], wanted, rcond=None)[0]
            low = chosen & (trial <= 0)
            if not low.any():
                break
            step = (solution[low] / (solution[low] - trial[low])).min()
            solution += step * (trial - solution)
            chosen &= solution > 1e-14
        solution = trial
    return solution


def fit_yule_nielsen(coverages, reflectances, negative=False):
    """Returns n [3] and the colours of the materials [materials, 3] that fit best, by the cube roots of the reflectances.

    coverages     [patches, materials]
    reflectances  [patches, 3], above 0
    negative      n below 0 is tried too: n = -1 mixes 1 / R, as absorption mixes in a translucent material
    """
    exponents, colours = [], []
    for measured in reflectances.T:
        def at(n):
            # The weight turns a difference of R^(1/n) into one of the cube root of R.
            weight = abs(n) / 3 * measured ** (1 / 3 - 1 / n)
            roots = nonnegative(coverages * weight[:, None], measured ** (1 / n) * weight)
            found = np.clip(np.maximum(roots, 1e-12) ** n, LEAST_REFLECTANCE, 1)
            return ((np.cbrt(optics.mixed(coverages, found[:, None], n)[:, 0]) - np.cbrt(measured)) ** 2).sum(), found

        grids = [np.geomspace(0.5, MOST_YULE_NIELSEN, 60)] + ([-np.geomspace(0.5, MOST_YULE_NIELSEN, 60)] if negative else [])
        tried = []
        for grid in grids:
            place = int(np.argmin([at(n)[0] for n in grid]))
            fine = np.linspace(grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)], 41)
            n = fine[np.argmin([at(n)[0] for n in fine])]
            tried.append((*at(n), n))
        _, found, n = min(tried, key=lambda one: one[0])
        exponents.append(n)
        colours.append(found)
    return np.array(exponents), np.array(colours).T


def predict_yule_nielsen(coverages, model):
    n, colours = model
    return optics.mixed(coverages, colours, n)


def fit_kubelka_munk(coverages, reflectances, steps=200):
    """Returns the parameters [3, 2 materials + 1] that fit best, by the cube roots of the reflectances: see _opaque.

    Levenberg, Marquardt: damped least squares, with numerical derivatives.
    """
    def residual(parameters, wanted):
        return wanted - np.cbrt(_opaque(coverages, parameters))

    models = []
    for measured in reflectances.T:
        wanted, count = np.cbrt(measured), coverages.shape[1]
        parameters, damping = np.concatenate([np.zeros(2 * count), [np.log(INNER_MIRROR / (1 - INNER_MIRROR))]]), 1e-2
        rest = residual(parameters, wanted)
        for _ in range(steps):
            slopes = np.array([(residual(parameters - 1e-5 * axis, wanted) - rest) / 1e-5 for axis in np.eye(2 * count + 1)]).T
            step = np.linalg.solve(slopes.T @ slopes + damping * np.eye(2 * count + 1), slopes.T @ rest)
            trial = residual(parameters + step, wanted)
            better = trial @ trial < rest @ rest
            damping *= 0.5 if better else 3
            if better:
                parameters, rest = parameters + step, trial
        models.append(parameters)
    return np.array(models)


def predict_kubelka_munk(coverages, model):
    return np.stack([_opaque(coverages, parameters) for parameters in model], axis=-1)


def _opaque(coverages, parameters):
    """Returns reflectances [patches]; parameters: the logarithms of K and S of each material, and the logit of what the surface
    mirrors back inside."""
    count = coverages.shape[1]
    ratio = (coverages @ np.exp(parameters[:count])) / (coverages @ np.exp(parameters[count:2 * count]))
    inner = 1 / (1 + np.exp(-parameters[-1]))
    opaque = 1 + ratio - np.sqrt(ratio**2 + 2 * ratio)
    return (1 - OUTER_MIRROR) * (1 - inner) * opaque / (1 - inner * opaque)


def profile_of_kubelka_munk(model, materials):
    """Returns what a printer profile holds of a model: the mirror of the surface, and absorption and scattering [materials, 3].

    Each channel has a unit of its own, in which the largest coefficient is 1.
    """
    logarithms = model[:, :2 * materials]
    scaled = np.exp(logarithms - logarithms.max(axis=1, keepdims=True))
    inner = 1 / (1 + np.exp(-model[:, -1]))
    return {"outer": OUTER_MIRROR, "inner": [round(float(share), 6) for share in np.minimum(inner, 0.99)]}, \
        scaled[:, :materials].T, scaled[:, materials:].T


def kubelka_munk_of_profile(profile, inks):
    """Returns the model [3, 2 materials + 1] of the inks, places in the materials of a printer profile."""
    def logarithms(key):
        return np.log(np.maximum([profile["materials"][ink][key] for ink in inks], 1e-12))

    inner = np.clip(profile["kubelka_munk"]["inner"], 1e-9, 0.99)
    return np.column_stack([logarithms("absorption").T, logarithms("scattering").T, np.log(inner / (1 - inner))])


def left_out(coverages, reflectances, fit, predict, parts=5):
    """Returns the colours [patches, 3] that a model predicts for patches from fits to the others."""
    predicted = np.zeros_like(reflectances)
    for part in range(parts):
        out = np.arange(len(coverages)) % parts == part
        predicted[out] = predict(coverages[out], fit(coverages[~out], reflectances[~out]))
    return predicted
