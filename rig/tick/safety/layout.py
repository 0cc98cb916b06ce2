"""Codes and records of the safety functions, shared by kernels and Python code."""

from enum import IntEnum
from typing import Self

from vibrolock.arrays import record


class GuardMode(IntEnum):
    """Output that the guard permits."""

    DISARMED = 0
    """0 V until a person arms."""
    ARMED = 1
    """The law's output within the limits."""
    RAMPING = 2
    """A half-cosine ramp to 0 V at frozen frequency."""
    OFF = 3
    """0 V, latched."""


class EndReason(IntEnum):
    """Why the output was brought down. Everything from FORCE_LIMIT on is a trip and latches."""

    text: str
    """The reason in one line."""

    def __new__(cls, value: int, text: str = "") -> Self:
        """Make a member; one that exists is found by its value alone."""
        member = int.__new__(cls, value)
        member._value_, member.text = value, text
        return member

    NONE = 0, "running"
    COMPLETED = 1, "the plan was carried out"
    STOP_REQUESTED = 2, "stopped by request"
    PLAN_STOPPED = 3, "stopped by the plan's rule after a point failed"
    NO_LOCK_IN_WINDOW = 4, "no lock at the start voltage: the frequency stands at an end of its window"
    NO_LOCK = (
        5,
        "no lock at the start voltage: the phase error stays large, or force or drive is too small to be read "
        "(start_periods may be too short)",
    )
    START_REFUSED = 6, "what was measured at the start does not fit the bench"
    FORCE_LIMIT = 10, "force above its limit"
    RESPONSE_LIMIT = 11, "response above its limit"
    DISPLACEMENT_LIMIT = 12, "displacement above its limit"
    OVERTRAVEL = 13, "displacement far above its limit"
    FREQUENCY_LIMIT = 14, "frequency outside its limits"
    SENSOR_OVERLOAD = 15, "sensor at the end of its range"
    SENSOR_STUCK = 16, "sensor dead, stuck or below one bit (its reading does not change while the rig is driven)"
    NON_FINITE_INPUT = 17, "input is not a number"
    NON_FINITE_OUTPUT = 18, "the law's output is not a number"
    LOST_LOCK = 19, "phase lock lost"
    DRIVER_FAILED = 20, "the driver failed"
    SAMPLES_LOST = 21, "samples were lost for longer than is allowed"
    EMERGENCY_STOP = 22, "emergency stop"
    LEVEL_NOT_FOLLOWED = 23, "the output rose, but the controlled quantity did not follow"
    PLANT_CONTRADICTED = 24, "force and motion do not fit the known plant at this output"
    OVER_LEVEL = 25, "force or motion far above its level"
    GAIN_CHANGED = 26, "the output needed for the level has changed by more than the rig explains"

    @property
    def is_trip(self) -> bool:
        """Whether a person has to look before the rig is armed again."""
        return self >= EndReason.FORCE_LIMIT


POLARITY_HINT = "is a sensor's polarity reversed, or the resonance outside the frequency window?"
"""What to look for where a loop finds no lock."""

LIMITS = record(
    f8="voltage_v displacement_m near_m lowest_rad_s highest_rad_s slew_v_per_sample integrator_gain integrator_leak "
    "resonance_rad_s",
    i8="overload_samples stuck_samples lost_samples ramp_down_samples",
)
"""Limits of a bench in samples and SI units (one record), and the resonance frequency that dominates the motion. A displacement
above ``near_m`` is near its limit."""

INPUT = record(
    f8="unit_per_volt overload_v alarm_v limit near skew_samples stop_below_v stop_above_v",
    i8="role watch_displacement emergency_stop",
)
"""Parameters of an input channel (one record a channel). A reading above ``near`` is near its ``limit``. A channel with
``emergency_stop`` is a switch: a reading outside ``stop_below_v`` to ``stop_above_v`` drops the output. Otherwise its reading
may stay constant."""

INPUT_WATCH = record(f8="mean velocity displacement last_v", i8="same_samples overload_samples distrusted alert")
"""Running state of an input channel (one record a channel)."""

GUARD = record(
    i8="mode reason channel sample ramp_sample stop_requested dropped off_samples lock near near_periods",
    f8="value ramp_from_v amplitude_v",
)
"""State of the guard (one record). ``reason``, ``channel``, ``sample``, ``value`` are written once, for the first cause.
``off_samples``: samples since the output went off; ``dropped``: the output was dropped instead of ramped; ``lock``: lock state
when a segment was cut short; ``near``: whether a reading of this period was near its limit; ``near_periods``: such periods in a
row."""
