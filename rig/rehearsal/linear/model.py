"""Linear rig near one mode in physical parameters: shaker, stinger, and a structure of a few modes.

The structure has the mode under test, modes beside it where the responses show them, and one mode far below and one far above
that stand for all others. Shaker, amplifier and stinger are those of `identification.Exciter`::

    (1 + Z r) F = g_e V - Z A / s^2,    Z = s^2 m + s c + k + s b / (1 + s tau),    g_e = g / (1 + s tau),    r = 1 / k_s.

The voltage is the number given to a converter that holds it, the inputs pass an AC coupling, as in
`identification.VoltagePath`. Only the coil distinguishes suspension damping c from back-EMF b, so they are
one parameter here, half of it each.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vibrolock.arrays import Complex, Float


@dataclass(frozen=True)
class Prior:
    """Prior of a parameter: its median and the standard deviation of its logarithm."""

    value: float
    log_std: float


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured responses to the voltage."""

    frequency_hz: Float
    """Lines [n]."""
    value: Complex
    """Force (N/V), acceleration of the drive point and of every response channel (m/s^2/V) [n, 2 + responses]."""
    std: Float
    """Standard deviations [n, 2 + responses]."""
    sample_rate_hz: float
    """Sample rate of the hold of the output; the voltage is the number given to the converter."""


@dataclass(frozen=True, eq=False)
class LinearRig:
    """One linear rig: parameters by name."""

    values: Mapping[str, float]
    """Parameters. Modes beside the tested one have their number behind the name, the far ones ``low`` and ``high``."""
    channels: tuple[str, ...]
    """Response channels; the shape of mode ``x`` at a channel over that at the drive point is ``ratio <channel> x``."""

    @property
    def modes(self) -> tuple[str, ...]:
        """Ends of the names of the modes; that of the tested mode is empty."""
        return tuple(
            name.removeprefix("frequency_hz").strip() for name in self.values if name.startswith("frequency_hz")
        )

    def of(self, name: str, mode: str = "") -> float:
        """Return a parameter of a mode."""
        return self.values[f"{name} {mode}".strip()]

    def receptances(self, s: Complex) -> Complex:
        """Displacement per force at drive point and response channels, m/N [1 + responses, n]."""
        out = np.zeros((1 + len(self.channels), s.size), np.complex128)
        for mode in self.modes:
            omega = 2.0 * np.pi * self.of("frequency_hz", mode)
            shape = self.of("drive_shape", mode)
            pole = s**2 + 2.0 * self.of("damping_ratio", mode) * omega * s + omega**2
            ratios = np.array([1.0, *(self.of(f"ratio {name}", mode) for name in self.channels)])
            out += shape * shape * ratios[:, None] / pole  # infinite where a fit tries an absurd shape; ** would raise
        return out

    def force_per_v(self, s: Complex, receptance: Complex) -> Complex:
        """Force per volt at the amplifier, N/V, where the drive point has this receptance (m/N)."""
        v = self.values
        lag = 1.0 + s * v["coil_time_constant_s"]
        compliance = receptance + 1.0 / v["stinger_stiffness_n_m"]
        return v["force_per_volt_n_v"] / lag / (1.0 + self.dynamic_stiffness(s) * compliance)

    def dynamic_stiffness(self, s: Complex) -> Complex:
        """Z of the shaker with its coil, N/m."""
        v = self.values
        half, lag = 0.5 * v["exciter_damping_n_s_m"], 1.0 + s * v["coil_time_constant_s"]
        return s**2 * v["moving_mass_kg"] + s * half * (1.0 + 1.0 / lag) + v["suspension_stiffness_n_m"]

    def responses(self, frequency_hz: Float, sample_rate_hz: float) -> Complex:
        """Responses as `Responses.value` has them."""
        s: Complex = 2j * np.pi * np.asarray(frequency_hz, np.complex128)
        receptances = self.receptances(s)
        late = np.asarray(np.sinc(frequency_hz / sample_rate_hz), np.complex128) * np.exp(-s * self.values["delay_s"])
        late = late * s / (s + 2.0 * np.pi * self.values["coupling_hz"])
        force = self.force_per_v(s, receptances[0]) * late
        return np.asarray(np.vstack([force, s**2 * receptances * force]).T)
