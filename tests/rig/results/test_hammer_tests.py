"""Hammer tests from a MAT file to modes, and the options of linear models, as they are typed."""

import json

import numpy as np
import pytest
import scipy.io

from identification import FrequencyResponseMatrix
from rig.results.files import load, save
from tests.identification.hammer.virtual import DAMPING, FREQUENCY_HZ, SHAPES, record

MAPPING = """
kind = "hammer-test"
specimen = "plate"
sample_rate_hz = 2048.0
lowest_hz = 20.0
highest_hz = 300.0
channels = [
    { name = "hammer", role = "force", unit = "N", value = "F" },
    { name = "corner", role = "drive", unit = "g", value = "A1" },
    { name = "tip", role = "response", unit = "m/s2", value = "A2" },
]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hammer")
    hits = [record(2.2, [(0.1, height)], 60, seed) for seed, height in enumerate((60.0, 90.0, 75.0, 50.0))]
    hits.append(record(2.2, [(0.1, 80.0), (0.16, 20.0)], 60, 9))
    signals = np.array(hits)
    data = {"F": signals[:, 0].T, "A1": signals[:, 1].T / 9.80665, "A2": signals[:, 2].T}
    scipy.io.savemat(folder / "hits.mat", data)
    (folder / "hammer.toml").write_text(MAPPING)
    return folder


@pytest.fixture
def hammer(folder, command, tmp_path):
    """The command, in an empty folder with the imported test."""
    for name in ("hits.mat", "hammer.toml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    imported = command("import hits.mat --mapping hammer.toml -o hammer.h5 --json")
    assert imported.status == 0, imported.err
    (tmp_path / "imported.json").write_text(imported.out)
    return command


@pytest.mark.slow
def test_a_mat_file_becomes_modes_with_figures(hammer, tmp_path):
    shown = json.loads((tmp_path / "imported.json").read_text())
    assert [bool(hit["fault"]) for hit in shown["hits"]] == [False] * 4 + [True]
    assert shown["hits"][-1]["fault"].startswith("double hit: ")
    assert hammer("plot hammer.h5 -o hammer.png").status == 0
    made = hammer("identify hammer.h5 --model linear -o modes.h5 --json")
    modes = json.loads(made.out)
    np.testing.assert_allclose([mode["frequency_hz"] for mode in modes["modes"]], FREQUENCY_HZ, rtol=1e-5)
    np.testing.assert_allclose([mode["damping_ratio"] for mode in modes["modes"]], DAMPING, rtol=2e-3)
    np.testing.assert_allclose(modes["shapes"], SHAPES.T, rtol=2e-3)
    assert hammer("plot modes.h5 -o modes.png").status == 0


def test_starting_frequencies_order_and_weighting_can_be_typed(hammer, tmp_path):
    made = hammer("identify hammer.h5 --model linear --near 95,41,211 --order 12 --weighting relative -o two.h5 --json")
    assert made.status == 0, made.err
    assert len(json.loads(made.out)["modes"]) == 3
    assert load(tmp_path / "two.h5").stabilisation.orders.max() == 12


def test_the_refusal_names_an_option_that_there_is(hammer, tmp_path):
    found = load(tmp_path / "hammer.h5").responses
    noise = np.random.default_rng(1).normal(size=(*found.value.shape, 2)).view(np.complex128)[..., 0]
    nothing = FrequencyResponseMatrix(
        outputs=found.outputs, inputs=found.inputs, frequency_hz=found.frequency_hz, value=1.0 + 0.5 * noise
    )
    save(nothing, tmp_path / "noise.h5")
    refused = hammer("identify noise.h5 --model linear --order 6 -o none.h5")
    assert refused.status == 1
    assert "no pole is stable" in refused.err
    assert "--near" in refused.err


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--near 40,x", "--near = '40,x': allowed are frequencies above 0 Hz, with commas"),
        ("--near 40 --count 2", "--count: is the number of frequencies in --near"),
        ("--weighting most", "--weighting = 'most': allowed are auto, total, noise, relative"),
        ("--near 4000", "modes: frequencies are 4000 Hz; allowed:"),
    ],
)
def test_wrong_options_are_refused_in_one_line(hammer, tmp_path, line, message):
    refused = hammer(f"identify hammer.h5 --model linear {line} -o none.h5")
    assert refused.status == 1
    assert message in refused.err
    assert not (tmp_path / "none.h5").exists()


def test_a_wrong_mapping_and_faulty_hits_are_named(hammer, tmp_path):
    (tmp_path / "hammer.toml").write_text(MAPPING.replace('value = "F"', 'value = "f"'))
    refused = hammer("import hits.mat --mapping hammer.toml -o other.h5")
    assert refused.status == 1
    assert "channels.hammer: path 'f'" in refused.err
    (tmp_path / "hammer.toml").write_text(MAPPING + "trigger = 3\n")
    assert "trigger" in hammer("import hits.mat --mapping hammer.toml -o other.h5").err
    (tmp_path / "hammer.toml").write_text(MAPPING.replace("2048.0", "2048.0\nrecord_s = 5.0"))
    refused = hammer("import hits.mat --mapping hammer.toml -o other.h5")
    assert "0 of 5 count" in refused.err
    assert "cut short" in refused.err
    assert not (tmp_path / "other.h5").exists()
