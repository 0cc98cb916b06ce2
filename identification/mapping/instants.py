"""Instants as files hold them, rounded in print or in single precision, and the even sampling that they agree with."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Float

_UNEVEN = 1e-3
"""Largest relative difference of a step from the mean up to which instants that are not rounded are even: jitter of clocks."""
_ULPS = 4.0  # errors of the last bit in an instant that was computed; chosen
_FEW = 16
"""Instants below which a rounding may be `_FINE` of a step: a few agree with some even grid by chance; chosen."""
_FIRST = 64  # numbers that are looked at before all the others
_FINE = 0.1
_MOST_LAST = 10  # instants at the end that may be something else, such as largest and mean values; chosen
_DIGITS = range(1, 16)  # digits of rates and steps that are tried, the roundest first
_DECIMALS = range(-3, 13)  # decimals of print that are tried
_SIGNIFICANT = range(3, 13)  # significant digits of print that are tried


@dataclass(frozen=True)
class EvenSampling:
    """Sampling that instants agree with."""

    rate_hz: float
    """Sample rate."""
    start_s: float
    """First instant."""
    rounded_s: float = 0.0
    """Largest error of an instant by rounding in print or in single precision; 0 if there is none."""


def even_sampling(instants: NDArray[Any], seconds: float = 1.0, wanted_hz: float | None = None) -> EvenSampling | None:
    """Return the even sampling with which instants agree within half a digit of print or of their type; None for uneven ones.

    Of the rates that agree, ``wanted_hz`` is taken, or else the one whose rate or step has the fewest digits.

    Parameters
    ----------
    instants
        float[n] from 2, in any unit of time.
    seconds
        Seconds in that unit.
    wanted_hz
        Rate that is told elsewhere, Hz.
    """
    t = np.asarray(instants, np.float64)
    if t.ndim != 1 or t.size < 2 or not np.all(np.isfinite(t)) or not t[-1] > t[0]:
        return None
    single = np.asarray(instants).dtype.itemsize <= 4 and np.asarray(instants).dtype.kind == "f"
    for half, rounded in _half_digits(t, single=single):
        if found := _grid(t, half, seconds, wanted_hz):
            return EvenSampling(*found, float(half.max()) * seconds if rounded else 0.0)
    steps = np.diff(t)
    mean = float(t[-1] - t[0]) / steps.size
    if np.any(np.abs(steps - mean) > _UNEVEN * mean):
        return None
    return EvenSampling(1.0 / (mean * seconds), float(t[0]) * seconds)


def uneven_remark(instants: NDArray[Any]) -> str:
    """Return in words why instants give no sample rate, and what to do."""
    t = np.asarray(instants, np.float64)
    if t.size < 2:
        return f"has {t.size} instants, two at least are needed"
    if not np.all(np.isfinite(t)):
        at = int(np.argmin(np.isfinite(t)))
        return f"instant [{at}] is {t[at]}; cut the file there, or give sample_rate_hz in place of time"
    steps = np.diff(t)
    usual = float(np.median(steps))
    at = int(np.argmax(np.abs(steps - usual)))
    where = f"from [{at}] to [{at + 1}] it steps by {steps[at]:.6g}, usually by {usual:.6g}"
    if (after := t.size - 1 - at) <= _MOST_LAST < at:
        csv = f"csv = {{ skip_last_lines = {after} }}"
        return f"goes on otherwise at its end ({where}); leave out the last {after}, of a CSV file by `{csv}`"
    if usual <= 0.0:
        return f"does not increase ({where}); give sample_rate_hz in place of time"
    gaps = np.mean(np.abs(steps - usual) > 0.5 * usual)
    gap = "cut the record there" if 0.0 < gaps < 0.01 else "resample the signals"
    return f"is not evenly spaced ({where}); {gap}, or give sample_rate_hz in place of time"


def _half_digits(t: Float, *, single: bool) -> Iterator[tuple[Float, bool]]:
    """Yield the errors that each instant may have, the smallest first, and whether they are from rounding."""
    spacing = 0.51 * np.spacing(np.abs(t).astype(np.float32)).astype(np.float64)
    if single:
        yield spacing, True
        return
    yield np.full(t.size, _ULPS * np.spacing(float(np.abs(t).max()))), False
    if bool(np.all(t == t.astype(np.float32))):
        yield spacing, True
    for decimals in _DECIMALS:
        if _is_whole(t[:_FIRST] * 10.0**decimals) and _is_whole(t * 10.0**decimals):
            yield np.full(t.size, 0.5001 * 10.0**-decimals), True
            break
    powers = np.floor(np.log10(np.abs(np.where(t == 0.0, 1.0, t))))
    for digits in _SIGNIFICANT:
        quantum = 10.0 ** (powers - digits + 1)
        if _is_whole(t[:_FIRST] / quantum[:_FIRST]) and _is_whole(t / quantum):
            yield 0.5001 * quantum, True
            break


def _is_whole(x: Float) -> bool:
    """Return whether all numbers are whole, as far as doubles of their size can tell, and doubles can tell."""
    if float(np.abs(x).max()) > 2.0**50:
        return False
    return bool(np.all(np.abs(x - np.round(x)) <= _ULPS * np.spacing(np.abs(x) + 1.0)))


def _grid(t: Float, half: Float, seconds: float, wanted_hz: float | None) -> tuple[float, float] | None:
    """Return rate (Hz) and first instant (s) of a grid from which no instant is further than its ``half``; None without one."""
    origin, n = t[0], t.size - 1
    low, high, numbers = t - origin - half, t - origin + half, np.arange(t.size, dtype=np.float64)
    least, most = float(low[-1] - high[0]) / n, float(high[-1] - low[0]) / n
    if 2.0 * float(half.max()) > (t[-1] - origin) / n * (_FINE if t.size < _FEW else 1.0):
        return None  # as coarse as the steps: anything would agree
    steps, room = np.diff(t), half[1:] + half[:-1]
    if float(np.min(steps + room)) < least or float(np.max(steps - room)) > most:
        return None

    def at(step: float) -> tuple[float, float, int]:
        """Return the range of first instants with which a step agrees, empty if it does not, and where steps are off."""
        lowest, highest = low - numbers * step, high - numbers * step
        late, early = int(np.argmax(lowest)), int(np.argmin(highest))
        return float(lowest[late]), float(highest[early]), late - early

    below, above = least, most
    while True:  # what is missing is a convex function of the step: its slope tells on which side the step lies
        step = (below + above) / 2.0
        first, last, off = at(step)
        if first <= last:
            break
        if (above - below) * n < 0.01 * float(half.min()) or not below < step < above:
            return None
        below, above = (step, above) if off > 0 else (below, step)
    for candidate in _round_steps(step, seconds, wanted_hz):
        if least <= candidate <= most:
            begins, ends, _ = at(candidate)
            if begins <= ends:
                step, first, last = candidate, begins, ends
                break
    start = float(origin) if first <= 0.0 <= last else float(origin) + (first + last) / 2.0
    rate = 1.0 / (step * seconds)
    return next((r for r in _round_rates(rate) if abs(r / rate - 1.0) < 1e-15), rate), start * seconds


def _round_rates(rate_hz: float) -> Iterator[float]:
    return (float(f"{rate_hz:.{digits}g}") for digits in _DIGITS)


def _round_steps(step: float, seconds: float, wanted_hz: float | None) -> Iterator[float]:
    """Yield the steps near one, those with the roundest rate or step first."""
    if wanted_hz is not None:
        yield 1.0 / (wanted_hz * seconds)
    for digits in _DIGITS:
        yield 1.0 / (float(f"{1.0 / (step * seconds):.{digits}g}") * seconds)
        yield float(f"{step:.{digits}g}")
