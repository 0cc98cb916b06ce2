"""What a linear model misses in the responses of a nonlinear structure: its scatter, its effect on the poles, the weights.

The best linear approximation of a strongly nonlinear structure is not the response of linear modes. The pole that fits it best
then depends on how lines are weighted. Lines far from the resonance have small errors, so that weights by noise or total
variance fit them and leave the misfit to the resonance: on a hardening oscillator damping ratios came out 10 to 25 % below
those that reproduce the resonance. Weights by equal relative errors do not have this preference, but larger random errors.
All of these weights are admissible, so that their largest difference is an error of the model.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.linear.accelerance import WeightedResponses, pooled, relative_weights
from identification.linear.rational_fractions import ModalFit, fit_modes, modal_basis
from vibrolock.arrays import Complex, Float

_WINDOW = 9
"""Lines over which the misfit is taken as smooth, that is as a parabola; 6 degrees of freedom are left for its scatter."""
_DISTORTED = 0.05
"""Error of a response within the half-power bandwidth, relative to the response, from which model errors are looked for."""
_ALIKE = 0.5
"""Correlation of the misfit at neighbouring lines above which it is an error of the model; noise gives 0."""
_MISFIT = 0.01
"""Relative misfit below which an error of the model is not remarked on."""
_NOISE = 0.25
"""Largest share of noise in a total variance that is called distortion."""
_COMMON = 2.0
"""Factor of the frequency's standard error where errors are distortion; on a hardening oscillator 2.0 to 2.2 were found."""
_LARGEST_MOVE = 0.3
"""Largest relative change of frequency for which the other pole is taken to be the same mode."""


