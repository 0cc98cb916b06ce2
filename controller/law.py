"""A control law as a whole: its parameters, its state, and the law of a tone whose frequency the plan gives."""

from typing import Protocol

import numpy as np

from controller.amplitude import AMPLITUDE, AMPLITUDE_STATE, AmplitudeLaw, AmplitudeSettings, amplitude_state
from controller.detector import DETECTOR, DETECTOR_STATE, VIBRATION, DetectorSettings, phase_error
from controller.frequency import FREQUENCY, FREQUENCY_STATE
from controller.lock import LOCK, THRESHOLDS, LockRule
from controller.period import PERIOD
from controller.rest import REST, REST_STATE, see_rest, take_as_measured
from vibrolock.compiled import Record, inner_kernel

__all__ = ["CONTROL", "LAW", "Law", "OpenLoop", "control_state"]

LAW = np.dtype(
    [("detector", DETECTOR), ("rest", REST), ("frequency", FREQUENCY), ("amplitude", AMPLITUDE), ("lock", THRESHOLDS)]
)
"""Frozen parameters of a law (one record), made by `Law.build`: one record for each of its parts."""

CONTROL = np.dtype(
    [
        ("vibration", VIBRATION),
        ("detector", DETECTOR_STATE),
        ("rest", REST_STATE),
        ("frequency", FREQUENCY_STATE),
        ("amplitude", AMPLITUDE_STATE),
        ("lock", LOCK),
        ("period", PERIOD),
    ]
)
"""State of a law (one record): what is measured of the vibration, and one record for each part."""


class Law(Protocol):
    """A configured law: rules of the lock, and parameters for a sample rate."""

    @property
    def lock(self) -> LockRule:
        """When a lock counts as gained and as lost."""

    def build(
        self,
        sample_rate_hz: float,
        amplitude_law: AmplitudeLaw,
        largest_v: float,
        drive_mode_shape: float | None = None,
    ) -> np.ndarray:
        """One record of `LAW`; ValueError where the law does not fit.

        ``amplitude_law`` is what the plan's levels are, ``largest_v`` the largest output amplitude (V), beyond which no loop
        integrates, ``drive_mode_shape`` the tested mode's mass-normalised shape at the drive point (kg^-1/2), where known.
        """


def control_state(law: np.ndarray) -> np.ndarray:
    """State of a law (one record of `CONTROL`) that begins at rest, at its centre frequency."""
    out = np.zeros(1, CONTROL)
    out["frequency"]["omega"] = law["frequency"]["centre_rad_s"]
    out["amplitude"] = amplitude_state(law["amplitude"])
    return out


class OpenLoop(DetectorSettings, AmplitudeSettings):
    """No feedback of the phase: the plan gives the frequency, and the level is volts or is held by one of the loops."""

    @property
    def lock(self) -> LockRule:
        """Rules of a lock that is never sought; they name the smallest amplitudes a phase can be read from."""
        return LockRule()

    def build(
        self,
        sample_rate_hz: float,
        amplitude_law: AmplitudeLaw,
        largest_v: float,
        drive_mode_shape: float | None = None,
    ) -> np.ndarray:
        """Parameters for a sample rate: one record of `LAW`."""
        out = np.zeros(1, LAW)
        out["detector"] = self.build_detector(sample_rate_hz)
        gain = float(out["detector"]["gain"][0])
        out["amplitude"] = self.build_amplitude(amplitude_law, largest_v, 1.0 / sample_rate_hz, gain, False)
        out["lock"] = self.lock.build()
        return out


@inner_kernel
def measure_phase(law: Record, control: Record, wanted_lag: float, lag_of_skew: float, by_loop: bool) -> bool:
    """Behind the detector, once a sample: whether there is a phase to be read, its error, and the force at rest.

    ``wanted_lag`` and ``lag_of_skew`` (by which the force's channel is later) in rad; ``by_loop``: the frequency law gives the
    frequency. Returns whether the loop is closed: it gives the frequency, and force and motion are present.
    """
    vibration = control.vibration
    present = vibration.force_n >= law.lock.smallest_force_n and vibration.drive_m_s2 >= law.lock.smallest_response
    closed = bool(present and by_loop)
    vibration.present = 1 if present else 0
    vibration.error_rad = 0.0
    if closed:
        vibration.error_rad = phase_error(law.detector, control.detector, vibration, wanted_lag, lag_of_skew)
    if by_loop:
        see_rest(law.rest, control.rest, vibration, control.frequency.omega, wanted_lag, lag_of_skew)
    else:
        take_as_measured(control.rest, vibration)
    return closed
