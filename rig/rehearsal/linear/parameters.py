"""Parameters of a fit of the linear rig: names, priors, bounds and start values."""

from collections.abc import Mapping, Sequence

import numpy as np

from rig.rehearsal.linear.model import Prior, Responses
from vibrolock.arrays import Float

POSSIBLE = 12.0
"""Largest distance of a logarithm from its prior, a factor of 160 000 either way; chosen: no step of a fit leads to a stiffness
of 0 or an infinite mass."""
_UNKNOWN_LOG_STD = 0.7
"""Standard deviation of the logarithm of a quantity that nobody has measured; chosen: a factor of two either way."""
_LOW, _HIGH = 0.05, 2.0
"""Frequencies of the modes far below and far above, over the ends of the band; chosen: far enough to act as residual terms."""
_MIN_HIGH = 1.1  # least frequency of the mode above the band, over the band's upper end; chosen
_FLOOR_DAMPING = 0.005  # median of the prior of a damping ratio; chosen: that of lightly damped metal structures
_COUPLING_HZ = 0.3  # corner frequency of the AC coupling of common IEPE conditioners, Hz
_HIGHEST_COUPLING, _LONGEST_COIL_S = 1.0, 0.01
"""Highest corner of the AC coupling, over the tested frequency, and longest time constant of a coil, s; chosen: exciters have
0.05 to 5 ms. A longer one integrates what a higher corner differentiates: the responses in the band stay the same, and the
force below it becomes a thousand times as large."""
_DEFAULT_RATE_HZ = 5000.0
"""Sample rate for the prior of the delay where no responses were measured, Hz; chosen: that of the shipped benches."""
MODE = ("frequency_hz", "damping_ratio", "drive_shape")  # parameters of a mode
_SCALED = ("moving_mass_kg", "exciter_damping_n_s_m", "suspension_stiffness_n_m")
"""Parameters of the shaker that scale with its mass."""


class ParameterTable:
    """Names, centres, standard deviations and bounds of the parameters of a fit."""

    def __init__(self, channels: Sequence[str], priors: Mapping[str, Prior]) -> None:
        self.channels, self.priors = tuple(channels), dict(priors)
        self.names: list[str] = []
        self.positive: list[bool] = []
        self.centre: list[float] = []
        self.std: list[float] = []
        self.lowest: dict[str, float] = {}
        self.highest: dict[str, float] = {}

    @property
    def bounds(self) -> tuple[Float, Float]:
        """Least and largest possible values [p]; without bounds for a parameter of any sign."""
        wide = np.where(self.positive, POSSIBLE, np.inf)
        least = [self.lowest.get(name, -np.inf) for name in self.names]
        most = [self.highest.get(name, np.inf) for name in self.names]
        return np.maximum(self.centre - wide, least), np.minimum(self.centre + wide, most)

    def add(self, name: str, value: float, std: float = _UNKNOWN_LOG_STD, *, positive: bool = True) -> None:
        """Add a parameter; ``std`` is that of the logarithm of a positive one."""
        known = self.priors.get(name, Prior(value, std))
        self.names.append(name)
        self.positive.append(positive)
        self.centre.append(float(np.log(known.value)) if positive else known.value)
        self.std.append(known.log_std)

    def vector(self, values: Mapping[str, float]) -> Float:
        """Return the vector of named values; what they do not name is at its centre."""
        return np.array(
            [
                centre if name not in values else float(np.log(values[name])) if positive else values[name]
                for name, positive, centre in zip(self.names, self.positive, self.centre, strict=True)
            ]
        )

    def mode(self, mode: str, frequency_hz: float, shape: float, *, log_std: tuple[float, float, float]) -> None:
        """Add a mode; ``log_std`` holds the values of frequency, damping ratio and drive shape."""
        end = f" {mode}" if mode else ""
        for name, value, std in zip(MODE, (frequency_hz, _FLOOR_DAMPING, shape), log_std, strict=True):
            self.add(f"{name}{end}", value, std)
        for name in self.channels:
            self.add(f"ratio {name}{end}", 0.0 if mode else 1.0, 2.0, positive=False)


def shaker_prior(mode: Mapping[str, float]) -> dict[str, Prior]:
    """Return the prior of a shaker that nobody has measured, by the mode (`MODE`) that it drives.

    Its moving mass is half the modal mass, its suspension resonates at 25 Hz, or at the mode if that is lower, with half of
    critical damping; each within a factor of four or so.
    """
    mass = 0.5 / mode["drive_shape"] ** 2
    omega = 2.0 * np.pi * min(25.0, mode["frequency_hz"])
    return {
        "force_per_volt_n_v": Prior(mode.get("force_per_volt_n_v", 3.0), 2.0),
        "coil_time_constant_s": Prior(1e-4, _UNKNOWN_LOG_STD),
        "moving_mass_kg": Prior(mass, 1.4),
        "exciter_damping_n_s_m": Prior(mass * omega, 1.4),
        "suspension_stiffness_n_m": Prior(mass * omega**2, 1.4),
        "stinger_stiffness_n_m": Prior(5e6, 1.4),
    }


def start_values(start: Mapping[str, float]) -> list[Mapping[str, float]]:
    """Return the start values of a fit: those of a first fit, and shakers of several masses that suit the mode."""
    suitable = {name: prior.value for name, prior in shaker_prior(start).items()}
    out: list[Mapping[str, float]] = [start]
    for times in (0.3, 1.0, 3.0):
        scaled = {name: times * suitable[name] for name in _SCALED}
        out.append({**suitable, **scaled, **{name: start[name] for name in MODE if name in start}})
    return out


def parameters_of(
    channels: Sequence[str],
    start: Mapping[str, float],
    priors: Mapping[str, Prior],
    responses: Responses | None,
    neighbours_hz: Sequence[float],
) -> ParameterTable:
    """Return the parameters of a rig with the tested mode, two far ones and further ones at ``neighbours_hz``."""
    out = ParameterTable(channels, priors)
    shape, hertz = start["drive_shape"], start["frequency_hz"]
    out.mode("", hertz, shape, log_std=(0.1, 1.5, _UNKNOWN_LOG_STD))
    for name, shaker in shaker_prior(start).items():
        out.add(name, shaker.value, shaker.log_std)
    rate = _DEFAULT_RATE_HZ if responses is None else responses.sample_rate_hz
    out.add("delay_s", 0.0, 2.0 / rate, positive=False)
    out.add("coupling_hz", _COUPLING_HZ)
    out.highest["coupling_hz"] = float(np.log(_HIGHEST_COUPLING * hertz))
    out.highest["coil_time_constant_s"] = float(np.log(_LONGEST_COIL_S))
    lowest, highest = (0.4 * hertz, 2.5 * hertz) if responses is None else responses.frequency_hz[[0, -1]]
    out.mode("low", _LOW * float(lowest), 0.1 * shape, log_std=(1e-3, 1e-3, 2.0))
    out.mode("high", _HIGH * float(highest), shape, log_std=(0.5, 1e-3, 2.0))
    out.lowest["frequency_hz high"] = float(np.log(_MIN_HIGH * highest))
    for number, line_hz in enumerate(neighbours_hz, 2):
        out.mode(str(number), line_hz, 0.3 * shape, log_std=(0.1, 1.5, 2.0))
    return out
