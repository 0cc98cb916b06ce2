"""Backbones from free decays.

A mode that vibrates freely passes all its amplitudes by itself, and at each of them its frequency and its rate of decay are
those of the backbone. `identification.decays.local_fits` has the equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER, Channel
from identification.decays.demodulation import Demodulated, demodulated, noise_variance, windowed
from identification.decays.extent import beginning_s, fallen, reached_floor
from identification.decays.levels import LevelFits, fitted_levels
from identification.decays.local_fits import Series
from identification.decays.result import DecayBackbone, DecayMode
from identification.decays.separation import Candidate, separated
from identification.decays.with_force import decay_with_force
from identification.errors import IdentificationError
from identification.slow_flows.slow_flow import slow_flow
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float

_MIN_SAMPLES_PER_PERIOD = 8.0
"""Fewest samples in the shortest period. Chosen: harmonics up to the third stay below half the rate."""
_FEWEST_INSTANTS = 20
"""Fewest demodulated instants of a decay. Chosen."""
_FEWEST_SAMPLES = 64
"""Fewest samples of a record. Chosen."""


def decay_backbone(
    samples: ArrayLike,
    channels: Sequence[Channel],
    *,
    sample_rate_hz: float,
    near_hz: float | Sequence[float] | None = None,
    start_s: float | None = None,
    stop_s: float | None = None,
    number: int = 15,
    harmonics: int = 7,
    drive_mode_shape: float | None = None,
    residual_m_n: float = 0.0,
    specimen: str = "",
) -> DecayBackbone:
    """Identify modal frequency and damping over the amplitude from a free decay.

    Returns one mode for each frequency. All channels of the kind of motion of the reference (the drive point, or the
    channel with the least noise) contribute to the rates, weighted by their noise.

    Raises `IdentificationError` if values are NaN or infinite, shapes differ, there is no motion, a named mode is not
    found or cannot be told from a neighbour or from a harmonic of another mode, or the decay is too short.

    Parameters
    ----------
    samples
        float[n_channels, n], in the unit of each channel, SI.
    channels
        The channels, one per row of ``samples``: at least one motion (role ``drive`` or ``response``). A ``force`` channel
        tells where the free decay begins; monitors have no effect.
    sample_rate_hz
        Samples per second, at least eight per period.
    near_hz
        Frequencies of the modes, Hz, to within a quarter. Default: all that stand out in the spectrum.
    start_s, stop_s
        Where the free decay begins and ends, s from the first sample. Default: it begins where the force ends, or else where
        the vibration begins to fall, and ends at the noise or with the record.
    number
        Number of levels per mode, in equal ratios of the amplitude.
    harmonics
        Highest harmonic of the displacement in the result.
    drive_mode_shape
        Mass-normalised mode shape at the drive point, kg^-1/2, if one mode is evaluated. Needed for modal amplitudes, and
        to take out a force that acts during the decay, as that of an exciter (`identification.decays.with_force`).
    residual_m_n
        Receptance of all other modes at the drive point, m/N, where a force is taken out; see `identification.slow_flow`.
    specimen
        Name of what was tested.
    """
    channels = tuple(channels)
    data = finite_array("samples", samples, np.float64, 2)
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    near = None if near_hz is None else [positive("near_hz", one, "Hz") for one in np.atleast_1d(near_hz)]
    _check(data, channels, number, harmonics, drive_mode_shape)
    motions = [row for row, channel in enumerate(channels) if channel.role in ("drive", "response")]
    force = next((row for row, channel in enumerate(channels) if channel.role == "force"), None)
    begin_s, certain = beginning_s(data, motions, force, rate_hz, start_s)
    last = data.shape[1] if stop_s is None else min(data.shape[1], round(positive("stop_s", stop_s, "s") * rate_hz))
    part = data[:, round(begin_s * rate_hz) : last]
    if part.shape[1] < _FEWEST_SAMPLES:
        reason = f"{part.shape[1]} samples from {begin_s:g} s on, where the decay begins, to its end"
        raise IdentificationError(reason, field="start_s, stop_s", allowed=f"{_FEWEST_SAMPLES} at least")
    candidates, notes = separated(part[motions], rate_hz, near)
    if drive_mode_shape is not None and len(candidates) > 1:
        raise IdentificationError(
            f"is that of one mode, the decay has {len(candidates)}; name one by `near_hz`", field="drive_mode_shape"
        )
    record = _Record(part, channels, motions, force, rate_hz, begin_s, certain)
    if force is not None and drive_mode_shape is not None:
        modes = [_without_exciter(record, candidates[0], number, harmonics, drive_mode_shape, residual_m_n)]
    else:
        modes = [_mode(record, candidate, number, harmonics, drive_mode_shape) for candidate in candidates]
        modes.sort(key=lambda mode: float(mode.modal_frequency_hz[-1]))
    return DecayBackbone(
        modes=tuple(modes),
        channels=channels,
        specimen=specimen,
        notes=(*notes, *(_left_force(modes) if drive_mode_shape is None else ())),
    )


def _check(data: Float, channels: tuple[Channel, ...], number: int, harmonics: int, shape: float | None) -> None:
    if data.shape[0] != len(channels):
        reason = f"shape {data.shape} for {len(channels)} channels"
        raise IdentificationError(reason, field="samples", allowed="one row per channel")
    if not any(channel.role in ("drive", "response") for channel in channels):
        reason = "none is a motion (role drive or response), a decay needs at least one"
        raise IdentificationError(reason, field="channels")
    for name, value in (("number", number), ("harmonics", harmonics)):
        IdentificationError.unless_at_least(name, value, 1)
    if shape is not None and not (np.isfinite(shape) and shape):
        raise IdentificationError(field="drive_mode_shape", value=shape, allowed="finite and not zero")


@dataclass(frozen=True, eq=False)
class _Record:
    """A decay from its beginning on."""

    data: Float
    channels: tuple[Channel, ...]
    motions: list[int]
    force: int | None
    rate_hz: float
    begin_s: float
    certain: bool

    def order(self, row: int) -> int:
        """How often the signal of a row is differentiated against the displacement."""
        return MOTION_ORDER[self.channels[row].motion]


def _mode(record: _Record, candidate: Candidate, number: int, harmonics: int, shape: float | None) -> DecayMode:
    theta, periods = candidate.track.theta_rad, candidate.periods
    fastest = float(np.max(np.diff(theta)))
    if 2.0 * np.pi / fastest < _MIN_SAMPLES_PER_PERIOD:
        reason = f"{2.0 * np.pi / fastest:.2f} samples per period of the mode at {candidate.track.start_hz:.4g} Hz"
        raise IdentificationError(reason, field="samples", allowed=f"at least {_MIN_SAMPLES_PER_PERIOD:g}")
    found = demodulated(theta, record.data, record.rate_hz, periods)
    variance = noise_variance(theta, record.data, periods)
    reference = _reference(record, found.values, variance)
    rows = [row for row in record.motions if record.order(row) == record.order(reference)]
    mixed, noise = _combined(found.values[rows], variance[rows], rows.index(reference))
    start = 0 if record.certain else fallen(np.abs(mixed))
    stop = start + reached_floor(np.abs(mixed[start:]), float(np.sqrt(noise)))
    if stop - start < _FEWEST_INSTANTS:
        lasting = max(0, stop - start) * periods // 2
        raise IdentificationError(
            f"the mode at {candidate.track.start_hz:.4g} Hz is above the noise for {lasting} periods of its "
            f"decay, beside the window of {4 * periods}",
            field="samples",
            allowed=f"at least {_FEWEST_INSTANTS * periods // 2}",
        )
    kept = slice(start, stop)
    seen = Demodulated(
        found.at_s[kept],
        found.theta_rad[kept],
        found.values[:, kept],
        periods,
        found.spread_s[kept],
        found.turning[kept],
    )
    series = Series(seen, mixed[kept], noise / np.abs(mixed[kept]) ** 2)
    displacement = mixed[kept] / (1j * seen.turning) ** record.order(reference)
    force = np.zeros(stop - start, np.complex128) if record.force is None else seen.values[record.force]
    fits = fitted_levels(series, number, record.order(reference))
    deflection = np.full((fits.time_s.size, len(record.channels)), complex(np.nan, np.nan))
    for row in record.motions:
        ratio = fits.local(series, seen.values[row] / mixed[kept])
        deflection[:, row] = ratio * fits.rate ** (record.order(reference) - record.order(row))
    amplitude = np.exp(fits.log.real) * np.abs(deflection[:, reference])
    omega = np.sqrt(np.where(fits.stiffness > 0.0, fits.stiffness, np.nan))
    return DecayMode(
        amplitude_m=amplitude,
        amplitude_std_m=amplitude * fits.log_std,
        time_s=record.begin_s + fits.time_s,
        frequency_hz=fits.rate.imag / (2.0 * np.pi),
        modal_frequency_hz=omega / (2.0 * np.pi),
        modal_frequency_std_hz=fits.stiffness_std / (4.0 * np.pi * omega),
        modal_frequency_systematic_hz=fits.stiffness_bound / (4.0 * np.pi * omega),
        damping_ratio=0.5 * fits.damping / omega,
        damping_ratio_std=0.5 * fits.damping_std / omega,
        damping_ratio_systematic=0.5 * fits.damping_bound / omega,
        decay_ratio=-fits.rate.real / omega,
        deflection=deflection / deflection[:, [reference]],
        harmonics_m=_harmonics(record, reference, theta, fits, series, harmonics) * amplitude[:, None],
        force_n=fits.local(series, force / displacement) * amplitude,
        reference=record.channels[reference].name,
        start_s=record.begin_s + float(seen.at_s[0]),
        stop_s=record.begin_s + float(seen.at_s[-1]),
        floor_m=float(np.sqrt(noise) / seen.turning[-1] ** record.order(reference)),
        drive_mode_shape=shape,
    )


def _without_exciter(
    record: _Record, candidate: Candidate, number: int, harmonics: int, shape: float, residual_m_n: float
) -> DecayMode:
    """Evaluate a mode with the measured force as its input; times are those of the record."""
    highest = int(np.pi / float(np.max(np.diff(candidate.track.theta_rad)))) - 2
    flow = slow_flow(
        candidate.track.theta_rad,
        record.data,
        record.channels,
        sample_rate_hz=record.rate_hz,
        drive_mode_shape=shape,
        harmonics=max(1, min(harmonics, highest)),
        residual_m_n=residual_m_n,
    )
    mode = decay_with_force(flow, start_s=0.0, number=number)
    return replace(
        mode,
        time_s=record.begin_s + mode.time_s,
        start_s=record.begin_s + mode.start_s,
        stop_s=record.begin_s + mode.stop_s,
    )


def _reference(record: _Record, values: Complex, variance: Float) -> int:
    """Row of the drive point; without one, of the motion that stands out of the noise the most."""
    for row in record.motions:
        if record.channels[row].role == "drive":
            return row
    quiet = np.sqrt(np.maximum(variance[record.motions], np.finfo(float).tiny))
    return record.motions[int(np.argmax(np.abs(values[record.motions]).max(axis=1) / quiet))]


def _combined(values: Complex, variance: Float, reference: int) -> tuple[Complex, float]:
    """Return the sum of channels with the least noise that equals the reference, and the variance of its noise."""
    power = np.abs(values[reference]) ** 2
    shape = values @ np.conj(values[reference]) / power.sum()
    floor = np.maximum(variance, np.max(variance) * 1e-6)
    floor = np.where(floor > 0.0, floor, 1.0)
    weight = np.conj(shape) / floor
    scale = float(np.sum(np.abs(shape) ** 2 / floor))
    return np.asarray(weight @ values / scale), float(np.sum(np.abs(weight) ** 2 * variance)) / scale**2


def _harmonics(
    record: _Record, reference: int, theta: Float, fits: LevelFits, series: Series, harmonics: int
) -> Complex:
    """complex[n, H + 1]: harmonics of the displacement of the reference over its fundamental, which has the phase zero."""
    at = np.interp(fits.time_s, series.seen.at_s, series.seen.theta_rad)
    order, highest = record.order(reference), int(0.4 * 2.0 * np.pi / float(np.max(np.diff(theta))))
    signal = record.data[[reference]]
    first = windowed(theta, signal, at, series.seen.periods, 1.0)[0]
    out = np.full((at.size, harmonics + 1), complex(np.nan, np.nan))
    for harmonic in range(min(harmonics, highest) + 1):
        value = windowed(theta, signal, at, series.seen.periods, float(harmonic))[0]
        turned = value * np.exp(-1j * harmonic * np.angle(first)) / np.abs(first)
        if harmonic:
            out[:, harmonic] = turned / harmonic**order * (1j**order) ** (harmonic - 1)
        elif order == 0:
            out[:, 0] = 0.5 * turned
    return out


def _left_force(modes: Sequence[DecayMode]) -> list[str]:
    notes = []
    for mode in modes:
        largest = float(np.max(np.abs(mode.force_n)))
        if largest > 0.0 and np.all(np.diff(np.abs(mode.force_n)) < 0.0):
            notes.append(
                f"a force of {largest:.3g} N acts on the mode at {mode.modal_frequency_hz[-1]:.4g} Hz while it decays: its "
                "stiffness and damping are in the result; with `drive_mode_shape` they are taken out"
            )
    return notes
