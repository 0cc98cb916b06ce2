"""Time data of a universal file: its functions of type 1 as channels with records."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.mapping import even_sampling
from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import ChannelFacts, FileData
from rig.exchange.uff.units import FileUnits, file_units, seconds_of
from rig.exchange.universal_file import TIME_RESPONSE, Function, UniversalFile, degree_name

_MAX_DIFFERENCE = 0.01
"""Relative difference of the lengths of two records up to which both are cut; chosen: a recorder stops some samples late."""
_SAME_RATE = 1e-9  # relative difference of rates that counts as none
_SAME_START, _ROUNDED = 0.05, 1e-5  # difference of starts that counts as none: samples, and relative by six digits
_QUANTITIES: dict[str | int, str] = {
    **{"m": "displacement", "m/s": "velocity", "m/s2": "acceleration", "N": "force", "V": "voltage"},
    **{3: "strain", 5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 12: "acceleration"},
    **{13: "force", 15: "pressure", 19: "speed"},
}
"""Names of quantities by SI unit or specific data type."""


@dataclass(frozen=True, eq=False)
class _Signal:
    """One function, and what the file says of it."""

    function: Function
    values: NDArray[np.generic]
    unit: str
    in_si: bool
    rate_hz: float
    start_s: float

    @property
    def degree(self) -> str:
        return self.function.lines[0] if self.function.own else degree_name(self.function.response)

    @property
    def quantity(self) -> str:
        return _QUANTITIES.get(self.unit) or _QUANTITIES.get(self.function.ordinate.data_type) or self.unit

    @property
    def line(self) -> str:
        return "" if self.function.lines[0] == "NONE" else _plain(self.function.lines[0])

    @property
    def key(self) -> tuple[str, ...]:
        """What the records of one channel have in common."""
        if self.function.own:
            return (self.degree,)
        return self.degree, self.quantity, self.unit, self.function.lines[0], self.function.ordinate.label


_CANDIDATES: tuple[Callable[[_Signal], str], ...] = (
    lambda one: one.quantity,
    lambda one: one.line,
    lambda one: _plain(one.function.ordinate.label),
    lambda one: f"{one.quantity} {one.line}".strip(),
)
"""What is added to node and direction where several channels have them; the first that tells all of them apart."""


def time_data_in(file: UniversalFile, assumed: str = "") -> FileData:
    """Return the time functions (type 1) by name, with one column per record.

    Signals are in SI if the file gives them a unit of a force, a motion or a voltage; others keep the unit of the file. The
    name is node and direction; where functions of one node and direction differ in quantity, unit, ID line 1 or axis label
    they are channels of their own, with quantity or ID line in their names. The values also have ``sets``, the list of all
    functions. Raises `ImportFailed` if there are none, or if the records of a channel disagree.
    """
    functions = file.of_type(TIME_RESPONSE)
    if not functions:
        told = "".join(f"; {note}" for note in file.left_out())
        raise ImportFailed(f"no time data (dataset 58 of function type 1) among {file.count} datasets{told}")
    units = file_units(file, assumed)
    signals = [_signal(function, units) for function in functions]
    records = dict(_named(signals))
    _check_starts(records)
    first = signals[0].rate_hz
    alike = all(abs(one.rate_hz / first - 1.0) <= _SAME_RATE for one in signals)
    return FileData(
        values={
            **{name: _side_by_side(name, several) for name, several in records.items()},
            "sets": [one.values for one in signals],
        },
        channels={
            name: ChannelFacts(
                unit=several[0].unit,
                in_si=several[0].in_si,
                sample_rate_hz=None if alike else several[0].rate_hz,
                start_s=several[0].start_s,
                node=several[0].function.response[0],
                direction=degree_name((0, several[0].function.response[1]))[1:],
            )
            for name, several in records.items()
        },
        sample_rate_hz=first if alike else None,
        notes=file.left_out(TIME_RESPONSE),
        repeated=("sets",),
    )


def _signal(function: Function, units: FileUnits) -> _Signal:
    unit, factor, in_si = units.of_signal(function.ordinate, function.where)
    rate, start = _sampling(function)
    return _Signal(function, _real(function, factor), unit, in_si, rate, start)


def _real(function: Function, factor: float) -> NDArray[np.generic]:
    """Return the samples of a function times a factor; complex ones stay so, and are refused if they are mapped."""
    data = function.data
    if np.iscomplexobj(data) and np.any(np.imag(data)):
        return np.asarray(data, np.complex128) * factor
    return np.asarray(np.real(data), np.float64) * factor


def _named(signals: Sequence[_Signal]) -> Iterator[tuple[str, list[_Signal]]]:
    """Yield the channels by name, each with its records in the order of the file."""
    channels: dict[tuple[str, ...], list[_Signal]] = {}
    for one in signals:
        channels.setdefault(one.key, []).append(one)
    for degree in dict.fromkeys(one.degree for one in signals):
        group = [several for key, several in channels.items() if key[0] == degree]
        for end, several in zip(_ends(group), group, strict=True):
            yield f"{degree} {end}".strip(), several


def _ends(group: Sequence[Sequence[_Signal]]) -> list[str]:
    """Return what follows node and direction in the names of channels that share them: nothing for one alone."""
    if len(group) == 1:
        return [""]
    for candidate in _CANDIDATES:
        ends = [candidate(several[0]) for several in group]
        if all(ends) and len(set(ends)) == len(ends):
            return ends
    return [f"{several[0].quantity} #{number}".strip() for number, several in enumerate(group, 1)]


def _plain(text: str) -> str:
    """Return a text without letters that paths of mappings use, and without a unit behind a colon."""
    return re.sub(r"[./\[\]\s]+", " ", text.partition(" : ")[0]).strip()


def _side_by_side(name: str, records: Sequence[_Signal]) -> NDArray[np.generic]:
    """Return the records as [n, n_records], cut to the shortest; raise `ImportFailed` if they disagree."""
    first = records[0]
    size = len(first.values)
    for one in records:
        where, length = one.function.where, len(one.values)
        if abs(length - size) > _MAX_DIFFERENCE * size:
            raise ImportFailed(f"{where}: {name} has {length} samples, before {size}; expected records of one length")
        if abs(one.rate_hz / first.rate_hz - 1.0) > _SAME_RATE:
            raise ImportFailed(f"{where}: sample rate {one.rate_hz:g} Hz, that of the first is {first.rate_hz:g} Hz")
    shortest = min(len(one.values) for one in records)
    return np.column_stack([one.values[:shortest] for one in records])


def _check_starts(records: Mapping[str, Sequence[_Signal]]) -> None:
    """Raise `ImportFailed` if a channel is earlier than another in one record and not, or by another time, in the next."""
    longest = max(records.values(), key=len)
    for name, several in records.items():
        for one, other in zip(several, longest, strict=False):
            shift = (one.start_s - other.start_s) - (several[0].start_s - longest[0].start_s)
            if abs(shift) * one.rate_hz > _SAME_START + _ROUNDED * abs(one.start_s) * one.rate_hz:
                raise ImportFailed(
                    f"{one.function.where}: {name} begins at {one.start_s:g} s, {other.function.where} at {other.start_s:g} s; "
                    "expected the same time between them in each record"
                )


def _sampling(function: Function) -> tuple[float, float]:
    """Return the sample rate (Hz) and the first instant (s).

    The rate is that of line 5 if it agrees with the header to the header's six digits, else that of the header. Of the rates
    with these six digits of the step, the one with the fewest digits is taken: 2048 Hz, not 2048.001 Hz.
    """
    seconds = seconds_of(function)
    step = function.step * seconds
    if not function.even:
        found = even_sampling(function.x, seconds)
        if found is None:
            raise ImportFailed(f"{function.where}: its instants are not evenly spaced; resample it")
        return found.rate_hz, found.start_s
    if step <= 0.0:
        raise ImportFailed(f"{function.where}: is not evenly sampled; expected a step above zero")
    start = float(function.x[0]) * seconds if function.x.size else 0.0
    rate = 1.0 / step
    stated = re.match(r"sample rate (\S+) Hz", function.lines[4])
    if stated and abs(float(stated[1]) / rate - 1.0) < 1e-5:
        return float(stated[1]), start
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, 7))
    header = f"{function.step:.5e}"
    return next((one for one in rounded if f"{1.0 / (one * seconds):.5e}" == header), rate), start
