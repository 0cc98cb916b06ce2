"""Hammer test: from records of force and motions to frequency responses with their errors, hit by hit.

Every hit that counts is one record of the mean. With Y_r and F_r the transforms of motion and force of the hit r, after the
windows, ``H1 = sum Y F* / sum |F|^2``, ``H2 = sum |Y|^2 / sum F Y*``, and Hv is their geometric mean (`multisine.estimators`).
The coherence is ``|sum Y F*|^2 / (sum |F|^2 sum |Y|^2)``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.channels import Channel, find_role
from identification.errors import IdentificationError
from identification.hammer.blocks import Block, blocks_of
from identification.hammer.result import HammerTest
from identification.hammer.windows import decay_rate, exponential_window, force_window
from identification.multisine.estimators import Estimator, estimated_responses
from identification.validation import finite_array, positive
from vibrolock.arrays import Complex, Float

_WEAKEST = 0.1
"""The band ends where the force's spectrum falls below this share of its largest line (20 dB)."""
_HIGHEST = 0.8
"""Highest line relative to half the sample rate; filters are not flat above."""
_FIRST_LINES = 2
"""Lines from 0 Hz on that are left out where no band is given: sensors with AC coupling are wrong there. Chosen."""


def hammer_test(
    records: Sequence[ArrayLike],
    channels: Sequence[Channel],
    sample_rate_hz: float,
    *,
    record_s: float | None = None,
    pretrigger_s: float | None = None,
    trigger_n: float | None = None,
    force_window_s: float | None = None,
    decay_rate_1_s: float | None = None,
    full_scale: Mapping[str, float] | None = None,
    estimator: Estimator = "H1",
    lowest_hz: float | None = None,
    highest_hz: float | None = None,
    specimen: str = "",
) -> HammerTest:
    """Evaluate a hammer test: find the hits, leave out the faulty ones, apply windows, estimate frequency responses.

    Raises `IdentificationError` if there is no hit or fewer than two hits count, lines are missing, or a value is out
    of its range.

    Parameters
    ----------
    records
        Records of one place of the hammer, float[n_channels, n], SI; each with one hit or several.
    channels
        One of role ``force``, and the motions; for modes one of them of role ``drive``, where the hammer hits.
    sample_rate_hz
        Samples per second.
    record_s
        Length of the record of a hit, from ``pretrigger_s`` before it; None: as long as the hits and the ends of the records
        allow.
    pretrigger_s
        Length before the hit; None: a twentieth of the record, less if the record begins later.
    trigger_n
        Force that makes a hit; None: a tenth of the largest, and above the noise.
    force_window_s
        Length of the force window from the beginning of the pulse; None: five times the duration of the pulse.
    decay_rate_1_s
        Rate a of the exponential window ``exp(-a t)`` over force and motions; None: as high as the motions need to end within
        the record, 0 if they do; 0: none. It is known to `linear_modes`, whose damping ratios do not contain it.
    full_scale
        Full scale of channels by name, SI; without it an overload is found if its samples are equal.
    estimator
        ``H1`` (noise in the motions), ``H2`` (noise in the force) or ``Hv`` (both).
    lowest_hz, highest_hz
        Band of the lines; None: from the second line to where the spectrum of the force has fallen by 20 dB.
    specimen
        Name for the result.
    """
    channels, rate = tuple(channels), positive("sample_rate_hz", sample_rate_hz, "Hz")
    force = find_role(channels, "force")
    full_scale = dict(full_scale or {})
    _check(channels, full_scale, estimator)
    for name, length, unit in (
        ("record_s", record_s, "s"),
        ("trigger_n", trigger_n, "N"),
        ("force_window_s", force_window_s, "s"),
    ):
        if length is not None:
            positive(name, length, unit)
    for name, value in (("decay_rate_1_s", decay_rate_1_s), ("pretrigger_s", pretrigger_s)):
        if value is not None and not 0.0 <= value < np.inf:
            raise IdentificationError(field=name, value=value, allowed="finite, 0 or above")
    data = [finite_array(f"records[{i}]", record, np.float64, 2) for i, record in enumerate(records)]
    for i, record in enumerate(data):
        if record.shape[0] != len(channels) or record.shape[1] < 16:
            reason = f"shape {record.shape}"
            raise IdentificationError(reason, field=f"records[{i}]", allowed=f"{len(channels)} channels by samples")
    IdentificationError.raise_if(not data, "is empty", field="records", allowed="at least one")
    blocks = blocks_of(data, channels, rate, record_s, pretrigger_s, trigger_n, full_scale)
    used = [block for block in blocks if not block.hit.fault]
    if len(used) < 2:
        faults = "; ".join(f"{block.hit.label}: {block.hit.fault}" for block in blocks if block.hit.fault)
        reason = f"{len(used)} of {len(blocks)} count"
        raise IdentificationError(reason, field="hits", allowed=f"two at least ({faults or 'no faults'})")
    values = np.array([block.samples for block in used])
    motions = [row for row, channel in enumerate(channels) if channel.role in ("drive", "response")]
    if decay_rate_1_s is None:
        noise = np.mean([block.noise_rms[motions] for block in used], axis=0)
        decay_rate_1_s = decay_rate(values[:, motions, used[0].before :], noise, rate)
    length = None if force_window_s is None else max(round(force_window_s * rate), 1)
    values[:, force] *= [force_window(values.shape[-1], block.pulse, length) for block in used]
    values *= exponential_window(values.shape[-1], decay_rate_1_s, rate)
    frequency_hz = np.asarray(np.fft.rfftfreq(values.shape[-1], 1.0 / rate), dtype=np.float64)
    spectra = np.fft.rfft(values, axis=-1) / rate
    lines = _band(frequency_hz, np.sqrt(np.mean(np.abs(spectra[:, force]) ** 2, axis=0)), rate, lowest_hz, highest_hz)
    return _evaluated(
        channels, frequency_hz[lines], spectra[..., lines], blocks, estimator, decay_rate_1_s, specimen, rate
    )


