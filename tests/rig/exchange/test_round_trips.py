"""What is written in another format is what is read back."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from identification import NonlinearMode
from identification.common import decode, encode
from rig.exchange.conversion import decoded, encoded
from rig.exchange.export import write_contents
from rig.exchange.mat import read_mat, stored_objects
from rig.exchange.reading import import_file
from rig.exchange.uff.reading import read_uff
from rig.exchange.uff.time_data import time_data_in
from rig.results.kinds import exchanges
from rig.results.time_data.series import TimeData
from tests.rig.exchange.conftest import CHANNELS

NAMES = ("backbone", "mode", "matrix", "modes", "responses")


def assert_same(found: Any, expected: Any, rtol: float = 0.0) -> None:
    assert type(found) is type(expected)
    if isinstance(expected, tuple | list):
        assert len(found) == len(expected)
        for one, other in zip(found, expected, strict=True):
            assert_same(one, other, rtol)
    elif hasattr(expected, "__dataclass_fields__"):
        for field in fields(expected):
            assert_same(getattr(found, field.name), getattr(expected, field.name), rtol)
    elif isinstance(expected, np.ndarray):
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=rtol, atol=rtol * np.nanmax(np.abs(expected), initial=0.0))
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=rtol, abs=0.0, nan_ok=True)
    else:
        assert found == expected


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("format_", ["mat", "csv"])
def test_mat_and_csv_give_back_every_bit(name, format_, request, tmp_path):
    value = request.getfixturevalue(name)
    path = tmp_path / f"out.{format_}"
    write_contents([encoded(value)], path, format_)
    assert_same(import_file(path), value)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", NAMES)
def test_the_parts_of_an_object_make_it_again(name, request):
    value = request.getfixturevalue(name)
    contents = encoded(value)
    assert_same(decoded(contents.kind, contents.arrays, contents.attributes), value)


def test_a_single_point_or_mode_keeps_its_dimensions(mode, tmp_path):
    arrays, attributes = encode(mode)
    single = decode(NonlinearMode, {name: array[:1] for name, array in arrays.items()}, attributes)
    for format_ in ("mat", "csv"):
        path = tmp_path / f"one.{format_}"
        write_contents([encoded(single)], path, format_)
        assert_same(import_file(path), single)


def test_universal_files_keep_frequency_responses_to_twelve_digits(matrix, tmp_path):
    path = tmp_path / "matrix.uff"
    write_contents([encoded(matrix)], path, "uff")
    found = import_file(path)
    np.testing.assert_allclose(found.value, matrix.value, rtol=2e-12, atol=1e-11)
    np.testing.assert_allclose(found.frequency_hz, matrix.frequency_hz, rtol=1e-12)
    assert found.outputs == matrix.outputs
    assert found.inputs == matrix.inputs
    assert (found.estimator, found.specimen) == ("instrument", "beam")


def test_universal_files_keep_modes_to_six_digits(modes, tmp_path):
    path = tmp_path / "modes.unv"
    write_contents([encoded(modes)], path, "uff")
    found = import_file(path)
    assert found.channels == modes.channels
    for name in ("frequency_hz", "damping_ratio", "shapes"):
        np.testing.assert_allclose(getattr(found, name), getattr(modes, name), rtol=6e-6)


def test_universal_files_keep_stepped_sines_but_for_digits_of_the_frequency(responses, tmp_path):
    path = tmp_path / "levels.uff"
    write_contents([encoded(responses)], path, "uff")
    assert_same(import_file(path), responses, rtol=5e-6)
    found = import_file(path)
    np.testing.assert_allclose(found[0].force, responses[0].force, rtol=1e-11)


@pytest.mark.parametrize("rate_hz", [5000.0, 51200.0, 1000.0 / 3.0])
def test_time_data_of_universal_files_is_exact_and_so_is_its_rate(tmp_path, rate_hz):
    samples = np.random.default_rng(0).normal(size=(3, 1000))
    path = tmp_path / "time.uff"
    write_contents([encoded(TimeData(CHANNELS, samples, rate_hz, point=4))], path, "uff")
    data = time_data_in(read_uff(path))
    assert data.sample_rate_hz == rate_hz
    for channel, expected in zip(CHANNELS, samples, strict=True):
        np.testing.assert_array_equal(data.values[channel.name][:, 0], expected)
        assert data.unit(channel.name) == channel.unit


@pytest.mark.parametrize("format_", ["mat", "csv"])
def test_time_data_is_kept_with_its_channels(tmp_path, format_):
    data = TimeData(CHANNELS, np.random.default_rng(0).normal(size=(3, 50)), 5000.0, point=2, specimen="beam")
    path = tmp_path / f"time.{format_}"
    write_contents([encoded(data)], path, format_)
    assert_same(import_file(path), data)


def test_several_objects_are_a_structure_array_of_which_one_is_chosen(matrix, tmp_path):
    path = tmp_path / "levels.mat"
    other = matrix.select(["v"])
    write_contents([encoded(matrix), encoded(other)], path, "mat")
    assert len(stored_objects(read_mat(path))) == 2
    assert_same(import_file(path, item=1), matrix)
    assert_same(import_file(path, item=2), other)


def test_every_kind_has_a_name_of_its_own():
    known = exchanges()
    assert len({one.name for one in known}) == len({one.type for one in known}) == len(known)


def test_numbers_of_a_table_are_those_that_numpy_reads(backbone, tmp_path):
    path = Path(tmp_path / "backbone.csv")
    write_contents([encoded(backbone)], path, "csv")
    names = path.read_text().splitlines()[2].split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=4)
    np.testing.assert_array_equal(table[:, names.index("force_n")], backbone.force_n)
    row = names.index(f"harmonics[{backbone.channels[0].name}:1].re")
    np.testing.assert_array_equal(
        table[:, row] + 1j * table[:, row + 1], [point.harmonics[0, 1] for point in backbone.points]
    )


def test_a_backbone_as_mat_holds_modal_frequency_and_damping_as_identified(backbone, mode, tmp_path):
    path = tmp_path / "backbone.mat"
    write_contents([encoded(backbone)], path, "mat")
    stored = loadmat(path, simplify_cells=True)["backbone"]
    np.testing.assert_allclose(stored["damping_ratio"], mode.damping_ratio, rtol=1e-12)
    np.testing.assert_allclose(stored["modal_frequency_hz"], mode.modal_frequency_hz, rtol=1e-12)
    assert (stored["units"]["damping_ratio"], stored["units"]["modal_frequency_hz"]) == ("1", "Hz")


def test_a_backbone_without_a_mode_shape_has_no_damping(backbone, tmp_path):
    path = tmp_path / "backbone.mat"
    write_contents([encoded(replace(backbone, drive_mode_shape=None))], path, "mat")
    assert "damping_ratio" not in loadmat(path, simplify_cells=True)["backbone"]
