"""Extrapolate modes from several force levels to zero force, to remove the effect of nonlinearity at these levels.

At low levels a property y follows ``y = y_0 + d F^p``. Smooth elements have p = 2: the contribution of a cubic spring or a
magnet to the best linear approximation grows with the variance of the response. Joints in micro-slip have p = 1 + chi, with
the exponent chi of Segalman's density (J. Appl. Mech. 72, 2005), chi in (-1, 0), for the energy lost per cycle. A finite
number of sliders departs from this law: below some level none slips, and above it properties change steeply. On the friction
beam the measured exponent was 1.3 for damping and 2.5 for frequency. Unless p is known, every p of a range is taken to be
equally likely: the result is the mean of the extrapolations over p, and their variance over p is added. From two levels of the
ratio r they are ``y_1 + (y_1 - y_2)/(r^p - 1)``, so that most of the range of results belongs to the smallest p.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.linear.modes import LinearModes, mac_matrix
from identification.validation import one_specimen
from vibrolock.arrays import Float

_SAME_HZ = 0.03
"""Relative difference of frequencies up to which two modes may be one. Chosen."""
_SAME_MAC = 0.8
"""MAC above which two modes may be one. Chosen."""
_EXPONENTS = 12
"""Number of exponents, at Gauss' points, over which a range is averaged. Chosen."""
_SPREAD = 1.1
"""Least ratio of successive force levels. Chosen."""


def extrapolated_to_zero(
    low: LinearModes, high: LinearModes, *further: LinearModes, exponent: float | tuple[float, float] = (1.0, 3.0)
) -> LinearModes:
    """Extrapolate modes to zero force from the same modes at two or more levels.

    Frequencies, damping ratios and shapes are fitted by straight lines over ``force_rms_n ** exponent``, each weighted by its
    standard errors. The residual terms of the lowest level are kept.

    Raises `IdentificationError` if levels are unknown or too close, channels differ, no mode is common to all levels,
    or exponents are not above zero.

    Parameters
    ----------
    low, high, further
        Modes of one structure with the same channels, at levels at least 10 % apart.
    exponent
        Power of the force in which properties are linear; 2 for smooth elements. If the lowest and the highest possible power
        are given, all between them are equally likely.
    """
    models = sorted((low, high, *further), key=lambda model: model.force_rms_n)
    force = np.array([model.force_rms_n for model in models])
    if not np.all(np.isfinite(force)) or force[0] <= 0.0 or np.any(force[1:] < _SPREAD * force[:-1]):
        listed = ", ".join(f"{value:.4g}" for value in force)
        raise IdentificationError(f"levels are {listed} N", field="force_rms_n", allowed="above zero and 10 % apart")
    powers = np.atleast_1d(np.asarray(exponent, dtype=np.float64))
    if powers.size > 2 or not np.all(np.isfinite(powers)) or np.any(powers <= 0.0):
        raise IdentificationError(field="exponent", value=exponent, allowed="one or two numbers above zero")
    one_specimen(**{f"level {force_n:.4g} N": model.specimen for force_n, model in zip(force, models, strict=True)})
    if any(model.channels != models[0].channels for model in models):
        raise IdentificationError("differ between the levels", field="channels")
    kept, values, covariances = _common(models)
    nodes, weights = np.polynomial.legendre.leggauss(_EXPONENTS)
    likely = np.mean(powers) + 0.5 * (powers[-1] - powers[0]) * nodes
    found = [_intercept(force**power, values, covariances) for power in likely]
    ends, share = np.array([one for one, _ in found]), 0.5 * weights
    mean = share @ ends
    covariance = np.tensordot(share, [one for _, one in found], 1) + np.diag(share @ (ends - mean) ** 2)
    return _model(models, kept, mean, covariance, force, powers)


def _common(models: Sequence[LinearModes]) -> tuple[list[int], Float, Float]:
    """Return the modes of the lowest level that all other levels have too.

    Also returns their parameters at each level, float[n_levels, m], and the covariances.
    """
    first, matches = models[0], []
    for k, frequency in enumerate(first.frequency_hz):
        partners = [model.nearest(float(frequency)) for model in models]
        if all(
            abs(model.frequency_hz[j] / frequency - 1.0) < _SAME_HZ and mac_matrix(first, model)[k, j] > _SAME_MAC
            for model, j in zip(models, partners, strict=True)
        ):
            matches.append((k, partners))
    IdentificationError.raise_if(not matches, "no mode is found at all levels", field="frequency_hz")
    values, covariances = [], []
    for level, model in enumerate(models):
        chosen = [partners[level] for _, partners in matches]
        count = model.frequency_hz.size
        index = np.concatenate([block * count + np.array(chosen) for block in range(2 + len(model.channels))])
        values.append(np.concatenate([model.frequency_hz, model.damping_ratio, model.shapes.ravel()])[index])
        if model.covariance is None:
            std = np.concatenate([model.frequency_std_hz, model.damping_ratio_std, model.shapes_std.ravel()])
            covariances.append(np.diag(std[index] ** 2))
        else:
            covariances.append(model.covariance[np.ix_(index, index)])
    return [k for k, _ in matches], np.array(values), np.array(covariances)


def _intercept(x: Float, values: Float, covariances: Float) -> tuple[Float, Float]:
    """Return the values at x = 0 of weighted straight lines over x, one per parameter, and their covariance."""
    variance = np.einsum("lii->li", covariances)
    weight = 1.0 / variance if np.all(np.isfinite(variance)) and np.all(variance > 0.0) else np.ones(values.shape)
    weight = weight / weight.sum(axis=0)
    mean = np.sum(weight * x[:, None], axis=0)
    spread = np.sum(weight * (x[:, None] - mean) ** 2, axis=0)
    share = weight * (1.0 - (x[:, None] - mean) * mean / spread)
    covariance = np.einsum("li,lij,lj->ij", share, covariances, share)
    return np.sum(share * values, axis=0), covariance


def _model(
    models: Sequence[LinearModes], kept: list[int], values: Float, covariance: Float, force: Float, powers: Float
) -> LinearModes:
    low, count = models[0], len(kept)
    std, rows = np.sqrt(np.diag(covariance)), len(low.channels)
    levels = ", ".join(f"{value:.4g}" for value in force)
    notes = [
        f"extrapolated to zero force from {levels} {low.force_unit} RMS, "
        f"taking changes as proportional to the force to the power of {' to '.join(f'{p:g}' for p in powers)}"
    ]
    for k in sorted(set(range(low.frequency_hz.size)) - set(kept)):
        notes.append(f"left out: mode at {low.frequency_hz[k]:.5g} Hz is not found at all levels")
    return replace(
        low,
        frequency_hz=values[:count],
        frequency_std_hz=std[:count],
        damping_ratio=values[count : 2 * count],
        damping_ratio_std=std[count : 2 * count],
        shapes=values[2 * count :].reshape(rows, count),
        shapes_std=std[2 * count :].reshape(rows, count),
        phase_collinearity=low.phase_collinearity[kept],
        covariance=covariance,
        residues=None if low.residues is None else low.residues[:, kept],
        force_rms_n=0.0,
        fit_residual=np.nan,
        notes=(*low.notes, *notes),
    )
