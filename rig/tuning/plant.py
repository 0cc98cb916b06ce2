"""Fit the plant to the spectra of the linear test, and compare it with the bench's facts."""

import cmath
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.tuning import PlantModel
from identification import FrequencyResponseMatrix, PeriodicSpectra, best_linear_approximation
from rig.bench import Bench
from rig.errors import RigError
from vibrolock.arrays import Complex, Float


class TuningError(RigError):
    """A rig cannot be tuned: its test shows no mode, or no gains are suitable. The message contains the numbers."""


class UnsuitedError(TuningError):
    """No gains suit the plant."""


FIT_BAND = (0.6, 1.6)  # of the linear frequency: band of the plant model
NARROWER = ((0.7, 1.4), (0.8, 1.25))  # bands of further fits, whose differences show what the model lacks
FINE_FIT = (
    0.03  # misfit, relative to the measurement, of a band that is taken; chosen: two thirds of drawn rigs have 0.01
)
MODEL_ERROR = 0.02
"""Of a response: error of the model that weighs in the fit beside the noise, so that small responses count."""
NEIGHBOURS = 10  # lines; chosen: the noise of a band around a mode changes little over twenty
UNKNOWN_STD = 1e3  # times alpha: its standard error where the lines do not tell it
EXCITER_PRIOR = 0.3  # an exciter's spring in the band, relative to its moving mass, where one mode does not show it


def coherence_of(bench: Bench, measured: PeriodicSpectra) -> tuple[float, float]:
    """Coherence of force and drive with the voltage for one period, median over the band around the mode."""
    around = near(bench, measured.frequency_hz) & measured.excited
    out = []
    for role in ("force", "drive"):
        index = measured.index(bench.channels[bench.index_of(role)].name)
        power = np.mean(np.abs(measured.mean[:, index][:, around]) ** 2, axis=0)
        noise = np.mean(measured.noise_variance[:, index][:, around], axis=0)
        signal = float(np.median(np.maximum(power - noise / measured.spectra.shape[1], 0.0)))
        out.append(signal / max(signal + float(np.median(noise)), 1e-300))
    return out[0], out[1]


def voltage_responses(bench: Bench, measured: PeriodicSpectra) -> FrequencyResponseMatrix:
    """Return force, drive acceleration, and the accelerations of all response channels per volt, with covariance."""
    names = [c.name for role in ("force", "drive", "response") for c in bench.channels if c.role == role]
    return best_linear_approximation(measured, outputs=names, inputs=("voltage",), specimen=bench.specimen.name)


def near(bench: Bench, frequency_hz: Float, band: tuple[float, float] = FIT_BAND) -> NDArray[np.bool_]:
    """Return which lines lie in a band, given as parts of the linear frequency; by default that of the plant model."""
    linear = bench.specimen.linear_frequency_hz
    return np.asarray((frequency_hz > band[0] * linear) & (frequency_hz < band[1] * linear))


def densities(bench: Bench, measured: PeriodicSpectra) -> tuple[float, float]:
    """Return the one-sided noise densities of force and drive acceleration near the mode.

    A line of resolution d carries the power S d, half the square of its peak amplitude.
    """
    around = near(bench, measured.frequency_hz)
    step = float(np.diff(measured.frequency_hz).mean())
    rows = [measured.index(bench.channels[bench.index_of(role)].name) for role in ("force", "drive")]
    force, drive = (0.5 * float(np.mean(measured.noise_variance[:, row][:, around])) / step for row in rows)
    return force, drive


MAX_OFFSET = 0.1  # of the linear frequency: beyond, it may be another mode
MIN_NOTED_DEG = 1.0  # smallest phase that is worth a note, deg; chosen
MIN_NOTED_HZ = 0.005
"""Smallest relative difference of the frequency from that of the bench that is worth a note; chosen."""
MIN_NOTED_SHAPE = 0.05  # smallest relative difference of phi_d from that of the bench that is worth a note; chosen
MIN_SIGNIFICANCE = 3.0  # standard errors above which the motion of a channel counts as measured
MAX_SHAPE_FACTOR = 1.5  # factor by which phi_d may be wrong in the frequency-error law


