"""Weighted fit of a discrete-time state-space model to frequency responses.

The cost is ``sum_k e_k^H P_k e_k``. ``e_k`` holds all paths of ``H(z_k) - H_k`` with ``H(z) = C (z - A)^-1 B + D``, and P_k
is the inverse of their covariance (Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed.,
chapters 9 and 14). All entries of A, B, C and D are free. A similarity transform of the states changes no response, so that
the cost is flat in n^2 directions. Each Levenberg-Marquardt step is computed in the singular vectors of the column-scaled
Jacobian, without the flat directions (McKelvey, Helmersson and Ribarits, Automatica 40, 2004). The derivatives, with
``L = C (z - A)^-1`` and ``R = (z - A)^-1 B``, are

    dH/dA_ij = L_i R_j,    dH/dB_ij = L_i e_j,    dH/dC_ij = e_i R_j,    dH/dD_ij = e_i e_j.
"""

from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError
from identification.linear.accelerance import WeightedResponses, Weighting, weighted_responses
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.subspace import StateSpace, points_of
from vibrolock.arrays import Complex, Float

_FLAT = 1e-11
"""Relative singular value below which a direction is flat: a similarity transform, or lost in rounding."""
_CONVERGED = 1e-9
"""The iteration has converged if the relative reduction of the cost is below this twice in a row."""
_LEAST, _MOST = 1e-10, 1e6
"""Range of the Levenberg-Marquardt damping, relative to the largest singular value."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StateSpaceFit:
    """A state-space model fitted to frequency responses.

    Parameters
    ----------
    model
        A, B, C and D; stable.
    cost
        float[n_iterations + 1], mean weighted squared residual at the start and after each iteration. With relative weights
        it is a mean squared relative error; with a known covariance it is about one if only noise is left.
    residual
        RMS of the residual over its expected value from the covariance; NaN if no covariance is known.
    error
        float[n_outputs, n_inputs], RMS residual over RMS response of every path, unweighted.
    weighting
        Kind of covariance that weighted the lines: ``total``, ``noise`` or ``relative``.
    converged
        Whether the iteration converged.
    """

    model: StateSpace
    cost: Float
    residual: float
    error: Float
    weighting: str
    converged: bool


def fit_state_space(
    responses: FrequencyResponseMatrix,
    start: StateSpace,
    *,
    sample_rate_hz: float,
    weighting: Weighting = "auto",
    iterations: int = 100,
) -> StateSpaceFit:
    """Fit a state-space model to frequency responses, starting from ``start`` and keeping its order.

    Raises `IdentificationError` if the matrices of ``start`` do not match the responses, ``start`` is unstable, lines
    are at or above half the sample rate, or there are fewer values than free parameters.

    Parameters
    ----------
    responses, sample_rate_hz, weighting
        As for `subspace`.
    start
        Stable initial model, for instance from `subspace`.
    iterations
        Largest number of iterations.
    """
    data = weighted_responses(responses, weighting)
    z = points_of(responses, sample_rate_hz)
    _check(data, start)
    whitening = data.whitening
    n = start.a.shape[0]
    scale = 1.0 / np.sqrt(data.value.size)
    model, damping, calm = start, 1e-3, 0
    misfit = scale * _whitened(whitening, model.response(z) - data.value)
    costs = [float(misfit @ misfit)]
    for _ in range(iterations):
        jacobian = scale * _whitened(whitening, response_jacobian(model, z))
        size = np.linalg.norm(jacobian, axis=0)
        size[size == 0.0] = 1.0
        left, singular, right = np.linalg.svd(jacobian / size, full_matrices=False)
        kept = singular > _FLAT * singular[0]
        gradient = left[:, kept].T @ misfit
        strong = singular[kept]
        while damping < _MOST:
            move = right[kept].T @ (gradient * strong / (strong**2 + (damping * strong[0]) ** 2))
            parts = np.split(-move / size, np.cumsum([part.size for part in model])[:-1])
            trial = StateSpace(*(p + s.reshape(p.shape) for p, s in zip(model, parts, strict=True)))
            if spectral_radius(trial.a) < 1.0:
                new = scale * _whitened(whitening, trial.response(z) - data.value)
                if (cost := float(new @ new)) <= costs[-1]:
                    break
            damping *= 4.0
        else:
            calm = 2
            break
        calm = calm + 1 if costs[-1] - cost <= _CONVERGED * costs[-1] else 0
        model, misfit, damping = trial, new, max(0.2 * damping, _LEAST)
        costs.append(cost)
        if calm > 1 or cost <= 1e-30:
            break
    free = sum(part.size for part in model) - n * n
    return StateSpaceFit(
        model=model,
        cost=np.array(costs),
        residual=_residual(data, costs[-1], free),
        error=np.sqrt(np.mean(np.abs(model.response(z) - data.value) ** 2, axis=0))
        / np.sqrt(np.mean(np.abs(data.value) ** 2, axis=0)),
        weighting=data.kind,
        converged=calm > 1 or costs[-1] <= 1e-30,
    )


def response_jacobian(model: StateSpace, z: Complex) -> Complex:
    """complex[n_points, n_outputs, n_inputs, p]: derivatives of the response with respect to A, B, C, D, each row by row."""
    n, inputs, outputs = model.a.shape[0], model.b.shape[1], model.c.shape[0]
    inverse = np.linalg.inv(z[:, None, None] * np.eye(n) - model.a)
    left, right = model.c @ inverse, inverse @ model.b
    row, column = np.eye(outputs), np.eye(inputs)
    shape = (z.size, outputs, inputs)
    parts = (
        np.einsum("koi,kjm->komij", left, right),
        np.einsum("koi,jm->komij", left, column),
        np.einsum("oi,kjm->komij", row, right),
        np.broadcast_to(np.einsum("oi,jm->omij", row, column), (*shape, outputs, inputs)),
    )
    return np.concatenate([part.reshape(*shape, -1) for part in parts], axis=-1)


def spectral_radius(a: Float) -> float:
    """Largest magnitude of an eigenvalue; 0 without states."""
    return float(np.max(np.abs(np.linalg.eigvals(a)), initial=0.0))


def _check(data: WeightedResponses, start: StateSpace) -> None:
    lines, outputs, inputs = data.value.shape
    n = start.a.shape[0]
    shapes = ((n, n), (n, inputs), (outputs, n), (outputs, inputs))
    for name, part, shape in zip("abcd", start, shapes, strict=True):
        if part.shape != shape:
            raise IdentificationError(f"{name} has shape {part.shape}", field="start", allowed=f"{shape}")
    if (radius := spectral_radius(start.a)) >= 1.0:
        raise IdentificationError(
            f"has an eigenvalue of magnitude {radius:.6g}", field="start", allowed="below 1 (stable)"
        )
    free = n * (outputs + inputs) + outputs * inputs
    if 2 * lines * outputs * inputs < free:
        reason = f"{lines} lines are too few for the {free} free parameters of {n} states"
        allowed = f"at least {-(-free // (2 * outputs * inputs))}"
        raise IdentificationError(reason, field="frequency_hz", allowed=allowed, hint="lower the order")


def _whitened(whitening: Complex, values: Complex) -> Float:
    """Return real, then imaginary parts of W times all paths, stacked along one axis; further axes follow."""
    lines, paths = whitening.shape[:2]
    product = whitening @ values.reshape(lines, paths, -1)
    stacked = np.concatenate([product.real, product.imag]).reshape(2 * lines * paths, -1)
    return stacked[:, 0] if values.ndim == 3 else stacked


def _residual(data: WeightedResponses, cost: float, free: int) -> float:
    if data.covariance is None:
        return float("nan")
    whitening = data.whitening
    expected = np.einsum("kij,kjl,kil->", whitening, data.covariance, np.conj(whitening)).real
    freedom = max(1.0 - 0.5 * free / data.value.size, 1e-3)
    return float(np.sqrt(cost * data.value.size / (expected * freedom)))
