"""Continuous backbone: the level is ramped up and down without waiting, and every instant is a measurement.

The amplitude alone does not determine the state of joints with memory: they dissipate differently while the level rises than
while it falls. To first order in the rate the two deviations are opposite, so that their mean at equal amplitude is the value
of the settled vibration. Half the difference between the two, as far as it exceeds the noise, is the systematic error of the
frequency, and a third of that half the one of damping and force: what lags behind the level changes the damping to first order
in the rate, which the mean cancels, and the stiffness to second order only, which it does not.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from identification.backbones import Backbone
from identification.errors import IdentificationError
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS, NonlinearMode
from identification.nonlinear.phase_resonance import nonlinear_mode
from identification.slow_flows.fits import LocalFit, neighbours, noise_variances, sensor_noise
from identification.slow_flows.resonance import Amplitudes, amplitudes_at, fit_at, resonant_vibration
from identification.slow_flows.signals import WINDOW_VARIANCE
from identification.slow_flows.slow_flow import SlowFlow
from identification.validation import finite_array
from vibrolock.arrays import Float
from vibrolock.results import Result

_DEGREE, _NOISY_DEGREE = 2, 1
"""Degree of a local polynomial over the logarithm of the amplitude, and near the noise. Chosen."""
_NOISE_SPAN = 1.0  # in the logarithm of the amplitude
_SECOND_ORDER = 1.0 / 3.0
"""Standard error of the mean damping over half the difference of up and down. Chosen: at 36 levels of three rigs up to 0.41."""
_FEWEST_INSTANTS = 8
"""Fewest instants in a local fit. Chosen."""
_WIDEN = 1.25
"""Factor by which a window with too few instants grows. Chosen."""
_SLOPE_WIDTH = 0.25  # in the logarithm of the amplitude; derivatives of the stiffness need more instants than itself
_WIDEST = 1.0  # in the logarithm of the amplitude


@dataclass(frozen=True, eq=False, kw_only=True)
class ContinuousBackbone(Result):
    """Modal properties over the amplitude, from ramps up and down.

    Parameters
    ----------
    backbone
        Settled vibrations at phase resonance with the mean properties of both ramps, one per level, as an ordinary backbone.
    amplitude_m
        float[n], levels: peak of the fundamental of the displacement at the drive point.
    stiffness, damping_1_s
        float[2, n], k (1/s^2) and c (1/s) on the ramp up and on the ramp down.
    stiffness_std, damping_std_1_s
        float[2, n], random standard errors of stiffness and damping.
    periods
        Number of periods of both ramps together.
    """

    backbone: Backbone
    amplitude_m: Float
    stiffness: Float
    damping_1_s: Float
    stiffness_std: Float
    damping_std_1_s: Float
    periods: float

    @property
    def modal_frequency_hz(self) -> Float:
        """float[2, n]: undamped modal frequency, up and down."""
        return np.asarray(np.sqrt(self.stiffness) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Float:
        """float[2, n]: damping ratio, up and down."""
        return np.asarray(self.damping_1_s / (2.0 * np.sqrt(self.stiffness)))

    def nonlinear_mode(self, **options: Any) -> NonlinearMode:
        """Identify the nonlinear mode; ``options`` are those of `identification.nonlinear_mode`.

        The difference between up and down counts as a systematic error of modal frequency, damping and force.
        """
        mode = nonlinear_mode(self.backbone, **options)
        frequency = _beyond_noise(self.stiffness, self.stiffness_std) / (8.0 * np.pi**2 * mode.modal_frequency_hz)
        first_order = _beyond_noise(self.damping_1_s, self.damping_std_1_s) / np.mean(self.damping_1_s, axis=0)
        relative = _SECOND_ORDER * first_order
        systematic = {
            "modal_frequency_hz": frequency,
            "damping_ratio": np.abs(relative * mode.damping_ratio),
            "damping_ratio_total_power": np.abs(relative * mode.damping_ratio),
            "force_n": np.abs(relative * mode.force_n),
        }
        return _with_systematic(replace(mode, source="continuous backbone"), systematic)


def continuous_backbone(
    up: SlowFlow,
    down: SlowFlow,
    *,
    levels_m: ArrayLike | None = None,
    number: int = 15,
    bandwidth: float = 0.15,
    accuracy: float = 0.008,
    specimen: str = "",
    drive_mode_shape_std: float | None = None,
) -> ContinuousBackbone:
    """Compute a backbone from a ramp of the level up and one down, in any order.

    Raises `IdentificationError` if channels or mode shapes differ, the ramps have no common amplitudes, or levels lie
    beyond these.

    Parameters
    ----------
    up, down
        Slow flows of the two ramps: parts of one (`SlowFlow.between`), or of two records.
    levels_m
        Amplitudes of the drive-point displacement, m; if None, in equal ratios over the range that both ramps cover.
    number
        Number of levels if ``levels_m`` is None.
    bandwidth
        Half width in ln(amplitude) of the local fit at a level (parabolic weights, properties quadratic in the amplitude);
        wider where a ramp has fewer than eight instants there. Sharper changes of the properties are smoothed.
    accuracy
        Relative random standard error of a ramp's damping above which the local fit is linear in the amplitude. If that is
        not enough, the width is increased up to one in ln(amplitude).
    specimen
        Name of what was tested.
    drive_mode_shape_std
        Standard error of the ramps' mode shape at the drive point, kg^-1/2; None if unknown.
    """
    if up.channels != down.channels or up.drive_mode_shape != down.drive_mode_shape:
        raise IdentificationError("channels or drive_mode_shape differ", field="up, down")
    levels = _levels(up, down, levels_m, number)
    widths = [[_wide_enough(np.log(flow.amplitude_m), at, bandwidth) for at in np.log(levels)] for flow in (up, down)]
    first = [
        [fit_around(flow, at, width, _DEGREE) for at, width in zip(np.log(levels), own, strict=True)]
        for flow, own in zip((up, down), widths, strict=True)
    ]
    noise = [noise_variances([fit for fits in first for fit in fits[near]]) for near in neighbours(levels.size)]
    sensors = _sensor_noise(up, down)
    ramps = [
        _along(flow, levels, own, fits, noise, sensors, accuracy)
        for flow, own, fits in zip((up, down), widths, first, strict=True)
    ]
    stiffness, damping = (
        np.array([[getattr(fit, name) for fit in ramp.fits] for ramp in ramps]) for name in ("stiffness", "damping")
    )
    errors = np.array([ramp.errors for ramp in ramps])
    points = []
    for n, level in enumerate(levels):
        both = [ramp.amplitudes[n] for ramp in ramps]
        mean = Amplitudes(0.5 * (both[0].values + both[1].values), 0.5 * np.hypot(both[0].std, both[1].std))
        random = 0.5 * np.hypot(errors[0, n], errors[1, n])
        points.append(
            resonant_vibration(
                up,
                float(level),
                float(np.mean(stiffness[:, n])),
                float(np.mean(damping[:, n])),
                (float(random[0]), float(random[1])),
                mean,
                sum(ramp.periods[n] for ramp in ramps),
            )
        )
    return ContinuousBackbone(
        backbone=Backbone(tuple(points), specimen, up.drive_mode_shape, drive_mode_shape_std=drive_mode_shape_std),
        amplitude_m=levels,
        stiffness=stiffness,
        damping_1_s=damping,
        stiffness_std=errors[..., 0],
        damping_std_1_s=errors[..., 1],
        periods=float(np.ptp(up.phase_periods) + np.ptp(down.phase_periods)),
    )


@dataclass(frozen=True, eq=False)
class _Ramp:
    """One ramp: the fit, its standard errors, the amplitudes and the number of periods of each level."""

    fits: list[LocalFit]
    errors: Float
    amplitudes: list[Amplitudes]
    periods: list[float]


def _levels(up: SlowFlow, down: SlowFlow, levels_m: ArrayLike | None, number: int) -> Float:
    low = max(float(flow.amplitude_m.min()) for flow in (up, down))
    high = min(float(flow.amplitude_m.max()) for flow in (up, down))
    IdentificationError.raise_if(not low < high, "the ramps have no amplitudes in common", field="up, down")
    if levels_m is None:
        IdentificationError.unless_at_least("number", number, 1)
        return np.geomspace(low, high, number)
    levels: Float = finite_array("levels_m", levels_m, np.float64, 1)
    if not levels.size or levels.min() < low or levels.max() > high:
        reason = f"both ramps cover {low:.4g} to {high:.4g} m, {levels_m} was asked for"
        raise IdentificationError(reason, field="levels_m")
    return levels


def _sensor_noise(up: SlowFlow, down: SlowFlow) -> Float:
    """Variances of the sensor noise, equal at all levels; estimated at the lowest levels, where it dominates."""
    lowest = []
    for flow in (up, down):
        size = flow.amplitude_m
        enough = np.sort(size)[min(_FEWEST_INSTANTS, size.size) - 1]
        lowest.append(flow.select(size <= max(size.min() * np.exp(_NOISE_SPAN), enough)))
    fits = [
        fit_at(flow, flow.amplitude_m / flow.amplitude_m.min() - 1.0, np.ones(flow.amplitude_m.size), _DEGREE)
        for flow in lowest
    ]
    return sensor_noise(np.concatenate([flow.force_noise for flow in lowest]), fits)


def _along(
    flow: SlowFlow,
    levels: Float,
    widths: list[float],
    fits: list[LocalFit],
    noise: list[Float],
    sensors: Float,
    accuracy: float,
) -> _Ramp:
    """Evaluate one ramp; where sensor noise makes the damping too inaccurate, fit fewer unknowns over a larger width."""
    found, periods, errors = [], [], []
    step = float(np.median(np.diff(flow.phase_periods)))
    for n, level in enumerate(np.log(levels)):
        width, degree = widths[n], _DEGREE
        while fits[n].standard_errors(sensors)[1] > accuracy * abs(fits[n].damping):
            if degree == _NOISY_DEGREE:
                width *= _WIDEN
            if width > _WIDEST:
                break
            degree = _NOISY_DEGREE
            fits[n] = fit_around(flow, level, width, degree)
        part, place, weight = _around(flow, level, min(width, _WIDEST))
        found.append(amplitudes_at(part, place, weight, degree))
        periods.append(place.size * step)
        errors.append(_errors(fits[n], degree, noise[n], sensors))
    return _Ramp(fits, np.array(errors), found, periods)


def _errors(fit: LocalFit, degree: int, noise: Float, sensors: Float) -> Float:
    """float[2]: standard errors; residuals at high levels contain more than sensor noise."""
    by_sensors = np.array(fit.standard_errors(sensors))
    if degree == _DEGREE:
        return np.asarray(np.maximum(fit.standard_errors(noise), by_sensors))
    expected = float(fit.expected[0] @ sensors)
    more = max(1.0, float(fit.moments[0]) / expected) if expected > 0.0 else 1.0
    return np.asarray(by_sensors * np.sqrt(more))


def fit_around(flow: SlowFlow, level: float, width: float, degree: int) -> LocalFit:
    """Fit stiffness and damping at ``ln X = level``, without the bias of the window in which the level moves.

    Within the demodulation's window, of variance s^2, the stiffness changes with the level l at its rate r. To second order
    the window gives

        g(X) = k + s^2 [(k_l + k_ll) r^2 + k_l d^2] / 2 + i s^2 k_l r d

    at the amplitude X that it gives, with d the rate of the vibration's phase against that of the oscillator.
    """
    wide = max(width, _SLOPE_WIDTH)
    slopes = fit_at(*_around(flow, level, wide), degree).slopes
    slope = float(slopes[0]) / wide
    bend = slope + (2.0 * float(slopes[1]) / wide**2 if degree > 1 else 0.0)
    part, place, weight = _around(flow, level, width)
    turning = 2.0 * np.pi * np.gradient(part.phase_periods, part.time_s)
    growth, detuning = part.growth_1_s, part.rate_1_s.imag - turning
    variance = WINDOW_VARIANCE * (2.0 * np.pi / turning) ** 2
    bias = variance * (0.5 * ((slope + bend) * growth**2 + slope * detuning**2) + 1j * slope * growth * detuning)
    return fit_at(replace(part, dynamic_stiffness=part.dynamic_stiffness - bias), place, weight, degree)


def _around(flow: SlowFlow, level: float, width: float) -> tuple[SlowFlow, Float, Float]:
    """Return the instants around ``ln X = level``, their places (linear in X) and weights."""
    distance = (np.log(flow.amplitude_m) - level) / width
    near = np.abs(distance) < 1.0
    return flow.select(near), (flow.amplitude_m[near] * np.exp(-level) - 1.0) / width, 1.0 - distance[near] ** 2


def _wide_enough(size: Float, level: float, bandwidth: float) -> float:
    """Return the bandwidth, or the next larger width with enough instants."""
    width = bandwidth
    while np.count_nonzero(np.abs(size - level) < width) < _FEWEST_INSTANTS:
        width *= _WIDEN
        if width > _WIDEST:
            reason = f"fewer than {_FEWEST_INSTANTS} instants near {np.exp(level):.4g} m; ramp more slowly"
            raise IdentificationError(reason, field="levels_m")
    return width


def _beyond_noise(values: Float, std: Float) -> Float:
    """float[n]: half the difference between up and down, beyond the contribution of noise.

    It is the RMS over neighbouring levels, because the error is not smaller where the two curves happen to cross.
    """
    square = 0.25 * (values[0] - values[1]) ** 2 - 0.25 * np.sum(std**2, axis=0)
    return np.asarray(np.sqrt(np.maximum([np.mean(square[near]) for near in neighbours(square.size)], 0.0)))


def _with_systematic(mode: NonlinearMode, further: dict[str, Float]) -> NonlinearMode:
    """Return the mode with additional, independent systematic standard errors."""
    changes: dict[str, Any] = {}
    systematic, intervals = mode.systematic_std.copy(), mode.interval_95.copy()
    for name, std in further.items():
        column = QUANTITIES.index(name)
        old = np.asarray(getattr(mode, STANDARD_ERRORS[name]))
        changes[STANDARD_ERRORS[name]] = np.hypot(old, std)
        systematic[:, column] = np.hypot(systematic[:, column], std)
        middle = np.asarray(getattr(mode, name))[:, None]
        side = np.array([-1.0, 1.0]) * np.hypot(intervals[:, column] - middle, 1.96 * std[:, None])
        intervals[:, column] = middle + side
    return replace(mode, **changes, systematic_std=systematic, interval_95=intervals)
