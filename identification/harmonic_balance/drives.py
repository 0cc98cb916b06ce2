"""Periodic excitations of a model: a sine, a voltage that holds a force among the outputs, or an exciter.

Each drive provides the Fourier coefficients of the inputs as linear functions of its own unknowns and of the level (1 is the
requested level), and the equations of these unknowns. The coefficients are real, ordered as in
`identification.harmonic_balance.basis`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.basis import complex_product
from vibrolock.arrays import Complex, Float

_NUDGE = 1e-5
"""Relative step of the exciter's numerical derivatives with respect to frequency, which are accurate to ten digits. Chosen."""


class Equations(NamedTuple):
    """Equations of a drive's own unknowns e: residual, and derivatives with respect to e, outputs, frequency (Hz) and level."""

    residual: Float
    by_own: Float
    by_outputs: Float
    """float[size, n_coefficients, n_outputs]."""
    by_frequency: Float
    by_level: Float


class Drive(ABC):
    """A periodic excitation of a model."""

    @property
    def size(self) -> int:
        """Number of the drive's own unknowns."""
        return 0

    @abstractmethod
    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """Return the inputs' coefficients per unit of level and per unit of each unknown.

        Their shapes are float[n_coefficients, m] and float[n_coefficients, m, size].
        """

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """Evaluate the equations at unknowns ``own`` and output coefficients float[n_coefficients, n_outputs]."""
        return Equations(np.zeros(0), np.zeros((0, 0)), np.zeros((0, *outputs.shape)), np.zeros(0), np.zeros(0))

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """Return the unknowns at level 1 for a linear model; ``response`` complex[n_outputs] is per unit of driven input."""
        return np.zeros(0)

    @abstractmethod
    def voltage(self, own: Float) -> complex:
        """Amplitude of the voltage; NaN if there is none."""


@dataclass(frozen=True)
class Sine(Drive):
    """A sine of fixed amplitude at one input, a force or a constant voltage; it has no unknowns."""

    amplitude: float
    row: int
    n_inputs: int
    is_voltage: bool = False

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """Return the coefficients of the sine."""
        given = np.zeros((coefficients, self.n_inputs))
        given[1, self.row] = self.amplitude
        return given, np.zeros((coefficients, self.n_inputs, 0))

    def voltage(self, own: Float) -> complex:
        """The amplitude, if the sine is a voltage; else NaN."""
        return complex(self.amplitude) if self.is_voltage else complex(np.nan)


@dataclass(frozen=True)
class HeldOutput(Drive):
    """A voltage sine whose amplitude, the only unknown, holds the fundamental or the RMS of the force at one output."""

    force_n: float
    held: Literal["fundamental", "rms"]
    output: int
    row: int
    n_inputs: int

    @property
    def size(self) -> int:
        """One: the amplitude."""
        return 1

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """Return the coefficients of the sine per unit of its amplitude."""
        slope = np.zeros((coefficients, self.n_inputs, 1))
        slope[1, self.row, 0] = 1.0
        return np.zeros((coefficients, self.n_inputs)), slope

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """Evaluate ``|F_1|^2 = (level F)^2``, or the same for the mean square."""
        residual, slope = level_reached(outputs[:, self.output], self.held, self.force_n, level)
        by_outputs = np.zeros((1, *outputs.shape))
        by_outputs[0, :, self.output] = slope
        return Equations(np.array([residual]), np.zeros((1, 1)), by_outputs, np.zeros(1), np.array([-2.0 * level]))

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """Return the held force divided by the force per volt."""
        return np.array([peak_of_level(self.force_n, self.held) / np.abs(response[self.output])])

    def voltage(self, own: Float) -> complex:
        """The amplitude, which is the unknown."""
        return complex(own[0])


def peak_of_level(force_n: float, held: str) -> float:
    """Peak of a sine that has the held level."""
    return force_n * (np.sqrt(2.0) if held == "rms" else 1.0)


def level_reached(force: Float, held: str, force_n: float, level: float) -> tuple[float, Float]:
    """Return ``|F_1|^2`` or the mean square of a force over the held value, minus level^2, and its gradient."""
    weight = np.zeros(force.size)
    if held == "rms":
        weight[1:] = 0.5 / force_n**2
    else:
        weight[1:3] = 1.0 / force_n**2
    return float(weight @ force**2) - level**2, 2.0 * weight * force