def line_scatter(misfit: Complex) -> Complex | None:
    """complex[n_lines, m, m]: covariance of complex[n_lines, m] about a parabola through the lines around; None for few lines.

    This is the local polynomial method (Pintelon and Schoukens, 2nd ed., chapter 7). Noise and nonlinear distortion scatter
    from line to line, the response and the error of a model do not.
    """
    lines = misfit.shape[0]
    if lines < _WINDOW:
        return None
    powers = np.linspace(-1.0, 1.0, _WINDOW)[:, None] ** np.arange(3)
    project = np.eye(_WINDOW) - powers @ np.linalg.pinv(powers)
    first = np.clip(np.arange(lines) - _WINDOW // 2, 0, lines - _WINDOW)
    scatter = np.einsum("ij,kjm->kim", project, misfit[first[:, None] + np.arange(_WINDOW)])
    return np.asarray(np.einsum("kim,kin->kmn", scatter, np.conj(scatter)) / (_WINDOW - powers.shape[1]))


def systematic_misfit(data: WeightedResponses, fit: ModalFit, *, normal: bool) -> list[str]:
    """Return a note on each mode at which a fit without known errors leaves a misfit that neighbouring lines have in common.

    Noise differs from line to line; what a further mode close by adds does not.
    """
    if data.covariance is not None:
        return []
    notes = []
    misfit = data.value[:, :, 0] - modal_basis(data.s, fit.poles, normal) @ fit.terms.T
    misfit = misfit / data.std[:, :, 0]
    for omega, zeta in zip(fit.omega, fit.zeta, strict=True):
        near = misfit[np.abs(2.0 * np.pi * data.frequency_hz - omega) <= 2.0 * abs(zeta) * omega]
        size = np.sum(np.abs(near) ** 2, axis=0)
        if len(near) < _WINDOW or not np.all(size > 0.0):
            continue
        alike = np.sum((near[1:] * np.conj(near[:-1])).real, axis=0) / size
        share = np.sqrt(size / len(near))
        if np.any((alike > _ALIKE) & (share > _MISFIT)):
            worst = 100.0 * float(np.max(share[alike > _ALIKE]))
            notes.append(
                f"mode at {omega / (2.0 * np.pi):.5g} Hz: the misfit is {worst:.2g} % of the response and not noise, "
                "as neighbouring lines share it: another mode nearby, or a nonlinear response; the intervals do not include it"
            )
    return notes


def is_mostly_distortion(total: WeightedResponses, noise: WeightedResponses | None, fit: ModalFit) -> bool:
    """Return whether the ``total`` errors around the modes are known to be far above those of noise alone."""
    if total.kind == "line scatter":
        return True
    if noise is None:
        return False
    near = np.any(_near_modes(total, fit), axis=0)
    return bool(np.any(near)) and bool(np.median((noise.std**2 / total.std**2)[near]) < _NOISE)


def with_line_scatter(data: WeightedResponses, fit: ModalFit, *, normal: bool) -> tuple[ModalFit, WeightedResponses]:
    """Return fit and responses with the total covariance taken from the scatter of neighbouring lines about the fit."""
    for _ in range(2):
        covariance = line_scatter(data.value[:, :, 0] - modal_basis(data.s, fit.poles, normal) @ fit.terms.T)
        if covariance is None:
            break
        data = replace(data, covariance=covariance, smooth=pooled(covariance), kind="line scatter")
        fit = fit_modes(data, fit.poles, normal=normal)
    return fit, data


def with_model_error(
    data: WeightedResponses,
    fit: ModalFit,
    total: WeightedResponses,
    noise: WeightedResponses | None,
    *,
    normal: bool,
    free: bool,
) -> tuple[ModalFit, WeightedResponses, list[str]]:
    """Compare ``fit`` with fits by other weights where distortion is large; return the fit to rely on, and notes.

    The others are the weights of ``total``, of ``noise`` if known, and relative ones. The largest squared difference between
    the fit and one of them is added as systematic variance. The fit by relative weights is returned if ``free``, else the one
    asked for. Where other weights give no such mode, the damping ratio is not identified: its error is as large as itself.
    """
    share = total.std[:, :, 0] * fit.misfit / np.maximum(np.abs(total.value[:, :, 0]), 1e-300)
    if not any(np.any(near) and np.median(share[near]) > _DISTORTED for near in _near_modes(data, fit)):
        return fit, data, []
    smooth = {"relative": relative_weights(data).smooth, total.kind: total.smooth}
    smooth |= {} if noise is None else {"noise": noise.smooth}
    weighted = {name: replace(data, smooth=matrix, kind=name) for name, matrix in smooth.items()} | {data.kind: data}
    fits = {name: fit_modes(one, fit.poles, normal=normal) for name, one in weighted.items() if one is not data}
    alike = {data.kind: fit} | {name: other for name, other in fits.items() if _same_modes(other, fit)}
    taken = "relative" if free and "relative" in alike else data.kind
    chosen, where = alike[taken], range(fit.omega.size)
    systematic = np.max([_difference(other, chosen) ** 2 for other in alike.values()], axis=0)
    ratios = [", ".join(f"{100 * other.zeta[k]:.3g} % by {name}" for name, other in alike.items()) for k in where]
    lost = ""
    if len(alike) < len(weighted):
        systematic[chosen.omega.size : 2 * chosen.omega.size] += chosen.zeta**2
        others = " and ".join(name for name in fits if name not in alike)
        lost = f"; weights by {others} give no such mode, and the damping ratio is not identified"
    notes = [
        f"mode at {chosen.omega[k] / (2.0 * np.pi):.5g} Hz: distortion is large at this level, the response is not that of a "
        f"linear mode; its damping ratio depends on the weights: {ratios[k]}; that by {taken} is used, intervals include "
        f"all{lost}"
        for k in where
    ]
    return replace(chosen, systematic=systematic), weighted[taken], notes


def _same_modes(other: ModalFit, fit: ModalFit) -> bool:
    near = np.abs(other.omega / fit.omega - 1.0) <= _LARGEST_MOVE
    return other is fit or (other.converged and bool(np.all(near) and np.all(other.zeta > 0.0)))


def _difference(other: ModalFit, fit: ModalFit) -> Float:
    """float[m]: differences of the parameters of two fits."""
    return np.concatenate([other.poles - fit.poles, (other.terms - fit.terms).ravel()])


def with_repeated_error(data: WeightedResponses, fit: ModalFit, error: Complex, *, normal: bool) -> ModalFit:
    """Return the fit with what an error of the responses, complex[n_lines, n_outputs], does to it as systematic variance.

    The error is the same in every record, so that neighbouring lines share it and their scatter does not show it.
    """
    other = fit_modes(replace(data, value=data.value - error[:, :, None]), fit.poles, normal=normal)
    before = 0.0 if fit.systematic is None else fit.systematic
    return replace(fit, systematic=before + _difference(other, fit) ** 2)


def with_common_distortion(fit: ModalFit) -> ModalFit:
    """Return the fit with frequency errors as distortion makes them, whose errors lines have in common.

    A cubic product of three lines falls on a fourth one, and so does each other three of them on the remaining line. A
    stiffness exchanges energy between the four, and detunes all of them alike: in the damping the four contributions cancel in
    part, in the frequency they add up to twice what independent lines would give.
    """
    scale = np.ones(fit.covariance.shape[0])
    scale[: fit.omega.size] = _COMMON
    return replace(fit, covariance=fit.covariance * np.outer(scale, scale))


def _near_modes(data: WeightedResponses, fit: ModalFit) -> NDArray[np.bool_]:
    """bool[n_modes, n_lines]: lines within the half-power bandwidth of each mode."""
    apart = np.abs(2.0 * np.pi * data.frequency_hz - fit.omega[:, None])
    return np.asarray(apart <= (np.abs(fit.zeta) * fit.omega)[:, None])
