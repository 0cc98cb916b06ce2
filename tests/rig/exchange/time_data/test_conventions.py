"""What files say of units, scales, offsets, starts, rates and missing values is used, or refused with a word: never dropped.

The matrix of formats and conventions stands in `docs/reference/exchange.md`; every cell of it is a case here.
"""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import pytest
from hypothesis import given, settings

from identification import TimeRecords
from rig.errors import RigError
from rig.exchange.reading import import_file
from tests.refused import refused
from tests.rig.exchange.time_data.convention_writers import (
    MOTIONS,
    POUND,
    REFUSED as REFUSED_FIRST,
    UNITS,
    USED as USED_FIRST,
    VALUES,
    Case,
    N,
    Writer,
    case,
    hdf5_scaled,
    hdf5_starts,
    hdf5_units,
    lvm_starts,
    mat_single,
    mdf_starts,
    sep005_starts,
    tdms_starts,
)
from tests.rig.exchange.time_data.spelling_writers import (
    REFUSED_AS_WELL,
    USED_AS_WELL,
    csv_starts,
)

USED = {key: (*USED_FIRST.get(key, ()), *USED_AS_WELL.get(key, ())) for key in (USED_FIRST | USED_AS_WELL)}
REFUSED = {
    key: (*REFUSED_FIRST.get(key, ()), *REFUSED_AS_WELL.get(key, ())) for key in (REFUSED_FIRST | REFUSED_AS_WELL)
}
LATE = (tdms_starts, mdf_starts, sep005_starts, lvm_starts, hdf5_starts, csv_starts)
PAGE = Path(__file__).parents[4] / "docs" / "reference" / "exchange.md"
ENDINGS = {"MAT": ".mat", "CSV": ".csv", "HDF5": ".h5", "TDMS": ".tdms", "MDF 4": ".mf4", "SEP005": ".json"}
ENDINGS |= {"NumPy": ".npz", "workbook": ".xlsx", "LabVIEW": ".lvm", "WAV": ".wav"}
EXAMPLE = {"force": "lbf", "motion": "g", "time": "ms", "rate": 2048.0, "scale": 0.25, "offset": -1.5, "late": 4}


def mapping(of: Case, force_unit: str = "", more: str = "") -> str:
    force, motion = of["paths"]
    units = ("N", "m/s2") if of.get("in_si") else (of["force"], of["motion"])
    channels = (("f", "force", force_unit or units[0], force, more), ("m", "drive", units[1], motion, ""))
    lines = ['kind = "time-data"', of.get("more", "")]
    lines += ['axes = ["sample", "channel"]'] if of.get("matrix") else []
    for number, (name, role, unit, path, further) in enumerate(channels, 1):
        lines += [
            "[[channels]]",
            f'name = "{name}"',
            f'role = "{role}"',
            f"unit = {json.dumps(unit)}",
            f"value = {json.dumps(path)}",
            f"index = {number}" if of.get("matrix") else "",
            further,
        ]
    return "\n".join(lines)


def imported(write: Writer, ending: str, of: Case, **options: str) -> tuple[TimeRecords, Case]:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"x{ending}"
        told = write(path, of)
        text = mapping(told, **options)
        if (
            not any(key in told.get("more", "") for key in ("time",))
            and ending in (".mat", ".csv", ".h5", ".npz")
            and write not in LATE
        ):
            text = f"sample_rate_hz = {told['rate']}\n{text}"
        (Path(folder) / "m.toml").write_text(text)
        found = import_file(path, mapping=Path(folder) / "m.toml")
    assert isinstance(found, TimeRecords)
    return found, told


