"""Harmonic balance of a discrete map: ``R(W) X = T^+ f(T X, T U)`` with ``f(x, u) = A x + B u + E phi(x, u)``.

A periodic vibration, sampled at any rate (also with a fractional number of samples per period), is ``x(k) = X(theta_k)`` with
``theta_k = k W T_s``. From one sample to the next the phase advances by ``W T_s``, and R rotates harmonic h by h times that.
Alternating frequency and time (Cameron and Griffin, J. Appl. Mech. 56, 1989): T transforms Fourier coefficients to samples
over the phase, T^+ transforms them back. The Jacobian is ``R (x) I - T^+ diag(df/dx) T``.
"""

import numpy as np

from identification.experiments.simulation import use_of
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.driven import DrivenBalance, Period
from identification.harmonic_balance.drives import Drive
from identification.harmonic_balance.stability import multipliers
from identification.models.pnlss.kernels import Matrices, Table, feature_derivatives, feature_values, linear_sum
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Complex, Float
from vibrolock.compiled import inner_kernel, kernel

_ENOUGH_FOR_BENDS = 16
"""Samples per harmonic for features that are not polynomials; aliasing is then of the order of the neglected harmonics."""


def samples_for(model: PnlssModel, harmonics: int) -> int:
    """Number of samples per period without aliasing into the retained harmonics: above ``(degree + 1) H`` for polynomials."""
    both = (model.state_features, model.output_features)
    degree = max(int(features.exponents.sum(axis=1).max(initial=1)) for features in both)
    least = (degree + 1) * harmonics + 1
    if any(len(features.weights) or np.any(np.isfinite(features.limits)) for features in both):
        least = max(least, _ENOUGH_FOR_BENDS * harmonics)
    return max(least + least % 2, 4 * harmonics + 4)


class PnlssBalance(DrivenBalance):
    """Equations of a driven PNLSS model."""

    beyond = "the states are beyond {:g} times those of the training data"

    def __init__(self, model: PnlssModel, drive: Drive, basis: Basis, held: Float | None = None) -> None:
        super().__init__(model, model.states, drive, basis, held)
        self.model, self.order, self.ranges = model, model.states, model.states
        self._matrices = model.matrices
        self._tables = (model.state_features.table, model.output_features.table)
        n, m, outputs = model.states, len(model.inputs), len(model.outputs)
        features = max(model.e.shape[1], model.f.shape[1])
        bends = max(len(model.state_features.weights), len(model.output_features.weights))
        self._work = (np.empty(features), np.empty((features, n + m)), np.empty((bends, 2)))
        self._samples = tuple(
            np.empty((basis.samples, *shape)) for shape in ((n,), (outputs,), (n, n + m), (outputs, n + m))
        )

    def angle(self, frequency_hz: float) -> float:
        """Phase advance per sample, rad."""
        return 2.0 * np.pi * frequency_hz / self.model.sample_rate_hz

    def along(self, states: Float, inputs: Float, frequency_hz: float) -> Period:
        """Evaluate the model: the residual is ``R X - T^+ f(T X, T U)``."""
        turn, turned = self.basis.turned(self.angle(frequency_hz))
        x, y, x_slope, y_slope = self._evaluated(states, inputs)
        back, n = self.basis.to_coefficients, self.n_states
        residual_by = -self._derivative(x_slope)
        for i in range(n):
            residual_by[:, i, :, i] += turn
        return Period(
            outputs=back @ y,
            residual=turn @ states - back @ x,
            outputs_by=self._derivative(y_slope),
            residual_by=residual_by,
            outputs_by_frequency=np.zeros((self.basis.size, y.shape[1])),
            residual_by_frequency=self.angle(1.0) * (turned @ states),
        )

    def _evaluated(self, states: Float, inputs: Float) -> tuple[Float, ...]:
        v = self.basis.to_time @ np.concatenate([states, inputs], axis=1)
        along_period(self._matrices, *self._tables, v, *self._work, *self._samples)
        return self._samples

    def _derivative(self, slope: Float) -> Float:
        """``T^+ diag(slope) T``, float[size, k, size, n_variables], of float[samples, k, n_variables]."""
        size = self.basis.size
        flat = self.basis.products @ slope.reshape(self.basis.samples, -1)
        return np.asarray(flat.reshape(size, size, *slope.shape[1:]).swapaxes(1, 2))

    def linear_response(self, frequency_hz: float, row: int) -> tuple[Complex, Complex]:
        """Return states and outputs of the linear part."""
        model, point = self.model, np.exp(1j * self.angle(frequency_hz))
        gain = np.linalg.solve(point * np.eye(model.states) - model.a, model.b[:, row])
        return gain, model.linear_part.response(np.array([point]))[0][:, row]

    def static(self, inputs: Float) -> Float:
        """Return the fixed point of the linear part."""
        model = self.model
        return np.asarray(np.linalg.lstsq(np.eye(model.states) - model.a, model.b @ inputs)[0])

    def multipliers(self, states: Float, inputs: Float, at: Period, frequency_hz: float) -> Complex:
        """complex[n_states]: multipliers over one sample."""
        angle = self.angle(frequency_hz)
        slope = self._evaluated(states, inputs)[2]
        states_by = self._derivative(slope[..., : self.n_states])
        return multipliers(states_by, self.basis.turned(angle)[0], self.basis, angle)

    def state_use(self, z: Float, to_time: Float) -> Float:
        """float[n_states]: largest magnitude of each state over the largest in the training data."""
        return use_of(np.max(np.abs(to_time @ self.states(z)), axis=0), self.model.state_range)

    def input_use(self, inputs: Float, to_time: Float) -> Float:
        """float[n_inputs]: largest magnitude of each input over the largest in the training data."""
        return use_of(np.max(np.abs(to_time @ inputs), axis=0), self.model.input_range)


@inner_kernel
def linear_slopes(a: np.ndarray, b: np.ndarray, e: np.ndarray, slope: np.ndarray, out: np.ndarray) -> None:
    """Write the derivatives of `linear_sum` by v, given those of the features, float[n_features, n_variables]."""
    n = a.shape[1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            total = a[i, j] if j < n else b[i, j - n]
            for feature in range(slope.shape[0]):
                total += e[i, feature] * slope[feature, j]
            out[i, j] = total


@kernel
def along_period(
    m: Matrices,
    state_table: Table,
    output_table: Table,
    v: np.ndarray,
    features: np.ndarray,
    slope: np.ndarray,
    steep: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    x_slope: np.ndarray,
    y_slope: np.ndarray,
) -> None:
    """Evaluate the model at ``v`` (float[n, n_variables]): next states ``x`` (float[n, n_states]), outputs ``y``, derivatives.

    ``x_slope`` (float[n, n_states, n_variables]) and ``y_slope`` (float[n, n_outputs, n_variables]) are derivatives with
    respect to v. ``features``, ``slope`` (float[n_features, n_variables]) and ``steep`` are work arrays, sized for the longer
    table.
    """
    phi, chi = m.e.shape[1], m.f.shape[1]
    for k in range(v.shape[0]):
        feature_values(state_table, v[k], features[:phi])
        linear_sum(m.a, m.b, m.e, features[:phi], v[k], x[k])
        feature_derivatives(state_table, v[k], slope[:phi], steep)
        linear_slopes(m.a, m.b, m.e, slope[:phi], x_slope[k])
        feature_values(output_table, v[k], features[:chi])
        linear_sum(m.c, m.d, m.f, features[:chi], v[k], y[k])
        feature_derivatives(output_table, v[k], slope[:chi], steep)
        linear_slopes(m.c, m.d, m.f, slope[:chi], y_slope[k])
