"""Universal files against the definition of their datasets, read by pyuff and as plain text."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import pyuff

from identification import LinearModes
from rig.exchange.child_reading import ImportFailed
from rig.exchange.conversion import encoded
from rig.exchange.export import write_contents
from rig.exchange.reading import import_file
from rig.exchange.uff.reading import read_uff
from rig.exchange.uff.time_data import time_data_in
from rig.results.time_data.series import TimeData
from tests.refused import refused
from tests.rig.exchange.conftest import CHANNELS

FREQUENCY = np.arange(20.0, 30.0, 0.5)


def written(path: Path, *datasets: dict) -> Path:
    """A file as another program might write it."""
    file = pyuff.UFF(str(path))
    for dataset in datasets:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves a binary file to the garbage collector
            file.write_sets(dataset, "add")
    return path


def units(code: int = 1, length: float = 1.0, force: float = 1.0) -> dict:
    return {
        **{"type": 164, "units_code": code, "units_description": "", "temp_mode": 1, "length": length, "force": force},
        **{"temp": 1.0, "temp_offset": 273.15},
    }


def response(value, *, label="NONE", force_label="NONE", rsp=(1, 3), ref=(1, 3), code=12, **changes) -> dict:
    return {
        **{"type": 58, "func_type": 4, "rsp_node": rsp[0], "rsp_dir": rsp[1], "ref_node": ref[0], "ref_dir": ref[1]},
        **{"data": np.array(value, complex), "x": FREQUENCY, "abscissa_spacing": 1, "abscissa_spec_data_type": 18},
        **{"ordinate_spec_data_type": code, "orddenom_spec_data_type": 13, "ordinate_axis_units_lab": label},
        **{"orddenom_axis_units_lab": force_label, **changes},
    }


def signal(value, *, node=1, code=12, label="m/s2", rate=1000.0) -> dict:
    return {
        **{
            "type": 58,
            "func_type": 1,
            "rsp_node": node,
            "rsp_dir": 3,
            "ref_node": 0,
            "ref_dir": 0,
            "data": np.array(value),
        },
        **{"x": np.arange(len(value)) / rate, "abscissa_spacing": 1, "abscissa_spec_data_type": 17},
        **{"ordinate_spec_data_type": code, "orddenom_spec_data_type": 0, "ordinate_axis_units_lab": label},
    }


def test_frequency_responses_are_functions_of_type_4_with_units_and_degrees_of_freedom(matrix, tmp_path):
    path = tmp_path / "matrix.uff"
    write_contents([encoded(matrix)], path, "uff")
    sets = pyuff.UFF(str(path)).read_sets()
    assert [dataset["type"] for dataset in sets] == [151, 164] + [58] * 6
    assert (sets[1]["units_code"], sets[1]["length"], sets[1]["force"]) == (1, 1.0, 1.0)
    first, last = sets[2], sets[-1]
    assert (first["func_type"], first["ord_data_type"], first["num_pts"], first["load_case_id"]) == (4, 6, 401, 0)
    assert (first["rsp_node"], first["rsp_dir"]) == (first["ref_node"], first["ref_dir"]) == (1, 3)  # the drive point
    assert (first["ordinate_spec_data_type"], first["orddenom_spec_data_type"]) == (12, 13)
    assert (first["ordinate_axis_units_lab"], first["orddenom_axis_units_lab"]) == ("m/s2", "N")
    assert (first["abscissa_spec_data_type"], first["abscissa_spacing"], first["abscissa_inc"]) == (18, 1, 0.05)
    assert (last["rsp_node"], last["ordinate_spec_data_type"], last["orddenom_spec_data_type"]) == (3, 11, 0)
    np.testing.assert_allclose(first["data"], matrix.value[:, 0, 0], rtol=1e-11)


def test_columns_of_a_header_are_where_the_format_has_them(matrix, tmp_path):
    path = tmp_path / "matrix.uff"
    write_contents([encoded(matrix)], path, "uff")
    lines = path.read_text(encoding="ascii").splitlines()
    start = next(row for row, line in enumerate(lines) if line.strip() == "58" and lines[row - 1].strip() == "-1")
    assert lines[start - 1] == "    -1"
    assert lines[start][:6] == "    58"
    degrees = lines[start + 6]  # record 6: 2(I5,I10),2(1X,10A1,I10,I4)
    assert int(degrees[:5]) == 4
    assert (degrees[31:41].strip(), int(degrees[41:51]), int(degrees[51:55])) == ("acc_drive", 1, 3)
    assert (int(degrees[66:76]), int(degrees[76:80])) == (1, 3)
    form = lines[start + 7]  # record 7: 3I10,3E13.5
    assert [int(form[10 * k : 10 * k + 10]) for k in range(3)] == [6, 401, 1]
    assert float(form[30:43]) == 10.0
    assert all(len(line) <= 80 for line in lines)


def test_modes_are_dataset_55_with_frequency_modal_mass_and_damping(modes, tmp_path):
    path = tmp_path / "modes.uff"
    write_contents([encoded(modes)], path, "uff")
    sets = [dataset for dataset in pyuff.UFF(str(path)).read_sets() if dataset["type"] == 55]
    assert len(sets) == 3
    for number, dataset in enumerate(sets):
        assert (dataset["analysis_type"], dataset["data_ch"], dataset["data_type"], dataset["mode_n"]) == (
            2,
            2,
            2,
            number + 1,
        )
        assert dataset["freq"] == pytest.approx(modes.frequency_hz[number], rel=5e-6)
        assert dataset["modal_damp_vis"] == pytest.approx(modes.damping_ratio[number], rel=5e-6)
        assert dataset["modal_m"] == 1.0
        np.testing.assert_allclose(dataset["r3"], modes.shapes[:, number], rtol=5e-6)
        assert not dataset["r1"].any()


def test_time_data_is_binary_with_the_number_of_bytes_that_follow(tmp_path):
    samples = np.random.default_rng(0).normal(size=(3, 777))
    path = tmp_path / "time.uff"
    write_contents([encoded(TimeData(CHANNELS, samples, 5000.0, point=4))], path, "uff")
    content = path.read_bytes()
    at = content.index(b"    58b")
    header = content[at : at + 81].decode()  # I6,A1,I6,I6,I12,I12,...: byte order, float format, lines, bytes
    assert (int(header[7:13]), int(header[13:19]), int(header[19:31]), int(header[31:43])) == (1, 2, 11, 777 * 8)
    body = content[at:].split(b"\n", 12)[-1]
    np.testing.assert_array_equal(np.frombuffer(body[: 777 * 8], "<f8"), samples[0])
    assert body[777 * 8 :].startswith(b"    -1\n")
    dataset = pyuff.UFF(str(path)).read_sets(2)
    assert (dataset["func_type"], dataset["ord_data_type"], dataset["func_id"], dataset["rsp_node"]) == (1, 4, 4, 1)


@pytest.mark.parametrize("name", ["backbone", "mode"])
def test_a_table_is_a_function_for_each_column_over_the_points(name, request, tmp_path):
    value = request.getfixturevalue(name)
    path = tmp_path / "table.uff"
    write_contents([encoded(value)], path, "uff")
    sets = {d["id1"]: d for d in pyuff.UFF(str(path)).read_sets() if d["type"] == 58}
    np.testing.assert_allclose(sets["frequency_hz"]["data"], value.frequency_hz, rtol=1e-11)
    np.testing.assert_allclose(sets["force_n"]["data"], value.force_n, rtol=1e-11)
    np.testing.assert_array_equal(sets["force_n"]["x"], [1, 2])
    assert sets["force_n"]["ordinate_spec_data_type"] == 13
    assert all(d["func_type"] == 0 for d in sets.values())


def test_g_per_pound_becomes_si_and_the_drive_point_is_known_by_its_node(tmp_path):
    path = written(tmp_path / "g.uff", response(np.full(20, 2.0 + 1j), label="g", force_label="lbf"))
    found = import_file(path)
    np.testing.assert_allclose(found.value[:, 0, 0], (2 + 1j) * 9.80665 / 4.4482216152605)
    assert [(c.name, c.role, c.unit) for c in (*found.outputs, *found.inputs)] == [
        ("1+Z", "drive", "m/s2"),
        ("1+Z", "force", "N"),
    ]


def test_units_of_dataset_164_divide(tmp_path):
    millimetres = units(5, length=1000.0, force=1000.0)  # mm and mN
    path = written(tmp_path / "mm.uff", millimetres, response(np.full(20, 3.0), rsp=(2, 3)))
    found = import_file(path)
    np.testing.assert_allclose(found.value[:, 0, 0], 3.0)  # mm/s2 per mN are m/s2 per N
    assert found.outputs[0].role == "response"
    path = written(tmp_path / "mm_n.uff", units(9, 1000.0, 1.0), response(np.full(20, 3.0)))
    np.testing.assert_allclose(import_file(path).value[:, 0, 0], 3e-3)


@pytest.mark.parametrize(("choice", "factor"), [("labels", 1.0), ("file", 1e-3), ("si", 1.0)])
def test_mixed_units_are_refused_until_one_is_chosen(tmp_path, choice, factor):
    path = written(
        tmp_path / "mixed.uff", units(10, 1000.0, 1.0), response(np.ones(20), label="m/s^2", force_label="N")
    )
    with refused(ImportFailed, "mixed-units-the-ordinate-is-labelled"):
        import_file(path)
    np.testing.assert_allclose(import_file(path, units=choice).value, factor)


@pytest.mark.parametrize(
    ("datasets", "message"),
    [
        ([response(np.ones(20))], {"says": "the-ordinate-has-no-unit-units"}),
        ([units(), response(np.ones(20), label="furlong")], {"says": "is-furlong-allowed-m-mm"}),
        ([units(), units(2, 3.28, 0.22), response(np.ones(20))], {"says": "units-dataset-different-ones"}),
        ([units(), response(np.ones(20)), response(np.ones(20))], {"says": "second-response-of-to"}),
        (
            [units(), response(np.ones(20)), response(np.ones(20), rsp=(2, 3), ref=(2, 3))],
            {"says": "there-is-none-of-z-to"},
        ),
        (
            [units(), response(np.ones(20)), response(np.ones(20), rsp=(2, 3), x=FREQUENCY + 1)],
            {"says": "frequencies-are-not-those"},
        ),
        ([units(), signal(np.ones(10))], {"says": "holds-time-data-say-by-mapping"}),
        ([units()], {"says": "holds-neither-frequency-responses"}),
    ],
)
def test_what_is_unclear_is_said_in_one_line(tmp_path, datasets, message):
    path = written(tmp_path / "unclear.uff", *datasets)
    with refused(ImportFailed, **message) as caught:
        import_file(path)
    assert "\n" not in str(caught.value)
    assert "unclear.uff" in str(caught.value)


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_said_so(matrix, tmp_path, kept):
    path = tmp_path / "matrix.uff"
    write_contents([encoded(matrix)], path, "uff")
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with refused(ImportFailed, "matrix-uff-cut-short-damaged-of"):
        import_file(path)


@pytest.mark.parametrize("content", [b"", b"plain text " * 50, bytes(range(256)) * 3, b"    -1\nfoo\n    -1\n"])
def test_a_file_that_is_no_universal_file_is_said_so(tmp_path, content):
    path = tmp_path / "foreign.uff"
    path.write_bytes(content)
    with refused(ImportFailed, "foreign-uff-is-no-universal-file"):
        import_file(path)


def test_rates_and_lengths_that_disagree_are_named(tmp_path):
    path = written(tmp_path / "rates.uff", signal(np.ones(10)), signal(np.ones(10), rate=1100.0))
    with refused(ImportFailed, "sample-rate-hz-that-of-the"):
        time_data_in(read_uff(path))
    path = written(tmp_path / "two_rates.uff", signal(np.ones(10)), signal(np.ones(10), node=2, rate=1100.0))
    found = time_data_in(read_uff(path))
    assert [found.channels[name].sample_rate_hz for name in ("1+Z", "2+Z")] == [1000.0, 1100.0]
    path = written(tmp_path / "lengths.uff", signal(np.ones(10)), signal(np.ones(12)))
    with refused(ImportFailed, "has-samples-before"):
        time_data_in(read_uff(path))


def mode(**changes) -> dict:
    return {
        **{
            "type": 55,
            "analysis_type": 2,
            "data_ch": 2,
            "spec_data_type": 8,
            "load_case": 1,
            "mode_n": 1,
            "freq": 20.0,
        },
        **{"modal_m": 4.0, "modal_damp_vis": 0.01, "modal_damp_his": 0.0, "node_nums": [1, 7]},
        **{"r1": np.zeros(2), "r2": np.array([0.0, 0.5]), "r3": np.array([-2.0, 1.0]), **changes},
    }


def test_modes_of_others_are_normalised_by_their_modal_mass_and_positive_at_the_drive_point(tmp_path):
    path = written(tmp_path / "modes.uff", units(), mode(), mode(freq=10.0, mode_n=2))
    found = import_file(path, drive="1+Z")
    assert isinstance(found, LinearModes)
    assert [channel.name for channel in found.channels] == ["7+Y", "1+Z", "7+Z"] or [
        channel.name for channel in found.channels
    ] == ["1+Z", "7+Y", "7+Z"]
    assert dict(zip((c.name for c in found.channels), found.shapes[:, 0], strict=True)) == {
        **{"1+Z": 1.0, "7+Y": -0.25, "7+Z": -0.5}
    }
    np.testing.assert_array_equal(found.frequency_hz, [10.0, 20.0])


def test_complex_modes_beside_normal_ones_are_left_out_with_a_note(tmp_path):
    poles = {
        "analysis_type": 3,
        "eig": -1.0 + 126.0j,
        "modal_a": 1.0 + 0.0j,
        "modal_b": 1.0 + 0.0j,
        "spec_data_type": 5,
    }
    columns = {name: np.array([1.0 + 0.5j, 0.5]) for name in ("r1", "r2", "r3")}
    found = import_file(written(tmp_path / "both.uff", units(), mode(), mode(**poles, **columns)), drive="1+Z")
    np.testing.assert_array_equal(found.frequency_hz, [20.0])
    assert found.notes[0] == "left out of the universal file: shapes that are no normal modes (1)"


def test_a_modal_mass_in_other_units_is_converted(tmp_path):
    path = written(tmp_path / "modes.uff", units(5, length=1000.0, force=1000.0), mode())  # mm, mN: kg
    assert abs(import_file(path, drive="1+Z").drive_shape[0]) == pytest.approx(1.0)
    path = written(tmp_path / "tonnes.uff", units(9, length=1000.0, force=1.0), mode())  # mm, N: tonnes
    assert abs(import_file(path, drive="1+Z").drive_shape[0]) == pytest.approx(1.0 / np.sqrt(1000.0))


@pytest.mark.parametrize(
    ("changes", "drive", "message"),
    [
        ({}, "", {"field": "drive", "value": "", "allowed": "1+Z, 7+Y, 7+Z"}),
        ({}, "3+X", {"field": "drive", "value": "3+X"}),
        ({"modal_m": 0.0}, "1+Z", {"says": "modal-mass-wanted-is-real-shape"}),
        ({axis: np.array([1j, 1.0]) for axis in ("r1", "r2", "r3")}, "1+Z", {"says": "wanted-is-real-shape"}),
    ],
)
def test_modes_that_cannot_be_normalised_are_refused(tmp_path, changes, drive, message):
    path = written(tmp_path / "modes.uff", units(), mode(**changes))
    with refused(ImportFailed, **message):
        import_file(path, drive=drive)