@pytest.mark.parametrize(
    ("kind", "write"),
    [(kind, one) for (kind, _), several in USED.items() for one in several],
    ids=lambda v: getattr(v, "__name__", v),
)
@settings(max_examples=12, deadline=None)
@given(of=case)
def test_the_same_si_numbers_come_back_whatever_the_file_says(kind, write, of):
    if write is mat_single and of["rate"] > 30_000.0:
        of = {**of, "rate": 25_600.0}
    found, told = imported(write, ENDINGS[kind], of)
    late = told["late"] if write in LATE else 0
    force = VALUES[0][late:] * UNITS[told["force"]]
    motion = VALUES[1][: N - late] * MOTIONS[told["motion"] if told["motion"] != "m/s2" else "m/s/s"]
    # Nine digits in print; scale and offset lose what a double loses when they are taken out and put in again.
    np.testing.assert_allclose(found.records[0].samples, [force, motion], rtol=1e-8, atol=1e-9 * np.abs(force).max())
    assert found.sample_rate_hz == pytest.approx(told["rate"], rel=1e-12)
    assert [channel.unit for channel in found.channels] == ["N", "m/s2"]


@pytest.mark.parametrize(
    ("kind", "write", "words"),
    [(kind, *one) for (kind, _), several in REFUSED.items() for one in several],
    ids=lambda v: getattr(v, "__name__", ""),
)
def test_what_cannot_be_followed_is_refused_with_a_word(kind, write, words):
    with pytest.raises((RigError, ValueError), match=re.escape(words)):  # the child makes the one of the other
        imported(write, ENDINGS[kind], EXAMPLE)


@pytest.mark.parametrize(
    ("kind", "write"),
    [(kind, one) for (kind, what), several in USED.items() for one in several if what == "units"],
    ids=lambda v: getattr(v, "__name__", v),
)
def test_a_mapping_wins_against_the_units_of_a_file_only_by_saying_so(kind, write):
    with refused(RigError, field="channels.f.unit", value="kN"):
        imported(write, ENDINGS[kind], EXAMPLE, force_unit="kN")
    found, _ = imported(write, ENDINGS[kind], EXAMPLE, force_unit="kN", more="against_file = true")
    factor = POUND if kind == "SEP005" else 1.0  # which is in SI by then
    np.testing.assert_allclose(found.records[0].samples[0], VALUES[0] * factor * 1e3, rtol=1e-9, atol=1e-9)


def test_stored_numbers_are_taken_against_the_scale_of_a_file():
    found, _ = imported(hdf5_scaled, ".h5", EXAMPLE, force_unit="N", more="against_file = true")
    np.testing.assert_allclose(found.records[0].samples[0], (VALUES[0] + 1.5) / 0.25)


@pytest.mark.parametrize("unit", ["furlongs", "N", "Hz"])
def test_a_unit_of_time_that_is_none_is_refused(unit):
    with refused(RigError, field="time_unit", reason=lambda text: text.endswith(f"'{unit}'")):
        imported(_with_time_in(unit), ".h5", EXAMPLE)


def _with_time_in(unit: str) -> Writer:
    def write(path: Path, of: Case) -> Case:
        told = hdf5_units(path, of)
        with h5py.File(path, "a") as file:
            file["x/t"].attrs["units"] = unit
        return told

    return write


def matrix() -> dict[tuple[str, str], str]:
    """Return the cells of the matrix on the page, by format and convention."""
    text = PAGE.read_text(encoding="utf-8")
    lines = text[text.index("| what a file says |") :].splitlines()
    lines = lines[: lines.index("")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {(row[0], what): cell for row in rows[2:] for what, cell in zip(rows[0][1:], row[1:], strict=True)}


def test_the_matrix_on_the_page_has_a_case_for_every_cell_that_this_file_knows():
    cells = {key: cell for key, cell in matrix().items() if key[0] in ENDINGS}
    assert {kind for kind, _ in cells} == {*ENDINGS}
    for key, said in cells.items():
        assert re.match("used|refused|–$", said), key
        assert bool(re.search(r"\bused", said)) == (key in USED), (key, said)
        assert ("refused" in said) == (key in REFUSED), (key, said)
    assert {*USED, *REFUSED} <= {*cells}
