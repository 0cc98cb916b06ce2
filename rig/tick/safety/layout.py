"""Codes and records of the safety functions, shared by kernels and Python code."""

from enum import IntEnum

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

    NONE = 0
    COMPLETED = 1
    STOP_REQUESTED = 2
    PLAN_STOPPED = 3
    NO_LOCK_IN_WINDOW = 4
    NO_LOCK = 5
    START_REFUSED = 6
    FORCE_LIMIT = 10
    RESPONSE_LIMIT = 11
    DISPLACEMENT_LIMIT = 12
    OVERTRAVEL = 13
    FREQUENCY_LIMIT = 14
    SENSOR_OVERLOAD = 15
    SENSOR_STUCK = 16
    NON_FINITE_INPUT = 17
    NON_FINITE_OUTPUT = 18
    LOST_LOCK = 19
    DRIVER_FAILED = 20
    SAMPLES_LOST = 21
    EMERGENCY_STOP = 22
    LEVEL_NOT_FOLLOWED = 23
    PLANT_CONTRADICTED = 24
    OVER_LEVEL = 25
    GAIN_CHANGED = 26

    @property
    def is_trip(self) -> bool:
        """Whether a person has to look before the rig is armed again."""
        return self >= EndReason.FORCE_LIMIT


TEXT = {
    EndReason.NONE: "running",
    EndReason.COMPLETED: "the plan was carried out",
    EndReason.STOP_REQUESTED: "stopped by request",
    EndReason.PLAN_STOPPED: "stopped by the plan's rule after a point failed",
    EndReason.NO_LOCK_IN_WINDOW: "no lock at the start voltage: the frequency stands at an end of its window",
    EndReason.NO_LOCK: (
        "no lock at the start voltage: the phase error stays large, or force or drive is too small to be read "
        "(start_periods may be too short)"
    ),
    EndReason.START_REFUSED: "what was measured at the start does not fit the bench",
    EndReason.FORCE_LIMIT: "force above its limit",
    EndReason.RESPONSE_LIMIT: "response above its limit",
    EndReason.DISPLACEMENT_LIMIT: "displacement above its limit",
    EndReason.OVERTRAVEL: "displacement far above its limit",
    EndReason.FREQUENCY_LIMIT: "frequency outside its limits",
    EndReason.SENSOR_OVERLOAD: "sensor at the end of its range",
    EndReason.SENSOR_STUCK: "sensor dead, stuck or below one bit (its reading does not change while the rig is driven)",
    EndReason.NON_FINITE_INPUT: "input is not a number",
    EndReason.NON_FINITE_OUTPUT: "the law's output is not a number",
    EndReason.LOST_LOCK: "phase lock lost",
    EndReason.DRIVER_FAILED: "the driver failed",
    EndReason.SAMPLES_LOST: "samples were lost for longer than is allowed",
    EndReason.EMERGENCY_STOP: "emergency stop",
    EndReason.LEVEL_NOT_FOLLOWED: "the output rose and what it should hold did not follow",
    EndReason.PLANT_CONTRADICTED: "force and motion are not those that the known plant gives for this output",
    EndReason.OVER_LEVEL: "force or motion far above its level",
    EndReason.GAIN_CHANGED: "the output that the level takes has changed by more than the rig explains",
}
"""One line for each reason."""

POLARITY_HINT = "is a sensor's polarity reversed, or the resonance outside the frequency window?"
"""What to look for where a loop finds no lock."""

LIMITS = record(
    f8="voltage_v displacement_m lowest_rad_s highest_rad_s slew_v_per_sample integrator_gain integrator_leak "
    "resonance_rad_s",
    i8="overload_samples stuck_samples lost_samples ramp_down_samples",
)
"""Limits of a bench in samples and SI units (one record), and the resonance frequency that dominates the motion."""

INPUT = record(
    f8="unit_per_volt overload_v alarm_v limit skew_samples stop_below_v stop_above_v",
    i8="role watch_displacement emergency_stop",
)
"""Parameters of an input channel (one record a channel). A channel with ``emergency_stop`` is a switch: a reading outside
``stop_below_v`` to ``stop_above_v`` drops the output. Otherwise its reading may stay constant."""

INPUT_WATCH = record(f8="mean velocity displacement last_v", i8="same_samples overload_samples distrusted alert")
"""Running state of an input channel (one record a channel)."""

GUARD = record(
    i8="mode reason channel sample ramp_sample stop_requested dropped off_samples lock",
    f8="value ramp_from_v amplitude_v",
)
"""State of the guard (one record). ``reason``, ``channel``, ``sample``, ``value`` are written once, for the first cause.
``off_samples``: samples since the output went off; ``dropped``: the output was dropped instead of ramped; ``lock``: lock state
when a segment was cut short."""
