"""Read the datasets of a universal file, and check that they are complete."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.exchange.child_reading import NAMES, ImportFailed, read_in_child
from rig.exchange.universal_file import Axis, Function, ModeShape, UnitSystem, UniversalFile
from rig.system.text_files import read_bytes
from vibrolock.quantities import says_a_unit

if TYPE_CHECKING:
    import pyuff

LARGEST_BYTES = 2_000_000_000  # largest file that is read, bytes; chosen
_KNOWN = (55, 58, 151, 164)  # datasets that are read: shapes, functions, header, units
_NORMAL_MODE = 2  # analysis type of a normal mode
_NO_LETTER = "\ufffd"  # what pyuff has in place of a letter that is no UTF-8
_IDS, _AXES = ("id1", "id2", "id3", "id4", "id5"), ("abscissa", "ordinate", "orddenom", "z_axis")
_FIRST_ID, _FIRST_AXIS = 2, 9  # lines of a dataset 58, from its beginning
_LABEL, _UNIT = slice(26, 46), slice(47, 67)  # columns of an axis that hold texts


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
        raise ImportFailed(f"{path}: is not a universal file; those begin with a line -1 and a dataset's number")
    if not text.rstrip().endswith(b"    -1"):
        raise ImportFailed(f"{path}: is cut short: the last dataset has no end")
    try:
        file = pyuff.UFF(str(path))
        types = [int(number) for number in file.get_set_types()]
    except Exception as error:  # pyuff raises no more specific error
        raise ImportFailed(f"{path}: is a damaged universal file ({error})") from None
    found = list(_datasets(file, types, path, text))
    return UniversalFile(
        functions=tuple(one for one in found if isinstance(one, Function)),
        modes=tuple(one for one in found if isinstance(one, ModeShape)),
        shapes=types.count(55),
        units=tuple(one for one in found if isinstance(one, UnitSystem)),
        count=len(found),
    )


def _datasets(
    file: "pyuff.UFF", types: Sequence[int], path: Path, text: bytes
) -> Iterator[Function | ModeShape | UnitSystem | None]:
    """Yield the known datasets; None for the header and for shapes that are no normal modes."""
    for number, kind in enumerate(types):
        if kind not in _KNOWN:
            continue
        where = f"{path}, dataset {number + 1} (type {kind})"
        try:
            start, end = file._block_ind[number]
            yield _dataset(kind, _readable(file.read_sets(number), text[start:end]), where)
        except ImportFailed:
            raise
        except Exception as error:
            raise ImportFailed(f"{where}: is damaged or in a variant that is not understood ({error})") from None


def _readable(table: dict[str, object], block: bytes) -> Mapping[str, object]:
    """Return a dataset 58 with its texts as Latin-1 if they are no UTF-8, which is what older programs write."""
    if table.get("type") != 58 or not any(
        _NO_LETTER in str(value) for value in table.values() if isinstance(value, str)
    ):
        return table
    lines = block.split(b"\n", _FIRST_AXIS + len(_AXES))
    plain = [line.decode("latin-1").rstrip() for line in lines[:-1]]
    texts = {name: plain[_FIRST_ID + row].strip() for row, name in enumerate(_IDS)}
    for row, name in enumerate(_AXES):
        line = plain[_FIRST_AXIS + row]
        texts |= {f"{name}_axis_lab": line[_LABEL].strip(), f"{name}_axis_units_lab": line[_UNIT].strip()}
    return {**table, **texts}


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
        abscissa=_axis(table, "abscissa"),
        ordinate=_axis(table, "ordinate"),
        denominator=_axis(table, "orddenom"),
        x=np.asarray(table["x"], np.float64)[:wanted],
        data=data,
    )


def _axis(table: Mapping[str, object], prefix: str) -> Axis:
    label, unit = (str(table.get(f"{prefix}_axis_{name}", "")).strip() for name in ("lab", "units_lab"))
    code = int(str(table.get(f"{prefix}_spec_data_type", 0)))
    return Axis(code, "" if label == "NONE" else label, unit if says_a_unit(unit) else "")


def _whole(table: Mapping[str, object], key: str) -> int:
    return int(_real(table, key))


def _real(table: Mapping[str, object], key: str) -> float:
    return float(str(table[key]))
