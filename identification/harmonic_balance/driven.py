"""Harmonic balance of a driven model of any kind: the model along a period, completed by the equations of its drive."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from identification.channels import find_role
from identification.continuation.path import System
from identification.errors import IdentificationError
from identification.experiments.simulators import Driven
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.drives import Drive
from vibrolock.arrays import Complex, Float


class Period(NamedTuple):
    """A model along a period: Fourier coefficients, and derivatives with respect to those of states and inputs (x, u)."""

    outputs: Float
    """float[size, n_outputs]."""
    residual: Float
    """float[size, n_states], what is left of the model's equations."""
    outputs_by: Float
    """float[size, n_outputs, size, n_states + n_inputs]."""
    residual_by: Float
    """float[size, n_states, size, n_states + n_inputs]."""
    outputs_by_frequency: Float
    """float[size, n_outputs], per Hz."""
    residual_by_frequency: Float
    """float[size, n_states], per Hz."""


class DrivenBalance(ABC):
    """Equations of a driven model; unknowns are the coefficients of the states, float[size, n_states], then the drive's.

    ``held`` (float[n_inputs]) are constant parts of the inputs, independent of the level.
    """

    beyond: str
    """Message of a path that ends because states are beyond ``{:g}`` times their range."""
    kinks = False
    """Whether the residual has kinks, as with dry friction."""
    order: int
    """Number of multipliers."""
    ranges: int
    """Number of quantities that have a range."""

    def __init__(self, model: Driven, states: int, drive: Drive, basis: Basis, held: Float | None = None) -> None:
        self.inputs, self.outputs = model.inputs, model.outputs
        self.n_states, self.drive, self.basis = states, drive, basis
        self._held = np.zeros((basis.size, len(model.inputs)))
        if held is not None:
            self._held[0] = held
        self._given, self._by_own = drive.inputs(basis.size)

    @abstractmethod
    def along(self, states: Float, inputs: Float, frequency_hz: float) -> Period:
        """Evaluate the model; coefficients are float[size, n_states] and float[size, n_inputs]."""

    @abstractmethod
    def linear_response(self, frequency_hz: float, row: int) -> tuple[Complex, Complex]:
        """Return complex[n_states] and complex[n_outputs] per unit of the input ``row``, for small vibrations."""

    @abstractmethod
    def static(self, inputs: Float) -> Float:
        """float[n_states]: states under small constant inputs."""

    @abstractmethod
    def multipliers(self, states: Float, inputs: Float, at: Period, frequency_hz: float) -> Complex:
        """complex[order]: multipliers of a disturbance while the phase advances by `angle`, with unchanged inputs.

        ``at`` is what `along` returns there.
        """

    @abstractmethod
    def angle(self, frequency_hz: float) -> float:
        """Phase advance to which `multipliers` belong, rad."""

    @abstractmethod
    def state_use(self, z: Float, to_time: Float) -> Float:
        """float[ranges]: largest magnitudes over their ranges, with the transform to time float[n, size]; NaN where unknown."""

    @abstractmethod
    def input_use(self, inputs: Float, to_time: Float) -> Float:
        """float[n_inputs]: the same of the inputs with coefficients float[size, n_inputs]."""

    @property
    def state_unknowns(self) -> int:
        """Number of unknowns that belong to the states."""
        return self.basis.size * self.n_states

    def states(self, z: Float) -> Float:
        """float[size, n_states]: coefficients of the states."""
        return np.asarray(z[: self.state_unknowns].reshape(self.basis.size, -1))

    def own(self, z: Float) -> Float:
        """Return the unknowns of the drive."""
        return np.asarray(z[self.state_unknowns :])

    def inputs_of(self, z: Float, level: float = 1.0) -> Float:
        """float[size, n_inputs]: coefficients of the inputs."""
        return np.asarray(self._held + level * self._given + self._by_own @ self.own(z))

    def evaluated(self, z: Float, frequency_hz: float, level: float = 1.0) -> tuple[Float, Float, Float, Float]:
        """Return the residual and its derivatives with respect to the unknowns, frequency (per Hz) and level."""
        n, count, own = self.n_states, self.state_unknowns, self.own(z)
        at = self.along(self.states(z), self.inputs_of(z, level), frequency_hz)
        drive = self.drive.equations(own, level, frequency_hz, at.outputs)
        given, by_own = self._given.ravel(), self._by_own.reshape(self._given.size, own.size)
        by_inputs = at.residual_by[..., n:].reshape(count, -1)

        jacobian = np.empty((z.size, z.size))
        jacobian[:count, :count] = at.residual_by[..., :n].reshape(count, count)
        jacobian[:count, count:] = by_inputs @ by_own
        by_frequency = np.concatenate([at.residual_by_frequency.ravel(), drive.by_frequency])
        by_level = np.concatenate([by_inputs @ given, drive.by_level])
        if own.size:
            of_outputs = drive.by_outputs.reshape(own.size, -1)
            rows = at.outputs.size
            jacobian[count:, :count] = of_outputs @ at.outputs_by[..., :n].reshape(rows, count)
            through = of_outputs @ at.outputs_by[..., n:].reshape(rows, -1)
            jacobian[count:, count:] = drive.by_own + through @ by_own
            by_frequency[count:] += of_outputs @ at.outputs_by_frequency.ravel()
            by_level[count:] += through @ given
        return np.concatenate([at.residual.ravel(), drive.residual]), jacobian, by_frequency, by_level

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
        """Return the unknowns of small vibrations, scaled to a level."""
        used = np.any(self._given != 0.0, axis=0) | np.any(self._by_own != 0.0, axis=(0, 2))
        row = int(np.argmax(used))
        gain, response = self.linear_response(frequency_hz, row)
        own = self.drive.linear(frequency_hz, response, self.basis.harmonics)
        inputs = self._given + self._by_own @ own
        amplitude = complex(inputs[1, row], -inputs[2, row])
        states = np.zeros((self.basis.size, self.n_states))
        states[1], states[2] = level * (gain * amplitude).real, -level * (gain * amplitude).imag
        if np.any(self._held):
            states[0] = self.static(self._held[0])
        return np.concatenate([states.ravel(), level * own])

    def in_phase(self, z: Float, frequency_hz: float, level: float) -> tuple[float, Float, float, float]:
        """Return the displacement of the drive point in phase with the force, which vanishes at phase resonance.

        Up to a factor, with its derivatives with respect to unknowns, frequency (per Hz) and level. Raises
        `IdentificationError` if the force is not an input, whose phase is then not the reference.
        """
        if not any(channel.role == "force" for channel in self.inputs):
            raise IdentificationError("model: is driven by a voltage; phase resonance needs a model of a force")
        n, drive = self.n_states, find_role(self.outputs, "drive")
        row = 2 if self.outputs[drive].motion == "velocity" else 1
        at = self.along(self.states(z), self.inputs_of(z, level), frequency_hz)
        by_states, by_inputs = at.outputs_by[row, drive, :, :n], at.outputs_by[row, drive, :, n:]
        by_own = np.tensordot(by_inputs, self._by_own, axes=2)
        by_z = np.concatenate([by_states.ravel(), by_own])
        by_level = float(np.sum(by_inputs * self._given))
        return float(at.outputs[row, drive]), by_z, float(at.outputs_by_frequency[row, drive]), by_level
