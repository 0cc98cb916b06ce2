"""What the tick asks of a control law, and the law of a tone whose frequency the plan gives."""

from typing import Protocol

import numpy as np

from controller.amplitude.loops import AmplitudeLoops
from controller.demodulation.settings import Demodulation
from controller.layout import LAW, AmplitudeLaw
from controller.lock.rule import LockRule

__all__ = ["Law", "OpenLoop"]


class Law(Protocol):
    """A configured law: rules of the lock, and coefficients for a sample rate."""

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
        """One record of `controller.layout.LAW`; ValueError where the law does not fit.

        ``amplitude_law`` is what the plan's levels are, ``largest_v`` the largest output amplitude (V), beyond which no loop
        integrates, ``drive_mode_shape`` the tested mode's mass-normalised shape at the drive point (kg^-1/2), where known.
        """


class OpenLoop(Demodulation, AmplitudeLoops):
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
        """Coefficients for a sample rate: one record of `controller.layout.LAW`."""
        out = np.zeros(1, LAW)
        self.fill_demodulation(out, sample_rate_hz)
        self.fill_amplitude(out, amplitude_law, largest_v)
        return out