def plant_of(bench: Bench, responses: FrequencyResponseMatrix, lead_samples: float) -> PlantModel:
    """Fit the plant to force and drive acceleration per volt around the bench's linear frequency.

    The band is the widest of `FIT_BAND` and `NARROWER` in which the model misfits by `FINE_FIT` at most, or the one in which it
    misfits least: a second mode, or an exciter's, spoils the wider ones.

    The standard errors of the mode are those of noise and distortion (`controller.tuning.plant_errors`) and, in addition, the
    largest difference to fits over narrower bands: what the model lacks, such as modes beyond its residual terms,
    acts differently on each of them. All hold for the plant at the level of the test: how frequency and damping change with
    the level is not in them. A wrong sensitivity of force or drive is not in them either; it cancels in damping that is
    computed with this mode shape from the same sensors.

    ``lead_samples`` is the number of samples between an output and its effect in the inputs, in the run that measured the
    responses. Raises `TuningError` if they show no mode of the structure.
    """
    linear = bench.specimen.linear_frequency_hz
    try:
        widest = _fitted(bench, responses, lead_samples, FIT_BAND)
        widest.lock_frequency_rad_s()
    except ValueError as error:
        raise TuningError(
            f"no mode near specimen.linear_frequency_hz = {linear:g} Hz, between {FIT_BAND[0] * linear:.4g} and "
            f"{FIT_BAND[1] * linear:.4g} Hz: {error}"
        ) from None
    fits = [widest]
    for band in NARROWER:
        with suppress(ValueError):  # too few lines, or too little of the resonance
            fits.append(_fitted(bench, responses, lead_samples, band))
    least = min(fits, key=lambda fit: fit.fit_error)
    plant = next((fit for fit in fits if fit.fit_error <= FINE_FIT), least)
    others = fits[fits.index(plant) + 1 :]

    def with_spread(std: float | None, of: Callable[[PlantModel], complex]) -> float:
        return math.hypot(std or 0.0, max((abs(of(other) - of(plant)) for other in others), default=0.0))

    def alpha(one: PlantModel) -> complex:
        return complex(one.exciter(1j * plant.frequency_rad_s)[0])

    alpha_std = UNKNOWN_STD * abs(alpha(plant)) if plant.force_v_n_std is None else plant.force_v_n_std
    return replace(
        plant,
        frequency_std_rad_s=with_spread(plant.frequency_std_rad_s, lambda one: one.frequency_rad_s),
        damping_ratio_std=with_spread(plant.damping_ratio_std, lambda one: one.damping_ratio),
        drive_shape_std=with_spread(plant.drive_shape_std, lambda one: one.drive_shape),
        force_v_n_std=with_spread(alpha_std, alpha),
    )


def _fitted(
    bench: Bench, responses: FrequencyResponseMatrix, lead_samples: float, band: tuple[float, float]
) -> PlantModel:
    """Fit the plant to the lines in a band, given as parts of the linear frequency; raise ValueError if that fails."""
    frequency = responses.frequency_hz
    around = near(bench, frequency, band)
    covariance = responses.total_covariance if responses.total_covariance is not None else responses.noise_covariance
    value = responses.value[around, :2, 0]
    total, noise = responses.total_std[around, :2, 0], responses.noise_std[around, :2, 0]
    std = np.hypot(smoothed_std(np.where(np.isfinite(total), total, noise)), MODEL_ERROR * np.abs(value))
    return PlantModel.from_frequency_responses(
        frequency[around],
        value[:, 0],
        value[:, 1],
        sample_rate_hz=bench.sample_rate_hz,
        latency_samples=lead_samples,
        force_std=std[:, 0],
        acceleration_std=std[:, 1],
        covariance=None if covariance is None else covariance[around, :2, :2],
        exciter_prior=EXCITER_PRIOR,
    )


