"""What drives a model periodically: a sine, or a voltage that holds the force among its outputs; see `coupled` for exciters.

Each knows the inputs' Fourier coefficients as linear functions of unknowns of its own and of the level (1 is what was asked
for), and the equations that these unknowns obey. The coefficients are real, ordered as in `identification.pnlss.steady.basis`.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drive", "Equations", "HeldOutput", "Sine", "level_reached", "peak_of_level"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]


class Equations(NamedTuple):
    """Equations of a drive's own unknowns e: residual, and derivatives by e, outputs, frequency (Hz) and level."""

    residual: Float
    by_own: Float
    by_outputs: Float
    """float[size, n_coefficients, n_outputs]."""
    by_frequency: Float
    by_level: Float


class Drive(Protocol):
    """What drives a model."""

    @property
    def size(self) -> int:
        """Number of unknowns of its own."""

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """Inputs' coefficients per unit of level, float[n_coefficients, m], and by e, float[n_coefficients, m, size]."""

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """The equations at unknowns ``own`` and outputs' coefficients float[n_coefficients, n_outputs]."""

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """Unknowns at level 1 for a linear model with ``response`` complex[n_outputs] to a unit of the driven input."""

    def voltage(self, own: Float) -> complex:
        """Amplitude of the voltage; NaN where there is none."""


@dataclass(frozen=True)
class Sine:
    """A sine of fixed amplitude at one input: force, or constant voltage."""

    amplitude: float
    row: int
    n_inputs: int
    is_voltage: bool = False

    @property
    def size(self) -> int:
        """No unknowns."""
        return 0

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """The sine."""
        given = np.zeros((coefficients, self.n_inputs))
        given[1, self.row] = self.amplitude
        return given, np.zeros((coefficients, self.n_inputs, 0))

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """None."""
        return Equations(np.zeros(0), np.zeros((0, 0)), np.zeros((0, *outputs.shape)), np.zeros(0), np.zeros(0))

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """No unknowns."""
        return np.zeros(0)

    def voltage(self, own: Float) -> complex:
        """The amplitude, if it is a voltage."""
        return complex(self.amplitude) if self.is_voltage else complex(np.nan)


@dataclass(frozen=True)
class HeldOutput:
    """A sine of voltage whose amplitude, the one unknown, holds the force at one output: its fundamental or its RMS."""

    force_n: float
    held: Literal["fundamental", "rms"]
    output: int
    row: int
    n_inputs: int

    @property
    def size(self) -> int:
        """The amplitude."""
        return 1

    def inputs(self, coefficients: int) -> tuple[Float, Float]:
        """The sine by its amplitude."""
        slope = np.zeros((coefficients, self.n_inputs, 1))
        slope[1, self.row, 0] = 1.0
        return np.zeros((coefficients, self.n_inputs)), slope

    def equations(self, own: Float, level: float, frequency_hz: float, outputs: Float) -> Equations:
        """``|F_1|^2 = (level F)^2``, or the mean square."""
        residual, slope = level_reached(outputs[:, self.output], self.held, self.force_n, level)
        by_outputs = np.zeros((1, *outputs.shape))
        by_outputs[0, :, self.output] = slope
        return Equations(np.array([residual]), np.zeros((1, 1)), by_outputs, np.zeros(1), np.array([-2.0 * level]))

    def linear(self, frequency_hz: float, response: Complex, harmonics: int) -> Float:
        """Force over force per volt."""
        return np.array([peak_of_level(self.force_n, self.held) / np.abs(response[self.output])])

    def voltage(self, own: Float) -> complex:
        """The unknown."""
        return complex(own[0])


def peak_of_level(force_n: float, held: str) -> float:
    """Peak of a sine that has the level."""
    return force_n * (np.sqrt(2.0) if held == "rms" else 1.0)


def level_reached(force: Float, held: str, force_n: float, level: float) -> tuple[float, Float]:
    """``|F_1|^2``, or the mean square of a force's harmonics, over that asked for, minus level^2; by its coefficients."""
    weight = np.zeros(force.size)
    if held == "rms":
        weight[1:] = 0.5 / force_n**2
    else:
        weight[1:3] = 1.0 / force_n**2
    return float(weight @ force**2) - level**2, 2.0 * weight * force