def _check(channels: tuple[Channel, ...], full_scale: Mapping[str, float], estimator: str) -> None:
    IdentificationError.unless_one_of("estimator", estimator, ("H1", "H2", "Hv"))
    known = [channel.name for channel in channels]
    for name, value in full_scale.items():
        if name not in known:
            raise IdentificationError(f"'{name}' is none of the channels {', '.join(known)}", field="full_scale")
        positive(f"full_scale of {name}", value)


def _band(
    frequency_hz: Float, force: Float, rate: float, lowest_hz: float | None, highest_hz: float | None
) -> NDArray[np.bool_]:
    """bool[n]: the lines of the band, none at 0 Hz; its ends follow from the force's spectrum if they are not given."""
    top = _HIGHEST * 0.5 * rate
    weak = np.flatnonzero((force < _WEAKEST * np.max(force)) & (frequency_hz > frequency_hz[int(np.argmax(force))]))
    if highest_hz is None:
        highest_hz = min(top, float(frequency_hz[weak[0]])) if weak.size else top
    lowest_hz = float(frequency_hz[min(_FIRST_LINES, frequency_hz.size - 1)]) if lowest_hz is None else lowest_hz
    lines = (frequency_hz >= lowest_hz) & (frequency_hz <= highest_hz) & (frequency_hz > 0.0)
    if np.count_nonzero(lines) < 3:
        reason = (
            f"{np.count_nonzero(lines)} lines in {lowest_hz:g} to {highest_hz:g} Hz, which are "
            f"{frequency_hz[1]:.3g} Hz apart"
        )
        raise IdentificationError(reason, field="lowest_hz, highest_hz", allowed="3 at least")
    return np.asarray(lines)


def _evaluated(
    channels: tuple[Channel, ...],
    frequency_hz: Float,
    spectra: Complex,
    blocks: Sequence[Block],
    estimator: Estimator,
    decay_rate_1_s: float,
    specimen: str,
    rate: float,
) -> HammerTest:
    found = estimated_responses(
        channels,
        frequency_hz,
        spectra[:, None],
        outputs=None,
        inputs=None,
        estimator=estimator,
        instruments=(),
        keep_deviations=True,
    )
    force = spectra[:, find_role(channels, "force")]
    motions = spectra[:, [channels.index(channel) for channel in found.outputs]]
    cross = np.abs(np.sum(motions * np.conj(force)[:, None], axis=0)) ** 2
    power = np.sum(np.abs(force) ** 2, axis=0) * np.sum(np.abs(motions) ** 2, axis=0)
    left_out = [f"hit {block.hit.label} left out: {block.hit.fault}" for block in blocks if block.hit.fault]
    if decay_rate_1_s:
        left_out.append(
            f"exponential window of {decay_rate_1_s:.4g} 1/s: the peaks are lower than those of the structure, modes are not"
        )
    notes = [note for note in found.notes if "covariance" not in note]
    return HammerTest(
        channels=channels,
        sample_rate_hz=rate,
        record_s=blocks[0].samples.shape[-1] / rate,
        hits=tuple(block.hit for block in blocks),
        responses=replace(found, decay_rate_1_s=decay_rate_1_s, specimen=specimen, notes=(*left_out, *notes)),
        coherence=np.clip(cross / np.maximum(power, 1e-300), 0.0, 1.0).T,
        force_n_s=np.sqrt(np.mean(np.abs(force) ** 2, axis=0)),
    )
