"""LabVIEW measurement files, written by hand from the specification of the format."""

import numpy as np
import pytest

from rig.exchange.file_data import FileData
from rig.exchange.foreign.labview import read_lvm
from tests.refused import refused

N, STEP = 50, 1.953125e-5
VALUES = np.random.default_rng(2).normal(size=(N, 2))


def head(columns: str = "One", separator: str = "\t", decimal: str = ".") -> str:
    tags = {"Writer_Version": "2", "Separator": "Tab" if separator == "\t" else "Comma"}
    tags |= {"Decimal_Separator": decimal, "X_Columns": columns, "Time_Pref": "Absolute"}
    lines = ["LabVIEW Measurement" + separator, *(f"{key}{separator}{value}" for key, value in tags.items())]
    return "\n".join([*lines, "***End_of_Header***" + separator, separator, ""])


def segment(
    values: np.ndarray,
    columns: str = "One",
    separator: str = "\t",
    decimal: str = ".",
    begins: tuple[str, ...] = ("10:00:00.0", "10:00:00.0"),
    x0: float = 0.0,
    instants: np.ndarray | None = None,
) -> str:
    """Return a segment with a force and an acceleration."""
    gap = [""] if columns == "Multi" else []
    instants = x0 + STEP * np.arange(len(values)) if instants is None else instants
    about = {"Samples": [str(len(values))] * 2, "Date": ["2026/02/03"] * 2, "Time": [*begins]}
    about |= {"Y_Unit_Label": ["N", "m/s^2"], "X_Dimension": ["Time"] * 2}
    about |= {"X0": [f"{x0:.6E}"] * 2, "Delta_X": [f"{STEP!r}"] * 2}
    lines = [separator.join(["Channels", "2", "", ""])]
    lines += [separator.join([key, first, *gap, second, ""]) for key, (first, second) in about.items()]
    lines += ["***End_of_Header***" + 3 * separator]
    lines += [separator.join(["X_Value", "Force", *(["X_Value"] if gap else []), "Acc", "Comment"])]
    for t, (force, acc) in zip(instants, values.tolist(), strict=True):
        x = "" if columns == "No" else f"{t:.6f}"
        lines += [separator.join([x, f"{force!r}", *([x] if gap else []), f"{acc!r}"])]
    return "\n".join(lines).replace(".", decimal) + "\n\n"


def read(tmp_path, text: str) -> FileData:
    (tmp_path / "x.lvm").write_text(text, encoding="utf-8")
    return read_lvm(tmp_path / "x.lvm")


@pytest.mark.parametrize("columns", ["One", "Multi", "No"])
@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), ("\t", ","), (",", ".")])
def test_names_units_rate_and_numbers_are_those_in_the_file(tmp_path, columns, separator, decimal):
    text = head(columns, separator, decimal) + segment(VALUES, columns, separator, decimal)
    found = read(tmp_path, text)
    assert list(found.values) == ["Force", "Acc"]
    np.testing.assert_array_equal(np.column_stack([*found.values.values()]), VALUES)
    assert [one.unit for one in found.channels.values()] == ["N", "m/s^2"]
    assert [one.sample_rate_hz for one in found.channels.values()] == pytest.approx([51200.0] * 2, rel=1e-12)


def test_channels_that_begin_later_say_so(tmp_path):
    found = read(tmp_path, head() + segment(VALUES, begins=("10:00:00.25", "10:00:00.3500976562500")))
    starts = [one.start_s for one in found.channels.values()]
    assert starts == pytest.approx([0.0, 0.10009765625], abs=1e-10)


def test_segments_without_a_gap_are_one_record(tmp_path):
    second = segment(VALUES[20:], x0=20 * STEP)
    found = read(tmp_path, head() + segment(VALUES[:20]) + second)
    np.testing.assert_array_equal(found.values["Acc"], VALUES[:, 1])


def test_segments_with_gaps_are_records(tmp_path):
    found = read(tmp_path, head() + segment(VALUES) + segment(2.0 * VALUES, begins=("10:00:01.0", "10:00:01.0")))
    np.testing.assert_array_equal(found.values["Force"], np.column_stack([VALUES[:, 0], 2.0 * VALUES[:, 0]]))


def test_instants_of_the_first_channel_alone_are_not_those_of_another_with_its_own_step(tmp_path):
    steps = f"Delta_X\t{STEP!r}\t{STEP!r}"
    assert steps in segment(VALUES)
    found = read(tmp_path, head() + segment(VALUES).replace(steps, f"Delta_X\t{STEP!r}\t{2.0 * STEP!r}"))
    assert [one.sample_rate_hz for one in found.channels.values()] == pytest.approx([51200.0, 25600.0], rel=1e-12)


def test_instants_that_are_no_even_steps_are_kept_and_give_no_rate(tmp_path):
    found = read(tmp_path, head() + segment(VALUES, instants=0.3 * np.arange(N) ** 1.1))
    assert found.channels["Force"].sample_rate_hz is None
    np.testing.assert_allclose(found.values["X_Value"], 0.3 * np.arange(N) ** 1.1, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", {"says": "does-not-begin-with-labview-measurement"}),
        (head()[:60], {"says": "its-head-has-no-end"}),
        (head(), {"says": "no-segment-with-numbers"}),
        (
            head() + segment(VALUES) + segment(VALUES[:20], begins=("11:00:00.0",) * 2),
            {"says": "unequal-lengths-with-gaps"},
        ),
        (head() + segment(VALUES).replace("Delta_X\t1.953125e-05", "Delta_X\tfast"), {"says": "fast"}),
        (
            head() + segment(VALUES).replace(f"{VALUES[3, 1]!r}".removeprefix("np.float64(")[:-1], "OVER"),
            {"says": "over"},
        ),
        (head() + segment(VALUES) + segment(VALUES).replace("\tN\t", "\tkN\t"), {"says": "another-y-unit-label"}),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, text, message):
    with refused(ValueError, **message):
        read(tmp_path, text)
