"""Guesses on the arrays of a file: roles and units by name, dimensions by their values, sample rates, periods.

Guesses are proposals. What names and numbers do not show is left open.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from identification import IdentificationError
from identification.mapping import even_sampling, si_of
from rig.exchange.spellings import is_time_name, rate_named
from vibrolock.arrays import Float
from vibrolock.quantities import says_a_unit, seconds_in

_RATES = re.compile(r"(sr|rate(_hz)?)$", re.IGNORECASE)  # names that may be rates, beside those that are
_STEPS = re.compile(r"t_?s$", re.IGNORECASE)
_FORCES = re.compile(r"(f|u|in|input|load)\d*$|.*(force|kraft|hammer|excit|impuls)", re.IGNORECASE)
_VOLTAGES = re.compile(r"(ref|dac)\d*$|.*(volt|generator|source|command)", re.IGNORECASE)
_MOTIONS = re.compile(r"[xyadv]\d*$|out|resp|.*(acc|beschl|vel|geschw|ldv|disp|defl|posit)", re.IGNORECASE)
_RAMP = 16  # samples from which even steps are those of a clock; chosen
_SAME_PERIOD = 0.02
"""Largest RMS difference of two periods relative to the signal."""
_NOISES = 3.0
"""Largest difference of a settled period, relative to that of the last two."""
_LIKE = 0.88
"""Least correlation of a signal with itself a period later."""
_LEVELS = 1.3
"""Least ratio of the RMS of two columns that are different levels."""
_EXCITED = 1e-2  # amplitude of an excited line, at least, over the strongest; chosen
_MOST_TRIED = 200
"""Most lags that are tried as a period."""


def rate_in(single: Mapping[str, float]) -> tuple[str, float] | None:
    """Return the path and the value (Hz) of a sample rate among single numbers, by their names; None if there is none."""
    last = {path: re.split(r"[./@]", path)[-1] for path in single}
    for path, value in single.items():
        if (rate := rate_named(last[path], value)) is not None:
            return path, rate
    for names, is_step in ((_RATES, False), (_STEPS, True)):
        for path, value in single.items():
            if names.match(last[path]) and 0.0 < value < np.inf:
                return path, 1.0 / value if is_step else value
    return None


def is_time(name: str, values: NDArray[np.generic], unit: str = "") -> bool:
    """Return whether an array is a vector of instants, evenly spaced or not.

    It never decreases, and its unit is one of time; or it has no unit, and a name of time, or even steps other than 1, which
    no signal has.
    """
    if values.ndim != 1 or values.size < 3 or values.dtype.kind not in "iuf":
        return False
    if says_a_unit(unit) and seconds_in(unit) is None:
        return False
    steps = np.diff(values.astype(np.float64))
    if not np.all(steps >= 0.0) or not np.any(steps > 0.0):
        return False
    if is_named_time(name, unit):
        return True
    return values.size >= _RAMP and not np.all(steps == 1.0) and even_sampling(values) is not None


def is_named_time(name: str, unit: str = "") -> bool:
    """Return whether a name or a unit tells that an array holds instants."""
    return seconds_in(unit) is not None or is_time_name(name)


def role_of(name: str, unit: str) -> tuple[str, str]:
    """Return role and unit of a channel by its name and the unit that the file tells.

    The role is ``motion`` for drive or response, ``monitor`` in a unit of anything else, and empty if it is unknown; the unit
    is ``1`` if it is unknown.
    """
    try:
        known = si_of(unit, name)[0] if unit else ""
    except IdentificationError:
        known = ""
    if known:
        role = {"N": "force", "m": "motion", "m/s": "motion", "m/s2": "motion", "V": "monitor"}.get(known, "")
        return role or role_of(name, "")[0], unit
    if says_a_unit(unit):
        return "monitor", unit  # pascals, for example: no force and no motion
    for pattern, role, assumed in (
        (_FORCES, "force", "1"),
        (_VOLTAGES, "monitor", "V"),
        (_MOTIONS, "motion", "1"),
    ):
        if pattern.match(name):
            return role, assumed
    return "", "1"


def dimensions(values: NDArray[np.generic], samples: int) -> tuple[str, ...]:
    """Return the meaning of each dimension of an array of a signal in which one has the length ``samples``.

    A dimension along which the last two entries are equal is ``period``, one along which the RMS differs ``level``, any other
    ``realisation``. If several would have one name, the further ones are ``channel``.
    """
    at = values.shape.index(samples)
    names = [""] * values.ndim
    names[at] = "sample"
    for axis in range(values.ndim):
        if axis != at:
            slices = np.moveaxis(values, (axis, at), (0, -1)).reshape(values.shape[axis], -1, samples)
            names[axis] = _meaning(slices.astype(np.float64), names)
    return tuple(names)


def _meaning(slices: Float, taken: Sequence[str]) -> str:
    """Return what float[n, m, samples] differ in along the first dimension."""
    size = float(np.sqrt(np.mean(slices[-1] ** 2)))
    rms = np.sqrt(np.mean(slices**2, axis=(1, 2)))
    if size > 0.0 and np.sqrt(np.mean((slices[-1] - slices[-2]) ** 2)) < _SAME_PERIOD * size:
        found = "period"
    else:
        found = "level" if rms.max() > _LEVELS * max(rms.min(), 1e-300) else "realisation"
    others = (name for name in ("realisation", "level", "channel") if name not in taken)
    return found if found not in taken else next(others)


def period_of(signal: Float) -> int:
    """Return the number of samples after which a signal repeats, at least twice in the record; 0 if it does not."""
    x = signal - signal.mean()
    n = x.size
    energy = float(np.sum(x**2))
    if n < 64 or not energy > 0.0:
        return 0
    size = scipy.fft.next_fast_len(2 * n)
    lags = scipy.fft.irfft(np.abs(scipy.fft.rfft(x, size)) ** 2, size)[: n // 2 + 1]
    likeness = lags / energy * (n / (n - np.arange(lags.size)))
    below = np.flatnonzero(likeness < 0.5)
    first = max(16, int(below[0]) if below.size else lags.size)
    inner = likeness[1:-1]
    peaks = 1 + np.flatnonzero((inner >= likeness[:-2]) & (inner > likeness[2:]) & (inner > _LIKE))
    tried = [int(peak) for peak in peaks if peak >= first][:_MOST_TRIED]
    for lag in [*tried, *([n // 2] if n % 2 == 0 else [])]:
        half = x[n // 2 - lag // 2 :] if lag <= n // 3 else x
        difference = half[lag:] - half[:-lag]
        if difference.size and np.mean(difference**2) < (_SAME_PERIOD**2) * energy / n:
            return int(lag)
    return 0


def transient_periods(periods: Float) -> int:
    """Return how many of float[n_periods, n_samples] come before those that equal the last one as the one before it does.

    At most half of them; 0 if there are fewer than three.
    """
    if len(periods) < 3:
        return 0
    off = np.sqrt(np.mean((periods - periods[-1]) ** 2, axis=1))
    noise = max(float(off[-2]), 1e-9 * float(np.std(periods[-1])))
    late: list[int] = np.flatnonzero(off > _NOISES * noise).tolist()
    return min(int(late[-1]) + 1 if late else 0, len(periods) // 2)


def band_of(period: Float, rate_hz: float) -> tuple[float, float] | None:
    """Return the lowest and highest frequency of a period with a hundredth of the strongest line; None without lines."""
    lines = np.abs(np.fft.rfft(period - period.mean()))[1 : (period.size + 1) // 2]
    if not lines.size or not lines.max() > 0.0:
        return None
    excited = 1 + np.flatnonzero(lines >= _EXCITED * lines.max())
    resolution = rate_hz / period.size
    low, high = float(excited[0] * resolution), float(excited[-1] * resolution)
    return (low, high) if low < high else None
