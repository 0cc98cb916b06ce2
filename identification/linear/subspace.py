"""Frequency-domain subspace identification of a discrete-time state-space model from frequency responses.

With ``z_k`` on the unit circle, ``H(z) = C (z - A)^-1 B + D`` and ``w(z) = (1, z, ..., z^(r-1))``,

    w(z_k) (x) H_k = O X_k + Gamma (w(z_k) (x) I),   O = (C; C A; ...; C A^(r-1)),

Projecting the second term out leaves a matrix whose columns span the extended observability matrix O (McKelvey, Akcay and
Ljung, IEEE TAC 41, 1996; with noise weighting Pintelon and Schoukens, 2nd ed., section 9.7 and Pintelon, Automatica 38,
2002). Lines may lie anywhere on the circle, equally spaced or not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from identification.linear.accelerance import WeightedResponses, Weighting, weighted_responses
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.validation import positive
from vibrolock.arrays import Complex, Float

_TELLING = 1e-7
"""A block row must have at least this part independent of the rows before it, relative to the first row."""
_FLOOR = 1e-13
"""Least variance of a combination of block rows, relative to that of the rows; rounding errors of the sums stay below it."""
_MANY = 5000
"""Points from which on a response is computed by the triangle of A: where that is quicker than equations for each point."""


class StateSpace(NamedTuple):
    """Discrete-time model ``x(k+1) = A x(k) + B u(k)``, ``y(k) = C x(k) + D u(k)``."""

    a: Float
    b: Float
    c: Float
    d: Float

    def response(self, z: Complex) -> Complex:
        """complex[n, n_outputs, n_inputs]: frequency response ``C (z - A)^-1 B + D`` at points z."""
        if z.size > _MANY:
            return self._response_at_many(z)
        left = z[:, None, None] * np.eye(self.a.shape[0]) - self.a
        return np.asarray(self.c @ np.linalg.solve(left, np.broadcast_to(self.b, (z.size, *self.b.shape))) + self.d)

    def _response_at_many(self, z: Complex) -> Complex:
        """The same by back substitution in the triangle of A (Schur), for all points at once."""
        from scipy.linalg import schur  # where there are so many alone

        triangle, basis = schur(self.a, output="complex")
        n, inputs = self.b.shape
        driven, c = basis.conj().T @ self.b, self.c @ basis
        states = np.empty((n, inputs, z.size), np.complex128)
        for row in range(n)[::-1]:
            later = triangle[row, row + 1 :] @ states[row + 1 :].reshape(n - row - 1, inputs * z.size)
            states[row] = (driven[row][:, None] + later.reshape(inputs, -1)) / (z - triangle[row, row])
        out = (c @ states.reshape(n, inputs * z.size)).reshape(-1, inputs, z.size)
        return np.asarray(np.moveaxis(out, 2, 0) + self.d)


@dataclass(frozen=True, eq=False)
class ObservableSpace:
    """Estimate of the extended observability matrix, most prominent direction first."""

    basis: Float
    """float[r n_outputs, n], columns in the order of ``singular_values``."""
    singular_values: Float
    """float[n]; with noise weighting the singular values of noise lie at about one level, those of the system above
    it."""
    n_outputs: int
    """Number of rows of a block."""

    def state_matrices(self, order: int) -> tuple[Float, Float]:
        """Return A and C of a model of the given order, by shifting the observability matrix by one block."""
        observability = self.basis[:, :order]
        shifted = np.linalg.lstsq(observability[: -self.n_outputs], observability[self.n_outputs :], rcond=None)[0]
        return np.asarray(shifted), np.asarray(observability[: self.n_outputs])


def observable_space(data: WeightedResponses, z: Complex, block_rows: int) -> ObservableSpace:
    """Estimate the extended observability matrix of ``block_rows`` blocks from responses at points ``z`` of the unit circle.

    Raises `IdentificationError` if there are fewer values than unknowns.
    """
    lines, outputs, inputs = data.value.shape
    if 2 * lines * inputs < block_rows * (outputs + inputs):
        reason = f"{lines} lines are too few for {block_rows} block rows of {outputs} outputs and {inputs} inputs"
        allowed = f"at least {-(-block_rows * (outputs + inputs) // (2 * inputs))}"
        raise IdentificationError(reason, field="frequency_hz", allowed=allowed, hint="lower the order")
    # One weight per line keeps the equations exact; lines with small errors have more weight.
    weight = 1.0 / np.sqrt(np.mean(data.std**2, axis=(1, 2)))
    powers = z[:, None] ** np.arange(block_rows) * (weight / np.linalg.norm(weight))[:, None]
    response = np.einsum("kr,koi->roki", powers, data.value).reshape(block_rows * outputs, -1)
    excitation = np.einsum("kr,ji->rjki", powers, np.eye(inputs)).reshape(block_rows * inputs, -1)
    stacked = np.vstack([excitation, response])
    triangle = np.asarray(np.linalg.qr(np.hstack([stacked.real, stacked.imag]).T, mode="r")).T
    left = block_rows * inputs
    remainder = triangle[left:, left:]
    if data.covariance is None:
        colour = np.eye(block_rows * outputs)
    else:
        tensor = data.smooth.reshape(lines, outputs, inputs, outputs, inputs)
        one = np.einsum("koipi->kop", tensor)
        # On the unit circle the product of two powers is the power of their difference.
        lags = (powers.T @ (np.conj(powers[:, :1]) * one.reshape(lines, -1))).real.reshape(-1, outputs, outputs)
        number = np.arange(block_rows)
        apart = np.abs(number[:, None] - number)
        blocks = np.where((number[:, None] >= number)[:, :, None, None], lags[apart], lags[apart].swapaxes(2, 3))
        colour = _root(blocks.swapaxes(1, 2).reshape(remainder.shape))
    vectors, values, _ = np.linalg.svd(np.linalg.solve(colour, remainder))
    return ObservableSpace(np.asarray(colour @ vectors), values, outputs)


def telling_rows(z: Complex, most: int) -> int:
    """Number of block rows, at most ``most``, that are independent at points ``z``; few if a narrow band is a short arc."""
    powers = z[:, None] ** np.arange(most)
    triangle = np.linalg.qr(np.vstack([powers.real, powers.imag]), mode="r")
    own = np.abs(np.diag(triangle))
    return int(np.argmin(np.append(own > _TELLING * own[0], False)))


def _root(covariance: Float) -> Float:
    """Return the lower triangle L with ``L L^T`` equal to the covariance, floored.

    Over a short arc of the circle (a narrow band) the powers of z are nearly dependent, and so is their noise.
    """
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(size, size)
    floored = correlation + _FLOOR * np.eye(size.size)
    return np.asarray(size[:, None] * np.linalg.cholesky(floored))


def points_of(responses: FrequencyResponseMatrix, sample_rate_hz: float) -> Complex:
    """complex[n_lines]: ``exp(2 pi i f / sample_rate_hz)``; raises `IdentificationError` for responses without such points."""
    if responses.decay_rate_1_s:
        hint = "`linear_modes` takes such responses"
        raise IdentificationError(field="decay_rate_1_s", value=responses.decay_rate_1_s, allowed="0", hint=hint)
    if responses.frequency_hz[-1] >= 0.5 * positive("sample_rate_hz", sample_rate_hz, "Hz"):
        allowed = f"more than twice {responses.frequency_hz[-1]:g} Hz"
        raise IdentificationError(field="sample_rate_hz", value=sample_rate_hz, allowed=allowed)
    return np.asarray(np.exp(2j * np.pi * responses.frequency_hz / sample_rate_hz))


def subspace(
    responses: FrequencyResponseMatrix,
    order: int,
    *,
    sample_rate_hz: float,
    block_rows: int | None = None,
    weighting: Weighting = "auto",
) -> StateSpace:
    """Identify a discrete-time state-space model of given order from frequency responses, weighted by their covariance.

    Raises `IdentificationError` if the order is below one, there are too few block rows or lines, or lines are at or
    above half the sample rate.

    Parameters
    ----------
    responses
        Responses of one or several inputs and outputs, at lines below half the sample rate.
    order
        Number of states.
    sample_rate_hz
        Sample rate of the model, ``z = exp(2 pi i f / sample_rate_hz)``.
    block_rows
        Number r of block rows of the observability matrix; ``order + 2`` if None.
    weighting
        Covariance that weights the lines: ``total``, ``noise``, ``relative`` (none), or the first of these that is known
        (``auto``).
    """
    IdentificationError.unless_at_least("order", order, 1)
    z = points_of(responses, sample_rate_hz)
    rows = order + 2 if block_rows is None else block_rows
    if (rows - 1) * len(responses.outputs) < order:
        reason = f"too few for order {order} of {len(responses.outputs)} outputs"
        raise IdentificationError(reason, field="block_rows", value=rows)
    data = weighted_responses(responses, weighting)
    a, c = observable_space(data, z, rows).state_matrices(order)
    return _with_inputs(data, z, a, c)


def _with_inputs(data: WeightedResponses, z: Complex, a: Float, c: Float) -> StateSpace:
    """Return the model with B and D by least squares, given A and C; its weights are the inverse standard deviations."""
    order, outputs, inputs = a.shape[0], c.shape[0], data.value.shape[2]
    left = np.swapaxes(z[:, None, None] * np.eye(order) - a, 1, 2)
    rows = np.swapaxes(np.linalg.solve(left, np.broadcast_to(c.T, (z.size, order, outputs))), 1, 2)
    design = np.concatenate([rows, np.broadcast_to(np.eye(outputs), (z.size, outputs, outputs))], axis=2)
    columns = []
    for i in range(inputs):
        weight = 1.0 / data.std[:, :, i] if data.covariance is not None else np.ones((z.size, outputs))
        scaled = (design * weight[:, :, None]).reshape(-1, order + outputs)
        value = (data.value[:, :, i] * weight).ravel()
        real = np.vstack([scaled.real, scaled.imag])
        size = np.linalg.norm(real, axis=0)
        solution = np.linalg.lstsq(real / size, np.concatenate([value.real, value.imag]), rcond=None)[0]
        columns.append(solution / size)
    both = np.array(columns).T
    return StateSpace(a, both[:order], c, both[order:])