@dataclass(frozen=True)
class Coupled(Drive):
    """An exciter that drives the force input from a voltage sine, with the reaction of the drive-point motion.

    Unknowns are the coefficients of the force without its static part, then those of the voltage. The phase reference is the
    fundamental of the force, or the voltage if the voltage is held.
    """

    exciter: Exciter
    amplitude: float
    held: Literal["fundamental", "rms", "voltage"]
    output: int
    order: int
    """Number of times the drive-point displacement is differentiated in that output."""
    row: int
    n_inputs: int
    coefficients: int

    @property
    def size(self) -> int:
        """Number of coefficients of the force without its static part, plus two of the voltage."""
        return self.coefficients + 1

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """Return the coefficients of the inputs per unit of each unknown."""
        slope = np.zeros((coefficients, self.n_inputs, self.size))
        slope[1:, self.row, : coefficients - 1] = np.eye(coefficients - 1)
        return np.zeros((coefficients, self.n_inputs)), slope

    def _factors(self, frequency_hz: Float) -> tuple[Complex, Complex]:
        """complex[k], force per volt, and complex[k, H], force per unit of drive output at each harmonic, at float[k] Hz."""
        h = np.arange(1, self.coefficients // 2 + 1)
        at_hz = frequency_hz[:, None] * h
        per_motion = self.exciter.force(0.0, 1.0, at_hz) * (2j * np.pi * at_hz) ** (2 - self.order)
        return self.exciter.force(1.0, 0.0, frequency_hz), np.asarray(per_motion)

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """Evaluate ``F_h = g V delta_h1 + r_h Y_h`` for each harmonic, then the held level and the phase reference."""
        count = self.coefficients - 1
        by_own, by_outputs = np.zeros((self.size, self.size)), np.zeros((self.size, *outputs.shape))
        by_frequency, by_level = np.zeros(self.size), np.zeros(self.size)
        residual = np.empty(self.size)

        nudge = _NUDGE * frequency_hz
        per_volt, per_motion = self._factors(frequency_hz + nudge * np.array([0.0, 1.0, -1.0]))
        volt, motion = complex_product(per_volt), complex_product(per_motion)
        force = (motion @ outputs[1:, self.output].reshape(-1, 2, 1)).reshape(3, count)
        force[:, :2] += volt @ own[count:]
        residual[:count] = (own[:count] - force[0]) / self.amplitude
        by_own[:count, :count] = np.eye(count) / self.amplitude
        by_own[:2, count:] = -volt[0] / self.amplitude
        for h in range(count // 2):
            by_outputs[2 * h : 2 * h + 2, 2 * h + 1 : 2 * h + 3, self.output] = -motion[0, h] / self.amplitude
        by_frequency[:count] = -(force[1] - force[2]) / (2.0 * nudge * self.amplitude)
        if self.held == "voltage":
            residual[count:] = [own[count] / self.amplitude - level, own[count + 1] / self.amplitude]
            by_own[count:, count:] = np.eye(2) / self.amplitude
            by_level[count] = -1.0
        else:
            with_static = np.concatenate([[0.0], own[:count]])
            residual[count], slope = level_reached(with_static, self.held, self.amplitude, level)
            residual[count + 1] = own[1] / self.amplitude
            by_own[count, :count], by_own[count + 1, 1] = slope[1:], 1.0 / self.amplitude
            by_level[count] = -2.0 * level
        return Equations(residual, by_own, by_outputs, by_frequency, by_level)

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """Return a force without harmonics and the voltage that it needs."""
        per_volt, per_motion = self._factors(np.array([frequency_hz]))
        of_force = complex((1.0 - per_motion[0, 0] * response[self.output]) / per_volt[0])
        if self.held == "voltage":
            voltage, force = complex(self.amplitude), self.amplitude / of_force
        else:
            force = complex(peak_of_level(self.amplitude, self.held))
            voltage = of_force * force
        own = np.zeros(self.size)
        own[:2], own[-2:] = [force.real, -force.imag], [voltage.real, -voltage.imag]
        return own

    def voltage(self, own: Float) -> complex:
        """The voltage amplitude, from the last two unknowns."""
        return complex(own[-2], -own[-1])
