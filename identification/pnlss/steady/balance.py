"""Harmonic balance of a discrete map: ``R(W) X = T^+ f(T X, T U)`` with ``f(x, u) = A x + B u + E phi(x, u)``.

A periodic vibration, sampled at any rate (also with a fractional number of samples per period), is ``x(k) = X(theta_k)`` with
``theta_k = k W T_s``. From one sample to the next the phase advances by ``W T_s``, and R rotates harmonic h by h times that.
Alternating frequency and time (Cameron and Griffin, J. Appl. Mech. 56, 1989): T transforms Fourier coefficients to samples
over the phase, T^+ transforms them back. The Jacobian is ``R (x) I - T^+ diag(df/dx) T``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.continuation.path import System
from identification.pnlss.features import Features
from identification.pnlss.model import PnlssModel
from identification.pnlss.steady.basis import Basis
from identification.pnlss.steady.drives import Drive
from identification.pnlss.steady.kernels import along_period

__all__ = ["Balance", "Period", "samples_for"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_ENOUGH_FOR_BENDS = 16
"""Samples per harmonic for features that are not polynomials; aliasing is then of the order of the neglected harmonics."""


class Period(NamedTuple):
    """A model along a period: coefficients of inputs, outputs and next states, and their derivatives."""

    inputs: Float
    """float[size, n_inputs], coefficients of the inputs."""
    outputs: Float
    """float[size, n_outputs], coefficients of the outputs."""
    next_states: Float
    """float[size, n_states], coefficients of ``f``."""
    states_by: Float
    """float[size, n_states, size, n_variables], derivative of the coefficients of ``f`` with respect to those of (x, u)."""
    outputs_by: Float
    """float[size, n_outputs, size, n_variables], derivative of the outputs' coefficients with respect to those of (x, u)."""


def samples_for(model: PnlssModel, harmonics: int) -> int:
    """Number of samples per period without aliasing into the retained harmonics: above ``(degree + 1) H`` for polynomials."""
    both = (model.state_features, model.output_features)
    degree = max(int(features.exponents.sum(axis=1).max(initial=1)) for features in both)
    least = (degree + 1) * harmonics + 1
    if any(_bends(features) for features in both):
        least = max(least, _ENOUGH_FOR_BENDS * harmonics)
    return max(least + least % 2, 4 * harmonics + 4)


def _bends(features: Features) -> bool:
    return bool(len(features.weights) or np.any(np.isfinite(features.limits)))