def smoothed_std(std: Float) -> Float:
    """Standard deviations [n, 2] pooled over `NEIGHBOURS` on either side: a line's own, of few periods, may be near zero."""
    if not std.size:
        return std
    variance = np.pad(np.nan_to_num(std, posinf=0.0) ** 2, ((NEIGHBOURS, NEIGHBOURS), (0, 0)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(variance, 2 * NEIGHBOURS + 1, axis=0)
    return np.asarray(np.sqrt(windows.mean(axis=-1)))


class ChannelRatios(NamedTuple):
    """Motion of the response channels for that of the drive point, by channel name."""

    ratios: dict[str, float]
    """Displacement per displacement of the drive point."""
    stds: dict[str, float]
    """Standard errors of the ratios."""
    turns_deg: dict[str, float]
    """By how much a channel stands ahead of the phase of a real mode shape, deg in (-90, 90]; left out below a degree, which
    other modes and noise make."""


def channel_ratios(responses: FrequencyResponseMatrix, plant: PlantModel) -> ChannelRatios:
    """Return the motion of each response channel for that of the drive point at resonance.

    Each ratio is a least-squares fit of the channel's response to that of the drive point, over the lines within a bandwidth of
    the mode. A channel that does not stand out of the noise is left out. The standard errors are those of noise and distortion
    in both channels, increased where the fit is worse than these explain, and in addition the difference to the fit within half
    the bandwidth, where other modes contribute less. Where the covariance is unknown, the noise is taken from the misfit.
    """
    wide, narrow = (_within_bandwidth(responses, plant, part) for part in (1.0, 0.5))
    drive = responses.value[wide, 1, 0]
    power = float(np.sum(np.abs(drive) ** 2))
    out = ChannelRatios({}, {}, {})
    for row, channel in list(enumerate(responses.outputs))[2:]:
        product = complex(np.vdot(drive, responses.value[wide, row, 0]))
        ratio = abs(product) / power
        error = math.sqrt(float(np.sum(np.abs(drive) ** 2 * responses.total_std[wide, row, 0] ** 2))) / power
        if not ratio > MIN_SIGNIFICANCE * error:
            continue
        out.ratios[channel.name] = ratio
        std, apart = _ratio(responses, wide, row)[1], ratio - _ratio(responses, narrow, row)[0]
        out.stds[channel.name] = math.hypot(std, apart)
        turn_deg = -((90.0 - math.degrees(cmath.phase(product))) % 180.0 - 90.0)
        if abs(turn_deg) >= MIN_NOTED_DEG:
            out.turns_deg[channel.name] = turn_deg
    return out


def _ratio(responses: FrequencyResponseMatrix, around: NDArray[np.bool_], row: int) -> tuple[float, float]:
    """Return the size of an output over the drive, fitted over some lines, and its standard error without other modes'."""
    drive, own = responses.value[around, 1, 0], responses.value[around, row, 0]
    power = float(np.sum(np.abs(drive) ** 2))
    ratio = complex(np.vdot(drive, own)) / power
    left = np.abs(own - ratio * drive) ** 2
    covariance = responses.total_covariance if responses.total_covariance is not None else responses.noise_covariance
    if covariance is None:
        noise, excess = np.full(left.shape, float(np.sum(left)) / max(left.size - 1, 1)), 1.0
    else:
        both = covariance[around][:, [1, row]][:, :, [1, row]]
        turn = np.array([-ratio, 1.0])
        noise = np.einsum("i,kij,j->k", turn, both, turn.conj()).real
        expected = float(np.sum(noise)) * (1.0 - 1.0 / left.size)
        excess = max(1.0, float(np.sum(left)) / expected) if expected > 0.0 else 1.0
    # half of the complex error lies along the ratio
    return abs(ratio), math.sqrt(0.5 * excess * float(np.sum(np.abs(drive) ** 2 * noise))) / power


def _within_bandwidth(responses: FrequencyResponseMatrix, plant: PlantModel, part: float = 1.0) -> NDArray[np.bool_]:
    """Return which lines lie within this part of a bandwidth of the resonance, on either side; at least the next one."""
    hertz, frequency = plant.lock_frequency_rad_s() / (2.0 * math.pi), responses.frequency_hz
    half = max(2.0 * part * plant.damping_ratio * hertz, float(np.diff(frequency).max()))
    return np.asarray(np.abs(frequency - hertz) <= half)


def compared_with_bench(bench: Bench, plant: PlantModel) -> tuple[str, ...]:
    """Return the differences between the bench's facts and the measurement, one line each.

    Raises `TuningError` if the mode lies so far from the bench's linear frequency that it may be another one.
    """
    facts, out = bench.specimen, list[str]()
    measured_hz = plant.frequency_rad_s / (2.0 * math.pi)
    offset = facts.linear_frequency_hz / measured_hz - 1.0
    if abs(offset) > MAX_OFFSET:
        raise TuningError(
            f"the mode that answers lies at {measured_hz:.4g} Hz, the bench is {100.0 * offset:+.1f} % off",
            field="specimen.linear_frequency_hz",
            value=facts.linear_frequency_hz,
            allowed=f"{100.0 * MAX_OFFSET:g} %",
            hint="correct the bench, or see whether it is another mode",
        )
    if abs(offset) > MIN_NOTED_HZ:
        out.append(
            f"specimen.linear_frequency_hz = {facts.linear_frequency_hz:g} Hz is {100.0 * offset:+.2f} % off the measured "
            f"{measured_hz:.5g} Hz"
        )
    if facts.drive_mode_shape is None:
        out.append(
            f"specimen.drive_mode_shape: the bench has none, measured is {plant.drive_shape:.4g} kg^-1/2: the plan uses it, "
            "for control and for damping"
        )
        return tuple(out)
    ratio = abs(facts.drive_mode_shape) / plant.drive_shape
    if abs(ratio - 1.0) > MIN_NOTED_SHAPE:
        text = (
            f"specimen.drive_mode_shape = {facts.drive_mode_shape:g} kg^-1/2 of the bench is {ratio:.2f} times the measured "
            f"{plant.drive_shape:.4g}: the plan uses the measured one, for control and for damping; with the bench's the "
            f"damping would come out {ratio**2:.2f} times as large"
        )
        if max(ratio, 1.0 / ratio) > MAX_SHAPE_FACTOR:
            text += f"; a frequency-error loop tolerates a factor of {MAX_SHAPE_FACTOR:g}"
        out.append(text)
    return tuple(out)


def largest_outside(
    responses: FrequencyResponseMatrix, plant: PlantModel, gains: Sequence[complex] | Complex
) -> tuple[float, float]:
    """Largest magnitude of ``gains`` [n lines] outside the band of the plant model, and its frequency (Hz); 0 if none."""
    frequency = responses.frequency_hz
    outside = (frequency < plant.band_hz[0]) | (frequency > plant.band_hz[1])
    if not outside.any():
        return 0.0, 0.0
    size = np.where(outside, np.abs(np.asarray(gains)), 0.0)
    index = int(np.argmax(size))
    return float(size[index]), float(frequency[index])


def mass_ratios(bench: Bench, responses: FrequencyResponseMatrix, plant: PlantModel) -> tuple[float, float]:
    """Smallest and largest mass ratio mu from the fits to this band and to all measured lines.

    Near one mode the exciter's moving mass is hard to separate from its spring: if the two ratios differ, mu is not identified.
    """
    try:
        wide = PlantModel.from_frequency_responses(
            responses.frequency_hz,
            responses.value[:, 0, 0],
            responses.value[:, 1, 0],
            sample_rate_hz=bench.sample_rate_hz,
            latency_samples=plant.latency_samples,
        ).mass_ratio
    except ValueError:
        wide = plant.mass_ratio
    return min(wide, plant.mass_ratio), max(wide, plant.mass_ratio)
