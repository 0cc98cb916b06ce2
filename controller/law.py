"""A complete control law: its parameters, its state, and the open-loop law for a frequency given by the plan."""

import math
from abc import abstractmethod
from typing import Protocol

import numpy as np

from controller.amplitude import AMPLITUDE, AMPLITUDE_STATE, AmplitudeLaw, AmplitudeSettings, amplitude_state
from controller.detector import DETECTOR, DETECTOR_STATE, VIBRATION, DetectorSettings, phase_error
from controller.feed_forward import BACKBONE
from controller.frequency import FREQUENCY, FREQUENCY_STATE
from controller.harmonics.records import HARMONICS, HARMONICS_STATE
from controller.harmonics.settings import HarmonicsSettings
from controller.lock import LOCK, THRESHOLDS, LockRule
from controller.period import PERIOD
from controller.rest import REST, REST_STATE, estimate_steady_force, take_as_measured
from vibrolock.compiled import Record, inner_kernel

LAW = np.dtype(
    [
        ("detector", DETECTOR),
        ("rest", REST),
        ("frequency", FREQUENCY),
        ("amplitude", AMPLITUDE),
        ("harmonics", HARMONICS),
        ("lock", THRESHOLDS),
    ]
)
"""Frozen parameters of a law (one record), built by `Law.build`: one record for each part of the law."""

CONTROL = np.dtype(
    [
        ("vibration", VIBRATION),
        ("detector", DETECTOR_STATE),
        ("rest", REST_STATE),
        ("frequency", FREQUENCY_STATE),
        ("backbone", BACKBONE),
        ("amplitude", AMPLITUDE_STATE),
        ("harmonics", HARMONICS_STATE),
        ("lock", LOCK),
        ("period", PERIOD),
    ]
)
"""State of a law (one record): the measured vibration, and one record for each part of the law."""


class Law(Protocol):
    """A configured control law: the criteria of phase lock, and the parameters of the law for a sample rate."""

    @property
    def lock(self) -> LockRule:
        """When a lock counts as gained and as lost."""

    @property
    def harmonics(self) -> HarmonicsSettings | None:
        """The harmonics loop, if there is one."""

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency that the law itself can choose, Hz; 0 if the plan gives the frequency."""

    def build(
        self,
        sample_rate_hz: float,
        amplitude_law: AmplitudeLaw,
        largest_v: float,
        drive_mode_shape: float | None = None,
    ) -> np.ndarray:
        """Return one record of `LAW`; raise ValueError if the settings do not suit these arguments.

        ``amplitude_law``: the quantity that the plan's levels prescribe. ``largest_v``: largest output amplitude (V), beyond
        which no loop integrates. ``drive_mode_shape``: the tested mode's mass-normalised shape at the drive point (kg^-1/2),
        where known.
        """


def control_state(law: np.ndarray) -> np.ndarray:
    """Return the state of a law (one record of `CONTROL`) that starts at rest, at its centre frequency."""
    out = np.zeros(1, CONTROL)
    out["frequency"]["omega"] = law["frequency"]["centre_rad_s"]
    out["amplitude"] = amplitude_state(law["amplitude"])
    out["harmonics"]["miss"] = math.inf
    return out


class LawSettings(DetectorSettings, AmplitudeSettings):
    """What any law has: detector, amplitude loop and the table of the harmonics loop."""

    harmonics: HarmonicsSettings | None = None
    """The harmonics loop: harmonics of the output that make those of the force zero, or what is prescribed. Without this table
    the output is a sine."""

    def build(
        self,
        sample_rate_hz: float,
        amplitude_law: AmplitudeLaw,
        largest_v: float,
        drive_mode_shape: float | None = None,
    ) -> np.ndarray:
        """Return the parameters for a sample rate: one record of `LAW`; see `Law`.

        Raises ValueError if the frequency window reaches beyond a quarter of the sample rate, if the loop that should hold the
        level has no gain, or if the mode shape is needed and missing.
        """
        out = np.zeros(1, LAW)
        self.build_feedback(out, sample_rate_hz, drive_mode_shape)
        out["detector"] = self.build_detector(sample_rate_hz)
        gain, sees_rest = float(out["detector"]["gain"][0]), bool(out["rest"]["gain"][0] != 0.0)
        out["amplitude"] = self.build_amplitude(amplitude_law, largest_v, 1.0 / sample_rate_hz, gain, sees_rest)
        if self.harmonics is not None:
            out["harmonics"] = self.harmonics.build_harmonics(sample_rate_hz, largest_v)
        return out

    @abstractmethod
    def build_feedback(self, out: np.ndarray, sample_rate_hz: float, drive_mode_shape: float | None) -> None:
        """Write the parameters of the lock and of the feedback to the frequency into a record of `LAW`."""


class OpenLoop(LawSettings):
    """Law without phase feedback: the plan gives the frequency. The level is a voltage or is held by an amplitude loop."""

    @property
    def lock(self) -> LockRule:
        """Rules of the lock. An open loop never seeks a lock, but needs the smallest amplitudes that they carry."""
        return LockRule()

    @property
    def highest_frequency_hz(self) -> float:
        """The plan gives the frequency: 0."""
        return 0.0

    def build_feedback(self, out: np.ndarray, sample_rate_hz: float, drive_mode_shape: float | None) -> None:
        """Write the parameters of the lock; without feedback the others are zero."""
        out["lock"] = self.lock.build()


@inner_kernel
def measure_phase(law: Record, control: Record, wanted_lag: float, lag_of_channels: float, by_loop: bool) -> bool:
    """Update presence, phase error and steady force in ``control.vibration``; called after the detector, once a sample.

    ``wanted_lag`` and ``lag_of_channels`` are in rad; the latter is the phase by which the force channel lags the other.
    ``by_loop``: the frequency law gives the frequency. Return whether the loop is closed: the frequency law gives the
    frequency, and force and motion are present.
    """
    vibration = control.vibration
    present = vibration.force_n >= law.lock.smallest_force_n and vibration.drive_m_s2 >= law.lock.smallest_response
    closed = bool(present and by_loop)
    vibration.present = 1 if present else 0
    vibration.error_rad = 0.0
    if closed:
        vibration.error_rad = phase_error(law.detector, control.detector, vibration, wanted_lag, lag_of_channels)
    if by_loop:
        estimate_steady_force(law.rest, control.rest, vibration, control.frequency.omega, wanted_lag, lag_of_channels)
    else:
        take_as_measured(control.rest, vibration)
    return closed
