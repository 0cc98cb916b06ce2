"""Why a hit does not count: double hits, overloads, a structure that still moved, records that end too early."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from identification.channels import Channel
from identification.hammer.hits import Pulse, noise_rms
from vibrolock.arrays import Float

_SECOND = 0.03
"""Least height of a second pulse, relative to the first."""
_NOISE = 6.0
"""Least height of a second pulse in standard deviations of the noise of the filtered force."""
_LEAST, _VALLEY = 0.1, 0.5
"""A further top within a pulse is a hit if it has this share of the highest, and the valley beside it that share of its own."""
_FULL = 0.995
"""Share of its full scale from which a channel is overloaded."""
_FLAT = 3
"""Number of equal samples at the extreme value that clipping leaves."""
_EXACT, _DISTINCT = 1e-5, 0.99
"""Two equal extremes are no coincidence in numbers with steps below this share of them, or of which nearly all are distinct."""
_STEEP = 4.0
"""Clipped samples are reached by a step of more than this many steps of the converter."""


def double_hit(force: Float, pulse: Pulse, others: Sequence[Pulse], noise_n: float, sample_rate_hz: float) -> str:
    """Return what shows that the hammer touched the structure more than once; empty if it touched once.

    ``force`` is the whole block of the hit, to which the numbers of samples in ``pulse`` refer. Pulses that rise above the
    trigger level are known as ``others``. Smaller ones are looked for after the pulse, with the force averaged over half its
    width, so that a filter's ringing, which changes sign within that time, is not mistaken for one.
    """
    if others:
        return _said(others[0].height_n, others[0].peak - pulse.peak, pulse, sample_rate_hz)
    width = max(pulse.width, 3)
    within = np.pad(force[pulse.first : pulse.end], 1)
    tops, found = scipy.signal.find_peaks(
        within, height=max(_LEAST * pulse.height_n, 2.0 * _NOISE * noise_n), prominence=0.0
    )
    apart = tops[found["prominences"] >= _VALLEY * found["peak_heights"]] - 1 + pulse.first - pulse.peak
    if np.any(apart != 0) and apart.size > 1:
        second = int(apart[apart != 0][0])
        return _said(float(force[pulse.peak + second]), second, pulse, sample_rate_hz)
    taps = max(width // 2, 2)
    after = pulse.end + width // 2
    if force.size - after < 2 * taps:
        return ""
    mean = np.convolve(force[after:], np.full(taps, 1.0 / taps), mode="same")
    second = int(np.argmax(mean))
    floor = _NOISE * max(noise_n / np.sqrt(taps), noise_rms(mean))
    if mean[second] <= max(_SECOND * pulse.height_n, floor):
        return ""
    return _said(
        float(np.max(force[after:][max(second - taps, 0) : second + taps])),
        after + second - pulse.peak,
        pulse,
        sample_rate_hz,
    )


def _said(height_n: float, apart: int, pulse: Pulse, sample_rate_hz: float) -> str:
    share = 100.0 * height_n / pulse.height_n
    when = f"{1e3 * abs(apart) / sample_rate_hz:.3g} ms {'later' if apart > 0 else 'before'}"
    return f"double hit: another one of {height_n:.3g} N ({share:.2g} %) {when}"


def overloaded(block: Float, channels: Sequence[Channel], full_scale: Mapping[str, float]) -> str:
    """Return which channel of float[n_channels, n] reached its full scale, or was clipped; empty if none.

    Without a full scale, a single clipped sample cannot be told. Clipping shows by `_FLAT` equal samples or more at the highest
    or lowest value, which are reached by a step that is far above the steps of the converter, or by two in numbers that are not
    rounded to such steps. A slow peak of coarse numbers is flat too, but is reached by single steps.
    """
    for channel, values in zip(channels, block, strict=True):
        largest = float(np.max(np.abs(values)))
        if channel.name in full_scale:
            if largest >= _FULL * full_scale[channel.name]:
                return (
                    f"overload: {channel.name} reached {largest:.4g} of {full_scale[channel.name]:.4g} {channel.unit}"
                )
            continue
        for extreme in (float(values.max()), float(values.min())):
            if extreme and _clipped(values, extreme):
                return f"overload: {channel.name} stays at {extreme:.4g} {channel.unit}, it was clipped"
    return ""


def _clipped(values: Float, extreme: float) -> bool:
    steps = np.abs(np.diff(values))
    smallest = float(np.min(steps[steps > 0.0], initial=np.inf))
    fine = smallest < _EXACT * abs(extreme) or np.unique(values).size > _DISTINCT * values.size
    if fine and np.count_nonzero(np.abs(values) == abs(extreme)) > 1:
        return True
    at = np.concatenate([[False], values == extreme, [False]])
    first, after = np.flatnonzero(~at[:-1] & at[1:]), np.flatnonzero(at[:-1] & ~at[1:])
    long = after - first >= _FLAT
    into = [abs(extreme - values[i - 1]) for i in first[long] if i > 0]
    out = [abs(extreme - values[i]) for i in after[long] if i < values.size]
    return max([*into, *out], default=0.0) > _STEEP * smallest