class Balance:
    """Equations of a driven model; unknowns are the coefficients of the states, float[size, n_states], then the drive's.

    ``held`` (float[n_inputs]) are constant parts of the inputs, independent of the level.
    """

    def __init__(self, model: PnlssModel, drive: Drive, basis: Basis, held: Float | None = None) -> None:
        self.model, self.drive, self.basis = model, drive, basis
        self._held = np.zeros((basis.size, len(model.inputs)))
        if held is not None:
            self._held[0] = held
        self._matrices = model.matrices
        self._tables = (model.state_features.table, model.output_features.table)
        self._given, self._by_own = drive.inputs(basis.size)
        n, m, outputs = model.states, len(model.inputs), len(model.outputs)
        features = max(model.e.shape[1], model.f.shape[1])
        bends = max(len(model.state_features.weights), len(model.output_features.weights))
        self._room = (np.empty(features), np.empty((features, n + m)), np.empty((bends, 2)))
        self._samples = tuple(
            np.empty((basis.samples, *shape)) for shape in ((n,), (outputs,), (n, n + m), (outputs, n + m))
        )

    @property
    def state_unknowns(self) -> int:
        """Number of unknowns that belong to the states."""
        return self.basis.size * self.model.states

    def states(self, z: Float) -> Float:
        """float[size, n_states]: coefficients of the states."""
        return np.asarray(z[: self.state_unknowns].reshape(self.basis.size, -1))

    def own(self, z: Float) -> Float:
        """Return the unknowns of the drive."""
        return np.asarray(z[self.state_unknowns :])

    def period(self, z: Float, level: float = 1.0) -> Period:
        """Evaluate the model along the period that the unknowns describe."""
        size = self.basis.size
        inputs = self._held + level * self._given + self._by_own @ self.own(z)
        v = self.basis.to_time @ np.concatenate([self.states(z), inputs], axis=1)
        x, y, x_slope, y_slope = self._samples
        along_period(self._matrices, *self._tables, v, *self._room, x, y, x_slope, y_slope)

        def derivative(slope: Float) -> Float:
            flat = self.basis.products @ slope.reshape(self.basis.samples, -1)
            return np.asarray(flat.reshape(size, size, *slope.shape[1:]).swapaxes(1, 2))

        back = self.basis.to_coefficients
        return Period(inputs, back @ y, back @ x, derivative(x_slope), derivative(y_slope))

    def angle(self, frequency_hz: float) -> float:
        """Phase advance per sample, rad."""
        return 2.0 * np.pi * frequency_hz / self.model.sample_rate_hz

    def evaluated(self, z: Float, frequency_hz: float, level: float = 1.0) -> tuple[Float, Float, Float, Float]:
        """Return the residual and its derivatives with respect to the unknowns, frequency (per Hz) and level."""
        n, size, count = self.model.states, self.basis.size, self.state_unknowns
        at = self.period(z, level)
        turn, turned = self.basis.turned(self.angle(frequency_hz))
        states, own = self.states(z), self.own(z)
        drive = self.drive.equations(own, level, frequency_hz, at.outputs)

        residual = np.concatenate([(turn @ states - at.next_states).ravel(), drive.residual])
        jacobian = np.empty((z.size, z.size))
        by_states = np.einsum("pq,ij->piqj", turn, np.eye(n)) - at.states_by[..., :n]
        jacobian[:count, :count] = by_states.reshape(count, count)
        by_inputs = at.states_by[..., n:].reshape(count, -1)
        by_own = self._by_own.reshape(self._given.size, own.size)
        jacobian[:count, count:] = -by_inputs @ by_own
        by_frequency = np.concatenate([self.angle(1.0) * (turned @ states).ravel(), drive.by_frequency])
        by_level = np.concatenate([-by_inputs @ self._given.ravel(), drive.by_level])
        if own.size:
            of_outputs = drive.by_outputs.reshape(own.size, -1)
            rows = at.outputs_by.shape[1] * size
            jacobian[count:, :count] = of_outputs @ at.outputs_by[..., :n].reshape(rows, count)
            through = of_outputs @ at.outputs_by[..., n:].reshape(rows, -1)
            jacobian[count:, count:] = drive.by_own + through @ by_own
            by_level[count:] += through @ self._given.ravel()
        return residual, jacobian, by_frequency, by_level

    def over_frequency(self) -> System:
        """Return the equations with the frequency (Hz) as parameter."""
        return lambda z, frequency_hz: self.evaluated(z, frequency_hz)[:3]

    def over_level(self, frequency_hz: float) -> System:
        """Return the equations at one frequency with the level as parameter."""

        def system(z: Float, level: float) -> tuple[Float, Float, Float]:
            residual, by_z, _, by_level = self.evaluated(z, frequency_hz, level)
            return residual, by_z, by_level

        return system

    def linear(self, frequency_hz: float, level: float = 1.0) -> Float:
        """Return the unknowns of the linear part at a level."""
        model, z = self.model, np.zeros(self.state_unknowns)
        point = np.array([np.exp(1j * self.angle(frequency_hz))])
        row = self._driven_row()
        response = model.linear_part.response(point)[0][:, row]
        own = self.drive.linear(frequency_hz, response, self.basis.harmonics)
        inputs = self._given + self._by_own @ own
        amplitude = complex(inputs[1, row], -inputs[2, row])
        gain = np.linalg.solve(point[0] * np.eye(model.states) - model.a, model.b[:, row])
        states = z.reshape(self.basis.size, -1)
        states[1], states[2] = level * (gain * amplitude).real, -level * (gain * amplitude).imag
        if np.any(self._held):
            states[0] = np.linalg.lstsq(np.eye(model.states) - model.a, model.b @ self._held[0])[0]
        return np.concatenate([z, level * own])

    def _driven_row(self) -> int:
        used = np.any(self._given != 0.0, axis=0) | np.any(self._by_own != 0.0, axis=(0, 2))
        return int(np.argmax(used))
