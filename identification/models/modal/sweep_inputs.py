"""Input of a sweep: frequency and complex amplitude over time, recorded or designed, at equidistant instants."""

from dataclasses import dataclass, replace

import numpy as np

from identification.channels import find_role
from identification.errors import IdentificationError
from identification.signals.half_periods import HalfPeriods
from identification.signals.transients import Transient
from identification.validation import positive
from vibrolock.arrays import Complex, Float

BY_ZERO_CROSSINGS = "force by zero crossings"
"""Origin of a force without the phase of the sweep; predictions from it have no phase to compare."""

_INSTANTS_PER_PERIOD = 16  # instants in a period of the highest frequency; chosen
_FEWEST_PER_PERIOD = 8  # instants in a period of the highest frequency that thinning keeps; chosen
_MOST_INSTANTS = 20_000_000  # instants of one sweep; chosen: more hint at crossings of noise
_UNEVEN = 1e-6  # relative difference of time steps that still count as equal; chosen: rounding only


@dataclass(frozen=True, eq=False)
class SweepInput:
    """Frequency (float[n], Hz) and amplitude (complex[n], peak, N or V, against the sweep's phase) at equidistant instants.

    ``window_periods`` is the window over which the amplitude was already smoothed, 0 if it was not; ``origin`` names its
    source.
    """

    time_s: Float
    frequency_hz: Float
    amplitude: Complex
    window_periods: int
    origin: str

    @property
    def step_s(self) -> float:
        """Time between instants, s."""
        return float(self.time_s[-1] - self.time_s[0]) / (self.time_s.size - 1)

    def thinned(self, longest_step_s: float) -> "SweepInput":
        """Keep every n-th instant: at most ``longest_step_s`` apart, and at least eight per shortest period."""
        longest = min(longest_step_s, 1.0 / (_FEWEST_PER_PERIOD * float(self.frequency_hz.max())))
        every = slice(0, None, max(1, int(longest / self.step_s)))
        return replace(
            self, time_s=self.time_s[every], frequency_hz=self.frequency_hz[every], amplitude=self.amplitude[every]
        )


@dataclass(frozen=True)
class VoltageSweep:
    """A planned sweep of constant voltage; it begins in the steady state at ``start_hz``.

    Parameters
    ----------
    start_hz, stop_hz
        First and last frequency.
    rate_hz_per_s
        Constant rate, above zero in both directions.
    level_v
        Peak of the recorded voltage, V.
    """

    start_hz: float
    stop_hz: float
    rate_hz_per_s: float
    level_v: float

    def __post_init__(self) -> None:
        for name in ("start_hz", "stop_hz", "rate_hz_per_s", "level_v"):
            positive(name, getattr(self, name))
        if self.start_hz == self.stop_hz:
            raise IdentificationError("must differ from start_hz", field="stop_hz", value=self.stop_hz)

    @property
    def name(self) -> str:
        """Description for tables."""
        return f"{self.level_v:g} V, {self.start_hz:g} to {self.stop_hz:g} Hz, {self.rate_hz_per_s:g} Hz/s"

    @property
    def duration_s(self) -> float:
        """Duration of the sweep, s."""
        return abs(self.stop_hz - self.start_hz) / self.rate_hz_per_s


def voltage_input(source: Transient | VoltageSweep, channel: str) -> SweepInput:
    """Return the voltage of a recorded or a designed sweep."""
    if isinstance(source, Transient):
        return _even(source, source.fundamental(channel), 0, "recorded voltage")
    time_s = _instants(0.0, source.duration_s, max(source.start_hz, source.stop_hz))
    way = np.sign(source.stop_hz - source.start_hz)
    frequency = source.start_hz + way * source.rate_hz_per_s * time_s
    return SweepInput(
        time_s, frequency, np.full(time_s.size, source.level_v, np.complex128), 0, f"planned {source.name}"
    )


def force_input(source: Transient | HalfPeriods) -> SweepInput:
    """Return the force of a recorded sweep: fundamentals, or (half) periods joined by monotone cubics, with a phase of zero."""
    if isinstance(source, Transient):
        force = source.fundamentals[find_role(source.channels, "force")]
        return _even(source, force, source.window_periods, "force by demodulation")
    from scipy.interpolate import PchipInterpolator

    time_s = _instants(source.time_s[0], source.time_s[-1], float(source.frequency_hz.max()))
    frequency, magnitude = (
        PchipInterpolator(source.time_s, values)(time_s) for values in (source.frequency_hz, source.magnitude)
    )
    return SweepInput(time_s, frequency, magnitude.astype(np.complex128), 0, BY_ZERO_CROSSINGS)


def _instants(start_s: float, stop_s: float, highest_hz: float) -> Float:
    """Return equidistant instants, sixteen per shortest period."""
    wanted = (stop_s - start_s) * highest_hz * _INSTANTS_PER_PERIOD
    if not 2.0 <= wanted <= _MOST_INSTANTS:
        raise IdentificationError(
            f"{stop_s - start_s:g} s at up to {highest_hz:g} Hz make {wanted:.3g} instants",
            field="sweep",
            allowed=f"2 to {_MOST_INSTANTS}",
            hint="are there crossings of noise among the half periods?",
        )
    return np.linspace(start_s, stop_s, int(np.ceil(wanted)) + 1)


def _even(source: Transient, amplitude: Complex, window_periods: int, origin: str) -> SweepInput:
    """Return a recorded sweep as it is if its instants are equidistant and dense enough, else interpolated by splines."""
    time_s, frequency = source.time_s, source.frequency_hz
    IdentificationError.raise_if(time_s.size < 4, f"has {time_s.size} instants", field="sweep", allowed="at least 4")
    steps = np.diff(time_s)
    enough = steps.max() * frequency.max() * _INSTANTS_PER_PERIOD < 1.25
    if enough and steps.max() - steps.min() <= _UNEVEN * steps.max():
        return SweepInput(time_s, frequency, amplitude, window_periods, origin)
    from scipy.interpolate import CubicSpline

    even = _instants(time_s[0], time_s[-1], float(frequency.max()))
    return SweepInput(
        even, CubicSpline(time_s, frequency)(even), CubicSpline(time_s, amplitude)(even), window_periods, origin
    )
