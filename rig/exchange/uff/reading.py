"""Read the datasets of a universal file, check that they are complete, and extract their time data."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification import IdentificationError
from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.file_data import ChannelFacts, FileData, side_by_side
from rig.exchange.uff.units import file_units
from rig.exchange.universal_file import (
    TIME_RESPONSE,
    Axis,
    Function,
    ModeShape,
    UnitSystem,
    UniversalFile,
    degree_name,
)
from rig.system.text_files import read_bytes
from vibrolock.arrays import Float

if TYPE_CHECKING:
    import pyuff

LARGEST_BYTES = 2_000_000_000  # largest file that is read, bytes; chosen
_KNOWN = (55, 58, 151, 164)  # datasets that are read: shapes, functions, header, units
_NORMAL_MODE = 2  # analysis type of a normal mode
_MAX_DIFFERENCE = 0.01
"""Relative difference of the lengths of two records up to which both are cut; chosen: a recorder stops some samples late."""


def read_uff(path: Path) -> UniversalFile:
    """Return what `datasets_in` reads, by a child process; raise `ImportFailed` as it does."""
    return read_in_child("uff", path, NAMES["uff"], UniversalFile)


def datasets_in(path: Path) -> UniversalFile:
    """Return datasets 55, 58 and 164 of a universal file.

    Raises `ImportFailed` if the file is missing, not a universal file or cut short, or if a dataset cannot be read.
    """
    import pyuff

    text = read_bytes(path, LARGEST_BYTES, ImportFailed)
    if not re.match(rb"\s*-1\s*[\r\n]+\s*\d+", text[:400]):
        raise ImportFailed(f"{path}: is no universal file; those begin with a line -1 and a dataset's number")
    if not text.rstrip().endswith(b"    -1"):
        raise ImportFailed(f"{path}: is cut short: the last dataset has no end")
    try:
        file = pyuff.UFF(str(path))
        types = [int(number) for number in file.get_set_types()]
    except Exception as error:  # pyuff raises no more specific error
        raise ImportFailed(f"{path}: is a damaged universal file ({error})") from None
    found = list(_datasets(file, types, path))
    return UniversalFile(
        functions=tuple(one for one in found if isinstance(one, Function)),
        modes=tuple(one for one in found if isinstance(one, ModeShape)),
        has_shapes=55 in types,
        units=tuple(one for one in found if isinstance(one, UnitSystem)),
        count=len(found),
    )


def _datasets(
    file: "pyuff.UFF", types: Sequence[int], path: Path
) -> Iterator[Function | ModeShape | UnitSystem | None]:
    """Yield the known datasets; None for the header and for shapes that are no normal modes."""
    for number, kind in enumerate(types):
        if kind not in _KNOWN:
            continue
        where = f"{path}, dataset {number + 1} (type {kind})"
        try:
            yield _dataset(kind, file.read_sets(number), where)
        except ImportFailed:
            raise
        except Exception as error:
            raise ImportFailed(f"{where}: is damaged or in a variant that is not understood ({error})") from None


def _dataset(kind: int, table: Mapping[str, object], where: str) -> Function | ModeShape | UnitSystem | None:
    if kind == 164:
        return UnitSystem(_whole(table, "units_code"), _real(table, "length"), _real(table, "force"))
    lines = tuple(str(table.get(f"id{number}", "")) for number in range(1, 6))
    if kind == 55 and table["analysis_type"] == _NORMAL_MODE:
        return ModeShape(
            where=where,
            lines=lines,
            frequency_hz=_real(table, "freq"),
            modal_mass=_real(table, "modal_m"),
            damping_ratio=_real(table, "modal_damp_vis"),
            nodes=tuple(int(node) for node in np.asarray(table["node_nums"])),
            shape=np.array([table[axis] for axis in ("r1", "r2", "r3")]),
        )
    if kind != 58:
        return None
    data, wanted = np.asarray(table["data"]), _whole(table, "num_pts")
    if data.size < wanted:
        raise ImportFailed(f"{where}: holds {data.size} of {wanted} values")
    data = data[:wanted]
    if not np.all(np.isfinite(data)):
        raise ImportFailed(f"{where}: value {int(np.argmin(np.isfinite(data))) + 1} is not finite")
    return Function(
        where=where,
        type=_whole(table, "func_type"),
        number=_whole(table, "func_id"),
        load_case=_whole(table, "load_case_id"),
        lines=lines,
        response=(_whole(table, "rsp_node"), _whole(table, "rsp_dir")),
        reference=(_whole(table, "ref_node"), _whole(table, "ref_dir")),
        even=_whole(table, "abscissa_spacing") == 1,
        step=_real(table, "abscissa_inc"),
        ordinate=_axis(table, "ordinate"),
        denominator=_axis(table, "orddenom"),
        x=np.asarray(table["x"], np.float64)[:wanted],
        data=data,
    )


def _axis(table: Mapping[str, object], prefix: str) -> Axis:
    return Axis(
        int(str(table.get(f"{prefix}_spec_data_type", 0))),
        str(table.get(f"{prefix}_axis_lab", "")),
        str(table.get(f"{prefix}_axis_units_lab", "")),
    )


def _whole(table: Mapping[str, object], key: str) -> int:
    return int(_real(table, key))


def _real(table: Mapping[str, object], key: str) -> float:
    return float(str(table[key]))


def time_data_in(file: UniversalFile, assumed: str = "") -> FileData:
    """Return the time functions (type 1) by name, with one column per record, in SI if they have units.

    The values also have ``sets``, the list of all functions. Raises `ImportFailed` if there are none, or if their rates
    disagree.
    """
    functions = file.of_type(TIME_RESPONSE)
    if not functions:
        raise ImportFailed(f"no time data (dataset 58 of function type 1) among {file.count} datasets")
    units = file_units(file, assumed)
    rates: list[float] = []
    records: dict[str, list[Float]] = {}
    sets: list[Float] = []
    known: dict[str, str] = {}
    for function in functions:
        rates.append(_rate(function))
        if abs(rates[-1] / rates[0] - 1.0) > 1e-9:
            raise ImportFailed(f"{function.where}: sample rate {rates[-1]:g} Hz, that of the first is {rates[0]:g} Hz")
        name = function.lines[0] if function.own else degree_name(function.response)
        try:
            unit, factor = units.of(function.ordinate, "ordinate", function.where)
        except (ImportFailed, IdentificationError):
            if assumed or function.ordinate.data_type:
                raise
            unit, factor = "", 1.0  # an unknown quantity without unit: the mapping says what it is
        sets.append(np.asarray(np.real(function.data), np.float64) * factor)
        records.setdefault(name, []).append(sets[-1])
        before = len(records[name][0])
        if abs(len(sets[-1]) - before) > _MAX_DIFFERENCE * before:
            raise ImportFailed(
                f"{function.where}: {name} has {len(sets[-1])} samples, before {before}; wanted are records of one length"
            )
        known[name] = unit
    return FileData(
        values={**{name: side_by_side(several) for name, several in records.items()}, "sets": [*sets]},
        channels={name: ChannelFacts(unit=unit, in_si=True) for name, unit in known.items()},
        sample_rate_hz=rates[0],
    )


def _rate(function: Function) -> float:
    """Return the sample rate of line 5 if it agrees with the header to the header's six digits, else that of the header.

    Of the rates with these six digits of the step, the one with the fewest digits is taken: 2048 Hz, not 2048.001 Hz.
    """
    step = function.step
    if not function.even or step <= 0.0:
        raise ImportFailed(f"{function.where}: is not evenly sampled; wanted is a step above zero")
    rate = 1.0 / step
    stated = re.match(r"sample rate (\S+) Hz", function.lines[4])
    if stated and abs(float(stated[1]) / rate - 1.0) < 1e-5:
        return float(stated[1])
    rounded = (float(f"{rate:.{digits}g}") for digits in range(1, 7))
    return next((one for one in rounded if f"{1.0 / one:.5e}" == f"{step:.5e}"), rate)
