"""Measured periodic vibrations: one settled state each.

Conventions used throughout the package: ``y(t) = Re sum_h Y_h exp(i h theta)``; amplitudes are peak values in SI units; the
phase lag is ``arg F_1 - arg Q_1`` with the force F and the displacement Q at the drive point, and it is +90 degrees at phase
resonance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.channels import MOTION_ORDER, Channel, find_name, find_role, in_newtons
from identification.errors import IdentificationError
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float


def wrapped_deg(angle_deg: float) -> float:
    """Return ``angle_deg`` wrapped into (-180, 180]."""
    return 180.0 - (180.0 - angle_deg) % 360.0


@dataclass(frozen=True, eq=False)
class PeriodicVibration:
    """One settled periodic state.

    Raises `IdentificationError` if values are NaN or infinite, shapes do not agree, roles are missing, or there is no
    whole period.

    Parameters
    ----------
    channels
        One per row of ``harmonics``; exactly one of role ``force`` and one of role ``drive``.
    frequency_hz
        Mean frequency of the oscillator over the record.
    harmonics
        complex[n_channels, H + 1], peak, in the unit of each channel; column h belongs to ``exp(i h theta)``, H >= 1.
    periods
        Number of whole periods from which the coefficients were computed.
    residual_rms
        float[n_channels], RMS of the signal minus its harmonics, in the unit of each channel.
    harmonics_std
        float[n_channels, H + 1], standard error of the real part, equal to that of the imaginary part; None if unknown.
    rounding_std
        complex[n_channels, H + 1], the part of ``harmonics_std`` that would be the same in a further run, due to the steps of
        the converter and images of the held output: standard error in phase with the coefficient (real) and in quadrature
        (imaginary); None if unknown.
    drift
        complex[n_channels], change of the fundamental over the periods used, relative to the fundamental: the real part is
        that of the amplitude, the imaginary part that of the phase in rad; None if unknown.
    phase_lag_target_deg
        Target phase lag of the displacement, degrees; 90 is phase resonance.
    settled
        Whether the controller had settled before the record began.
    warnings
        Warnings about the record, one line each.
    """

    channels: tuple[Channel, ...]
    frequency_hz: float
    harmonics: Complex
    periods: int
    residual_rms: Float
    harmonics_std: Float | None = None
    drift: Complex | None = None
    phase_lag_target_deg: float = 90.0
    settled: bool = True
    warnings: tuple[str, ...] = ()
    rounding_std: Complex | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        names = [channel.name for channel in self.channels]
        if len(set(names)) != len(names):
            raise IdentificationError(f"names are not unique ({', '.join(names)})", field="channels")
        find_role(self.channels, "force")
        find_role(self.channels, "drive")
        in_newtons(self.channels, "a periodic vibration")
        positive("frequency_hz", self.frequency_hz, "Hz")
        IdentificationError.unless_at_least("periods", self.periods, 1)
        self._check("harmonics", np.complex128, 2)
        if self.harmonics.shape[1] < 2:
            reason = f"shape {self.harmonics.shape}"
            raise IdentificationError(reason, field="harmonics", allowed="harmonics 0 and 1 at least")
        self._check("residual_rms", np.float64, 1)
        if self.drift is not None:
            self._check("drift", np.complex128, 1)
        for name, dtype in (("harmonics_std", np.float64), ("rounding_std", np.complex128)):
            if getattr(self, name) is None:
                continue
            self._check(name, dtype, 2)
            if (shape := getattr(self, name).shape) != self.harmonics.shape:
                raise IdentificationError(f"shape {shape}, harmonics have {self.harmonics.shape}", field=name)

    def _check(self, name: str, dtype: type[np.generic], ndim: int) -> None:
        array = finite_array(name, getattr(self, name), dtype, ndim)
        if array.shape[0] != len(self.channels):
            raise IdentificationError(f"shape {array.shape} for {len(self.channels)} channels", field=name)
        object.__setattr__(self, name, array)

    def index(self, name: str) -> int:
        """Row of the channel called ``name``."""
        return find_name(self.channels, name)

    @property
    def force(self) -> Complex:
        """complex[H + 1]: harmonics of the force, N."""
        return np.asarray(self.harmonics[find_role(self.channels, "force")])

    @cached_property
    def drive_m(self) -> Complex:
        """complex[H + 1]: harmonics of the displacement at the drive point, m."""
        return self.displacement_m(self.channels[find_role(self.channels, "drive")].name)

    def displacement_m(self, name: str) -> Complex:
        """complex[H + 1]: harmonics of the displacement at the channel called ``name``, m.

        Harmonic 0 is NaN for a velocity or acceleration channel, because its static part does not determine the displacement.
        """
        index = self.index(name)
        order = MOTION_ORDER[self.channels[index].motion]
        displacement: Complex = np.full(self.harmonics.shape[1], complex(np.nan, np.nan))
        harmonic = np.arange(1, self.harmonics.shape[1])
        displacement[1:] = self.harmonics[index, 1:] / (2j * np.pi * self.frequency_hz * harmonic) ** order
        if order == 0:
            displacement[0] = self.harmonics[index, 0]
        return displacement

    @property
    def force_n(self) -> float:
        """Peak of the fundamental of the force, N."""
        return float(abs(self.force[1]))

    @property
    def amplitude_m(self) -> float:
        """Peak of the fundamental of the displacement at the drive point, m."""
        return float(abs(self.drive_m[1]))

    @property
    def phase_lag_deg(self) -> float:
        """Phase lag of the fundamental of the displacement behind the force at the drive point, degrees, in (-180, 180]."""
        return wrapped_deg(float(np.degrees(np.angle(self.force[1]) - np.angle(self.drive_m[1]))))

    @property
    def phase_error_deg(self) -> float:
        """Target phase lag minus measured phase lag, degrees, in (-180, 180].

        The error is positive below resonance, where the loop has to raise the frequency.
        """
        return wrapped_deg(self.phase_lag_target_deg - self.phase_lag_deg)
