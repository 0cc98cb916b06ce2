"""Modal properties at every instant of a phase-locked vibration that may grow, decay or drift in frequency.

One nonlinear mode whose properties change little within a few periods obeys ``phi_d^2 F = a + c v + k x`` at the drive point,
with ``k = w^2`` and ``c = 2 w z`` at the instantaneous amplitude. With all signals demodulated by the same window, it becomes
``g = k + c b`` with ``g = (phi_d^2 F_1 - A_1) / X_1`` and ``b = V_1 / X_1``. This holds for settled and transient vibrations,
because A_1 and V_1 include the energy that a growing vibration stores.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import MOTION_ORDER, Channel, find_name, find_role
from identification.errors import IdentificationError
from identification.signals.chunks import check_samples, rising_steps, unwrapped
from identification.slow_flows.fits import LocalFit, as_settled, local_fits, noise_variances
from identification.slow_flows.signals import WINDOW_PERIODS, amplitudes, between_harmonics, derivatives
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float

_MIN_FIT_PERIODS = 1.0
"""Shortest window of a fit, periods: below one period harmonics are not told apart."""
_NOISE_FITS = 2.0  # factor by which the fits that estimate the noise are longer
_POOLED_PERIODS = 40.0  # over which the noise is taken as constant


@dataclass(frozen=True, eq=False, kw_only=True)
class SlowFlow:
    """Amplitudes and modal properties of a vibration at n instants.

    Parameters
    ----------
    channels
        One per row of ``harmonics``; exactly one of role ``force`` and one of role ``drive``.
    time_s, phase_periods
        float[n], time since the first sample of the record; phase of the oscillator in periods.
    harmonics
        complex[n_channels, n, H + 1], peak, in the unit of each channel, against the phase of the oscillator.
    drive_m
        complex[n], fundamental of the tested mode's displacement at the drive point.
    dynamic_stiffness, rate_1_s
        complex[n], ``g = (phi_d^2 F - A) / X`` (1/s^2) and ``b = V / X`` (1/s): growth rate and frequency of the motion.
    stiffness, damping_1_s
        float[n], k (1/s^2) and c (1/s) from least squares over ``fit_periods`` around each instant.
    stiffness_std, damping_std_1_s
        float[n], standard errors of these from the residuals of longer fits, with overlapping windows accounted for. A change
        of the properties that is not quadratic within twice the length of the fits counts as noise.
    noise
        float[n, 2], variances of real and imaginary part of ``g X``, (m/s^2)^2: the part that averages out like white noise
        of the force, and the part that averages out faster (`identification.slow_flows.fits`).
    force_noise
        float[n], ``phi_d^4 |F|^2 / 2`` between the harmonics, (m/s^2)^2, as the window of the demodulation would pass it. Its
        mean is an estimate of the first variance in ``noise`` from the force alone.
    drive_mode_shape
        phi_d, kg^-1/2.
    fit_periods
        Length of the sliding fits.
    residual_m_n
        Receptance of the other modes at the drive point, m/N, whose contribution was subtracted.
    """

    channels: tuple[Channel, ...]
    time_s: Float
    phase_periods: Float
    harmonics: Complex
    drive_m: Complex
    dynamic_stiffness: Complex
    rate_1_s: Complex
    stiffness: Float
    damping_1_s: Float
    stiffness_std: Float
    damping_std_1_s: Float
    noise: Float
    force_noise: Float
    drive_mode_shape: float
    fit_periods: float
    residual_m_n: float

    def index(self, name: str) -> int:
        """Row of the channel called ``name``."""
        return find_name(self.channels, name)

    def between(self, start_s: float, stop_s: float) -> "SlowFlow":
        """Return the instants from ``start_s`` to ``stop_s``."""
        inside = (self.time_s >= start_s) & (self.time_s <= stop_s)
        if not inside.any():
            there = f"there are some from {self.time_s[0]:g} to {self.time_s[-1]:g} s"
            raise IdentificationError(f"no instant from {start_s:g} to {stop_s:g} s; {there}", field="start_s, stop_s")
        return self.select(inside)

    def select(self, keep: NDArray[np.bool_]) -> "SlowFlow":
        """Return the instants where ``keep`` (bool[n]) is true."""
        cut: dict[str, Any] = {name: getattr(self, name)[keep] for name in _PER_INSTANT}
        return replace(self, harmonics=self.harmonics[:, keep], **cut)

    @property
    def force(self) -> Complex:
        """complex[n, H + 1]: harmonics of the force, N."""
        return np.asarray(self.harmonics[find_role(self.channels, "force")])

    @property
    def force_n(self) -> Float:
        """float[n]: measured peak of the fundamental of the force, N."""
        return np.asarray(np.abs(self.force[:, 1]))

    @property
    def resonant_force_n(self) -> Float:
        """float[n]: force that would hold the instantaneous amplitude at phase resonance, ``c w |X| / phi_d^2``, N."""
        omega = np.sqrt(np.maximum(self.stiffness, 0.0))
        return np.asarray(self.damping_1_s * omega * self.amplitude_m / self.drive_mode_shape**2)

    @property
    def amplitude_m(self) -> Float:
        """float[n]: peak of the fundamental of the displacement at the drive point, m."""
        return np.asarray(np.abs(self.drive_m))

    @property
    def frequency_hz(self) -> Float:
        """float[n]: instantaneous frequency of the motion, Hz."""
        return np.asarray(self.rate_1_s.imag / (2.0 * np.pi))

    @property
    def growth_1_s(self) -> Float:
        """float[n]: relative growth rate of the motion, 1/s."""
        return np.asarray(self.rate_1_s.real)

    @property
    def phase_lag_deg(self) -> Float:
        """float[n]: lag of the displacement behind the force at the drive point, in (-180, 180]."""
        return np.asarray(np.degrees(np.angle(self.force[:, 1] * np.conj(self.drive_m))))

    @property
    def modal_frequency_hz(self) -> Float:
        """float[n]: undamped modal frequency, Hz; NaN where the stiffness is not positive."""
        return np.asarray(np.sqrt(np.where(self.stiffness > 0.0, self.stiffness, np.nan)) / (2.0 * np.pi))

    @property
    def modal_frequency_std_hz(self) -> Float:
        """float[n]: standard error of the modal frequency, Hz."""
        return np.asarray(self.stiffness_std / (8.0 * np.pi**2 * self.modal_frequency_hz))

    @property
    def damping_ratio(self) -> Float:
        """float[n]: damping ratio ``c / (2 w)``."""
        return np.asarray(self.damping_1_s / (4.0 * np.pi * self.modal_frequency_hz))

    @property
    def damping_ratio_std(self) -> Float:
        """float[n]: standard error of the damping ratio."""
        return np.asarray(self.damping_std_1_s / (4.0 * np.pi * self.modal_frequency_hz))

    def deflection_ratio(self, name: str) -> Complex:
        """complex[n]: displacement at the channel called ``name`` over that at the drive point, fundamentals."""
        own, drive = self.index(name), find_role(self.channels, "drive")
        order = MOTION_ORDER[self.channels[own].motion] - MOTION_ORDER[self.channels[drive].motion]
        return np.asarray(self.harmonics[own, :, 1] / self.harmonics[drive, :, 1] / self.rate_1_s**order)


_PER_INSTANT = (
    *("time_s", "phase_periods", "drive_m", "dynamic_stiffness", "rate_1_s", "stiffness", "damping_1_s"),
    *("stiffness_std", "damping_std_1_s", "noise", "force_noise"),
)


def slow_flow(
    theta_rad: ArrayLike,
    samples: ArrayLike,
    channels: Sequence[Channel],
    *,
    sample_rate_hz: float,
    drive_mode_shape: float,
    harmonics: int = 7,
    fit_periods: float = 6.0,
    points_per_period: int = 2,
    skew_samples: ArrayLike | None = None,
    residual_m_n: float = 0.0,
) -> SlowFlow:
    """Identify modal properties at every instant of a record.

    Returns the slow flow without the first and last one and a half periods, where the window would be incomplete.

    Raises `IdentificationError` if values are NaN or infinite, lengths differ, the phase falls, there are too few
    samples per period, the record is too short, or roles are missing.

    Parameters
    ----------
    theta_rad, samples, channels, sample_rate_hz
        As for `periodic_vibration`, force and drive-point motion among the channels. Give the whole record and take slices of
        the result.
    drive_mode_shape
        Mass-normalised linear mode shape at the drive point, kg^-1/2; the damping is proportional to its square.
    harmonics
        Highest harmonic H.
    fit_periods
        Length of the sliding fits in periods: longer fits leave less noise, shorter ones resolve faster changes.
    points_per_period
        Number of instants per period; more than two add little, because the window passes little above one per period.
    skew_samples
        float[n_channels], delay of each channel in samples; zero if None.
    residual_m_n
        Receptance of all other modes at the drive point near the tested frequency, m/N, from a linear modal analysis (real
        part of `LinearModes.receptance` without the tested mode). It has no effect on a settled vibration near phase
        resonance. A ramp faster than the free decay needs a multiple of the settled force, and without this receptance the
        damping is then off by a percent.
    """
    theta = unwrapped(finite_array("theta_rad", theta_rad, np.float64, 1))
    data = finite_array("samples", samples, np.float64, 2)
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    check_samples(data, channels, theta.size)
    delay_s = _skew(skew_samples, len(channels)) / rate_hz
    force, drive = find_role(channels, "force"), find_role(channels, "drive")
    at = _instants(theta, harmonics, fit_periods, points_per_period)
    order = MOTION_ORDER[channels[drive].motion]
    rows = [*range(len(channels)), drive, drive, drive, force, force]
    orders = (*[0] * len(channels), -order, 1 - order, 2 - order, 1, 2)
    smooth = derivatives(theta, data[rows], rate_hz, delay_s[rows], orders)
    found = amplitudes(theta, smooth, at, harmonics)
    found[: len(channels), :, 0] = amplitudes(theta, data, at, 0)[..., 0].real
    x, v, a = found[-5:-2, :, 1] - residual_m_n * found[[force, -2, -1], :, 1]
    if not np.all(np.abs(x) > 0.0):
        raise IdentificationError("the drive point does not move, nothing can be identified", field="samples")
    shape = float(drive_mode_shape)
    if not (np.isfinite(shape) and shape):
        raise IdentificationError(field="drive_mode_shape", value=shape, allowed="finite and not zero")
    stiffness, rate = (shape**2 * found[force, :, 1] - a) / x, v / x
    periods = at / (2.0 * np.pi)
    fits = _sliding(stiffness, rate, np.abs(x), periods, fit_periods)
    # The two parts of the noise differ in how slowly they vary; separating them takes longer fits.
    longer = min(_NOISE_FITS * fit_periods, float(np.ptp(periods)))
    longer_fits = _sliding(stiffness, rate, np.abs(x), periods, longer, degree=2)
    near = [np.flatnonzero(np.abs(periods - centre) <= 0.5 * _POOLED_PERIODS) for centre in periods]
    noise = np.array([noise_variances([longer_fits[number] for number in some]) for some in near])
    errors = np.array([fit.standard_errors(variances) for fit, variances in zip(fits, noise, strict=True)])
    return SlowFlow(
        channels=tuple(channels),
        time_s=np.interp(at, theta, np.arange(theta.size) / rate_hz),
        phase_periods=periods,
        harmonics=found[: len(channels)],
        drive_m=x,
        dynamic_stiffness=stiffness,
        rate_1_s=rate,
        stiffness=np.array([as_settled(fit, residual_m_n / shape**2).stiffness for fit in fits]),
        damping_1_s=np.array([fit.damping for fit in fits]),
        stiffness_std=errors[:, 0],
        damping_std_1_s=errors[:, 1],
        noise=noise,
        force_noise=shape**4 * between_harmonics(theta, data[force], at),
        drive_mode_shape=shape,
        fit_periods=fit_periods,
        residual_m_n=residual_m_n,
    )


def _skew(skew_samples: ArrayLike | None, channels: int) -> Float:
    if skew_samples is None:
        return np.zeros(channels)
    skew: Float = finite_array("skew_samples", skew_samples, np.float64, 1)
    if skew.size != channels:
        raise IdentificationError(f"{skew.size} given for {channels} channels", field="skew_samples")
    return skew


def _instants(theta: Float, harmonics: int, fit_periods: float, points_per_period: int) -> Float:
    """float[n]: equidistant phases at which the window is complete; raises `IdentificationError` for an unusable phase."""
    IdentificationError.unless_at_least("harmonics", harmonics, 1)
    IdentificationError.unless_at_least("fit_periods", fit_periods, _MIN_FIT_PERIODS)
    IdentificationError.unless_at_least("points_per_period", points_per_period, 1)
    steps = rising_steps(theta)
    covered = float(theta[-1] - theta[0]) / (2.0 * np.pi) if theta.size else 0.0
    if covered < WINDOW_PERIODS + fit_periods:
        allowed = f"{WINDOW_PERIODS + fit_periods:g} with fit_periods = {fit_periods:g}"
        raise IdentificationError(f"covers {covered:.2f} periods", field="theta_rad", allowed=allowed)
    needed = 2 * harmonics + 2
    if (per_period := 2.0 * np.pi / float(steps.max())) <= needed:
        reason = f"{harmonics} need more than {needed} samples per period, the record has {per_period:.2f}"
        raise IdentificationError(reason, field="harmonics")
    half = np.pi * WINDOW_PERIODS
    count = int((theta[-1] - theta[0] - 2.0 * half) / (2.0 * np.pi) * points_per_period)
    return np.asarray(theta[0] + half + 2.0 * np.pi / points_per_period * np.arange(count + 1))


def _sliding(
    stiffness: Complex, rate: Complex, size: Float, periods: Float, fit_periods: float, degree: int = 1
) -> list[LocalFit]:
    """Fit around every instant; near the ends the fit takes as many instants, shifted to one side."""
    half = 0.5 * fit_periods + 1e-9
    middle = np.clip(periods, periods[0] + half, periods[-1] - half)
    near = np.abs(periods - middle[:, None]) <= half
    count = near.sum(axis=1)
    fits: dict[int, LocalFit] = {}
    for n in np.unique(count):  # rounding may leave an instant more or less between two ends
        centres = np.flatnonzero(count == n)
        rows = np.nonzero(near[centres])[1].reshape(centres.size, n)
        place = (periods[rows] - periods[centres, None]) / half
        same = local_fits(stiffness[rows], rate[rows], size[rows], periods[rows], place, np.ones(place.shape), degree)
        fits |= zip(centres.tolist(), same, strict=True)
    return [fits[centre] for centre in range(periods.size)]
