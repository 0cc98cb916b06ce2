"""What a file says of its sampling beside the instants that a mapping takes: sample rates by their names, further instants."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig.exchange.file_data import FileData, Value
from rig.exchange.spellings import is_time_name, number_in, rate_named, time_unit_in
from vibrolock.quantities import seconds_in

if TYPE_CHECKING:
    from identification.mapping import EvenSampling

_MAX_DEPTH = 8  # levels of structures that are examined; chosen


def rates_beside(data: FileData, paths: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the sample rates (Hz) beside the values at the paths, or above them, by path; and their relative rounding.

    They are single numbers with a name of a rate or a step, ``fs`` or ``dt``.
    """
    taken = [path.replace("/", ".") for path in paths]
    found: dict[str, tuple[float, float]] = {}
    for path, value in _single(data.values, "", 0):
        above, _, name = path.replace("@", ".").rpartition(".")
        rate = rate_named(name, value)
        if rate is not None and any(
            not above or one == above or one.startswith((f"{above}.", f"{above}[")) for one in taken
        ):
            found[path] = rate, _rounding(number_in(value) or 1.0)
    return found


def _single(group: Mapping[str, Value], above: str, depth: int) -> Iterator[tuple[str, Value]]:
    """Yield the single numbers with their paths, joined by dots; of a list of structures those of the first."""
    for name, value in group.items():
        path = f"{above}.{name}" if above else name
        if isinstance(value, dict):
            if depth < _MAX_DEPTH:
                yield from _single(value, path, depth + 1)
        elif isinstance(first := _first(value), dict):
            yield from _single(first, f"{path}[0]", depth + 1)
        elif "/" not in name and number_in(value) is not None:
            yield path, value


def _first(value: Value) -> Value:
    """Return the first entry of a list or of cells; None for anything else."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 1:
        value = value.tolist()
    return value[0] if isinstance(value, list) and value else None


def _rounding(number: float) -> float:
    """Return half a digit of a number as it is printed, relative to it."""
    digits = f"{number:.15g}".partition("e")[0].replace(".", "").strip("-0")
    return max(0.5 * 10.0 ** -(max(len(digits), 4) - 1), 1e-6)


def other_clocks(data: FileData, paths: Sequence[str], time: str, seconds: float) -> "dict[str, EvenSampling]":
    """Return the sampling of the channels beside ``time`` that follow other instants, by path, starts relative to those.

    Several columns of instants in a table belong each to the columns behind it, up to the next one. ``seconds`` are those in
    the unit of ``time``.
    """
    from identification.mapping import EvenSampling, even_sampling

    beside, above = _group_of(data.values, time)
    mapped = beside.get(time.removeprefix(above))
    length = mapped.shape if isinstance(mapped, np.ndarray) else ()
    names = [name for name in beside if _is_clock(name, beside[name], length)]
    if not time or len(names) < 2:
        return {}
    clock, of = "", dict[str, str]()
    for name in beside:
        clock = name if name in names else clock
        of[f"{above}{name}"] = clock
    own = of.get(time, "")
    found: dict[str, EvenSampling] = {}
    for path in paths:
        other = of.get(path, own)
        if path == time or other in (own, ""):
            continue
        unit = data.unit(f"{above}{other}") or time_unit_in(other)
        mine = even_sampling(np.asarray(beside[own]), seconds)
        its = even_sampling(np.asarray(beside[other]), (seconds_in(unit) or 1.0) if unit else seconds)
        if mine is not None and its is not None:
            found[path] = EvenSampling(its.rate_hz, its.start_s - mine.start_s, its.rounded_s)
    return found


def _group_of(values: Mapping[str, Value], path: str) -> tuple[Mapping[str, Value], str]:
    """Return the structure in which a path is, and the beginning of the paths of all in it."""
    if path in values and "/" not in path:
        return values, ""
    for sign in "/.":
        above, _, name = path.rpartition(sign)
        inside: Value = {**values}
        for part in above.split(sign):
            inside = inside.get(part) if isinstance(inside, dict) else None
        if isinstance(inside, dict) and name in inside:
            return inside, f"{above}{sign}"
    return {}, ""


def _is_clock(name: str, value: Value, length: tuple[int, ...]) -> bool:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf" or value.shape != length or len(length) != 1:
        return False
    return is_time_name(name.partition(" [")[0]) and bool(value[-1] > value[0])
