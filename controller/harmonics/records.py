"""Parameters and state of the harmonics loop, and its stages."""

from enum import IntEnum

from controller.adaptive_filter import MOST_HARMONICS
from vibrolock.arrays import record

ORDERS = (MOST_HARMONICS + 1,)  # shape of arrays by harmonic; harmonic 0 is the mean


class HarmonicStage(IntEnum):
    """What the harmonics loop does."""

    WAITING = 0
    """It waits for a locked, steady vibration; the output has no harmonics."""
    LISTENING = 1
    """It averages the force's harmonics before the step that measures the plant."""
    PROBING = 2
    """It averages them under the step."""
    CONTROLLING = 3
    """It drives them to their wanted values."""


WAITING, LISTENING, PROBING, CONTROLLING = (int(stage) for stage in HarmonicStage)

HARMONICS = record(
    ("wanted", "c16", ORDERS),
    ("plant", "c16", ORDERS),
    ("left_alone", "i8", ORDERS),
    i8="highest of_drive",
    f8="corner integral largest probe tolerance smallest high_pass_rad_s largest_v step_v dt_s",
)
"""Parameters of the harmonics loop (one record). ``highest``: H, or 0 without the loop. ``of_drive``: the controlled channel
is the drive. ``corner``, ``integral``: fractions of the oscillator's frequency. ``largest``: bound of |V_h| over the
fundamental. ``probe``: |V_h| of the step over it. ``tolerance``: of the channel's fundamental. ``smallest``: error (N) that
always counts as none. ``largest_v``: bound of the whole output. ``step_v``: bound of a harmonic's change from one sample to
the next. ``wanted``: ratios to the fundamental, where the plan names none. ``plant``: P_h where it is known, else 0.
``left_alone``: harmonics that are not controlled."""

HARMONICS_STATE = record(
    ("off", "i8", ORDERS),
    *((name, "f8", ORDERS) for name in ("probe", "scatter_square", "quiet_square", "square")),
    *((name, "c16", ORDERS) for name in ("wanted", "phasors", "filter", "aim", "volts", "error", "judged")),
    *((name, "c16", ORDERS) for name in ("sum", "before", "plant", "total", "mean")),
    i8="stage periods probes bounded unsteady samples prescribed",
    f8="miss miss_before amplitude_v share probe_v",
)
"""State of the harmonics loop (one record). ``periods``: of the present stage. ``probes``: how often the plant was measured
again. ``miss``: largest judged error over its tolerance; infinite before the loop controls. ``unsteady``: unsteady periods
in a row. ``bounded``: the bound of the voltage holds harmonics back. ``amplitude_v``: the output's fundamental. ``share``:
what is left of the harmonics while a run comes down. ``probe``: sizes of the step, relative to ``probe_v``. ``off``:
harmonics that are left alone. ``wanted``: ratios to the fundamental where some are ``prescribed``. ``filter``: F_h.
``volts``: V_h, which follows ``aim`` no faster than the slew limit. ``error``: F_h - G_h. ``total``, ``samples``, ``mean``:
its sum over the present period, and its mean over the last one. ``judged``, ``square``: slow means of the mean and of its
square. ``sum``, ``before``: averages while the plant is measured. ``plant``: P_h. ``scatter_square``: mean square of the
mean's change from period to period; ``quiet_square``: its smallest of late."""
