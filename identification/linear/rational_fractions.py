"""Modal model by weighted least squares: common poles by Levenberg-Marquardt, everything linear eliminated.

The accelerance of the channel o is ``H_o = sum_k (a_ok + b_ok s) g_k(s) + L_o + U_o s^2`` with ``g = s^2 / (s^2 + 2 z w s
+ w^2)``; b = 0 for normal modes. Given poles, a, b, L and U follow by linear least squares (variable projection: Golub and
Pereyra, SIAM J. Numer. Anal. 10, 1973); their step is the Schur complement of the full Gauss-Newton step. The
parameters' covariance is ``M^-1 (1/2 Re sum J^H W C W^H J) M^-1`` with ``M = Re sum J^H J``: right for the errors C that the
lines have, whatever the weights are (Pintelon and Schoukens, 2nd ed., section 9.9).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.linear.accelerance import WeightedResponses

__all__ = ["ModalFit", "fit_modes", "whitened_jacobian", "whitened_misfit"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_ITERATIONS = 60
_STEP_STD = 1e-4
"""Converged where a step moves no pole by more than this part of its standard error."""


@dataclass(frozen=True, eq=False)
class ModalFit:
    """Parameters of a modal model and their errors.

    Parameters
    ----------
    poles
        float[2 n_modes], natural angular frequencies (rad/s), then damping ratios.
    terms
        float[n_outputs, n_terms], a (1/kg) of every mode, then b (s/kg) of every mode if the fit has them, then L (1/kg), U
        (s^2/kg).
    covariance
        float[m, m] of ``(poles, terms row by row)``.
    residual
        Root of the mean square of misfit over what its covariance lets expect; NaN where no covariance is known.
    converged
        Whether the iteration came to rest.
    """

    poles: Float
    terms: Float
    covariance: Float
    residual: float
    converged: bool


def _basis(s: Complex, poles: Float, normal: bool) -> Complex:
    """complex[n_lines, n_terms]."""
    omega, zeta = np.split(poles, 2)
    modal = s[:, None] ** 2 / (s[:, None] ** 2 + 2.0 * zeta * omega * s[:, None] + omega**2)
    rest = np.stack([np.ones_like(s), s**2], axis=1)
    return np.hstack([modal, rest] if normal else [modal, modal * s[:, None], rest])


def whitened_misfit(data: WeightedResponses, poles: Float, terms: Float, *, normal: bool) -> Complex:
    """complex[n_lines, n_outputs]: ``W (H - model)``."""
    misfit = data.value[:, :, 0] - _basis(data.s, poles, normal) @ terms.T
    return np.asarray(np.einsum("kpo,ko->kp", data.whitening, misfit))


def whitened_jacobian(data: WeightedResponses, poles: Float, terms: Float, *, normal: bool) -> Complex:
    """complex[n_lines, n_outputs, m]: derivative of `whitened_misfit` by ``(poles, terms row by row)``."""
    s, (omega, zeta) = data.s[:, None], np.split(poles, 2)
    count = omega.size
    denominator = s**2 + 2.0 * zeta * omega * s + omega**2
    slope = -(s**2) / denominator**2
    numerator = np.broadcast_to(terms[:, None, :count], (terms.shape[0], s.size, count))
    if not normal:
        numerator = numerator + terms[:, None, count : 2 * count] * s
    by_poles = np.concatenate(
        [numerator * slope * (2.0 * zeta * s + 2.0 * omega), numerator * slope * 2.0 * omega * s], axis=2
    )
    white = data.whitening
    first = -np.einsum("kpo,okm->kpm", white, by_poles)
    second = -np.einsum("kpo,kt->kpot", white, _basis(data.s, poles, normal))
    return np.concatenate([first, second.reshape(*white.shape[:2], -1)], axis=2)


def _real(rows: Complex, columns: int) -> Float:
    """Complex equations in real unknowns as real ones."""
    flat = rows.reshape(-1, columns)
    return np.concatenate([flat.real, flat.imag])


def _linear_terms(data: WeightedResponses, poles: Float, normal: bool) -> tuple[Float, Float, float]:
    """Best terms, an orthonormal basis of what they can explain, and the cost that is left."""
    white, outputs = data.whitening, data.value.shape[1]
    basis = _basis(data.s, poles, normal)
    size = np.linalg.norm(basis, axis=0)
    design = _real(np.einsum("kpo,kt->kpot", white, basis / size), outputs * size.size)
    wanted = _real(np.einsum("kpo,ko->kp", white, data.value[:, :, 0]), 1)[:, 0]
    orthonormal, triangle = np.linalg.qr(design)
    known = orthonormal.T @ wanted
    terms = np.linalg.lstsq(triangle, known, rcond=None)[0].reshape(outputs, -1) / size
    return terms, orthonormal, float(np.sum((wanted - orthonormal @ known) ** 2))


def fit_modes(data: WeightedResponses, poles: Float, *, normal: bool = True) -> ModalFit:
    """Weighted least-squares fit of a modal model from starting ``poles`` (rad/s, then damping ratios)."""
    count, damping, converged = poles.size, 1e-3, False
    terms, orthonormal, cost = _linear_terms(data, poles, normal)
    for _ in range(_ITERATIONS):
        misfit = _real(whitened_misfit(data, poles, terms, normal=normal), 1)[:, 0]
        jacobian = _real(whitened_jacobian(data, poles, terms, normal=normal)[..., :count], count)
        jacobian -= orthonormal @ (orthonormal.T @ jacobian)
        hessian, gradient = jacobian.T @ jacobian, jacobian.T @ misfit
        scale = np.sqrt(np.diag(hessian)) + 1e-300
        hessian /= np.outer(scale, scale)
        for _ in range(12):
            step = -np.linalg.solve(hessian + damping * np.eye(count), gradient / scale) / scale
            trial = poles + step
            allowed = np.all(trial[: count // 2] > 0.0) and np.all(np.abs(trial[count // 2 :]) < 1.0)
            if allowed and (new := _linear_terms(data, trial, normal))[2] <= cost * (1.0 + 1e-12):
                break
            damping = 10.0 * damping + 1e-6
        else:
            break
        poles, (terms, orthonormal, cost), damping = trial, new, 0.1 * damping
        # A misfit of one unit a value is what noise leaves, so that the columns' lengths are inverse standard errors.
        if np.max(np.abs(step * scale)) <= _STEP_STD * np.sqrt(cost / misfit.size + 1e-300):
            converged = True
            break
    return _with_errors(data, poles, terms, normal, converged)


def _with_errors(data: WeightedResponses, poles: Float, terms: Float, normal: bool, converged: bool) -> ModalFit:
    jacobian = whitened_jacobian(data, poles, terms, normal=normal)
    misfit = whitened_misfit(data, poles, terms, normal=normal)
    flat = _real(jacobian, jacobian.shape[2])
    scale = np.linalg.norm(flat, axis=0) + 1e-300
    inverse = np.linalg.pinv((flat / scale).T @ (flat / scale), rcond=1e-14, hermitian=True)
    freedom = max(1.0 - flat.shape[1] / flat.shape[0], 1e-3)
    if data.covariance is None:
        spread = np.mean(np.abs(misfit) ** 2) / freedom
        covariance, residual = 0.5 * spread * inverse, np.nan
    else:
        white = data.whitening
        own = white @ data.covariance @ np.conj(np.swapaxes(white, 1, 2))
        coloured = (own @ jacobian) / scale
        filling = 0.5 * np.einsum("kpm,kpn->mn", np.conj(jacobian) / scale, coloured, optimize=True).real
        covariance = inverse @ filling @ inverse
        residual = float(np.sqrt(np.sum(np.abs(misfit) ** 2) / freedom / np.einsum("kpp->", own).real))
    covariance = covariance / np.outer(scale, scale)
    return ModalFit(poles, terms, 0.5 * (covariance + covariance.T), residual, converged)
