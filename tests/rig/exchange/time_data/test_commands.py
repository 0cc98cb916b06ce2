"""From a foreign MAT file to a validated model, as it is typed; figures, reports and exports of time data."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from rig.results.files import load, save
from tests.identification.experiments.test_time_data import F0, ZETA, multisines

RATE_HZ, SIZE, SETTLING, PERIODS = 512.0, 512, 6, 2
A, CUBIC, GAIN = np.array([[1.0 - 0.09, 0.3 * 0.99], [-0.3, 0.99]]), 0.004, 0.1
NOISE = 1e-3
MAPPING = """kind = "time-data"
specimen = "circuit"
sample_rate_hz = 512.0
axes = ["sample", "period", "realisation", "level"]
transient_periods = 6
[[channels]]
name = "input"
role = "force"
unit = "V"
value = "u"
[[channels]]
name = "output"
role = "drive"
unit = "V"
value = "y"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A circuit with a cubic spring, which is itself a state-space model with monomials, at two levels; the first is small."""
    found, random = tmp_path_factory.mktemp("circuit"), np.random.default_rng(2)
    lines, n = np.arange(4, 120), SIZE * (SETTLING + PERIODS)
    u, y = np.zeros((2, SIZE, SETTLING + PERIODS, 3, 2))
    for level, size in enumerate((0.05, 1.0)):
        for one in range(3):
            spectrum = np.zeros(SIZE // 2 + 1, complex)
            spectrum[lines] = np.exp(2j * np.pi * random.random(lines.size))
            period = np.fft.irfft(spectrum)
            force, x = np.tile(size * period / period.std(), SETTLING + PERIODS), np.zeros((n + 1, 2))
            for k in range(n):
                bend = GAIN * force[k] - CUBIC * x[k, 0] ** 3
                x[k + 1] = A @ x[k] + bend * np.array([0.3, 1.0])
            u[:, :, one, level] = force.reshape(-1, SIZE).T
            y[:, :, one, level] = x[:-1, 0].reshape(-1, SIZE).T
    y += NOISE * random.normal(size=y.shape)
    scipy.io.savemat(found / "measured.mat", {"u": u, "y": y, "fs": RATE_HZ})
    (found / "mapping.toml").write_text(MAPPING)
    return found


@pytest.fixture
def typed(command, folder, monkeypatch):
    """What a command prints that succeeds, typed in the folder."""
    monkeypatch.chdir(folder)
    return lambda line: command(line).succeeded().out


@pytest.mark.slow
def test_a_foreign_mat_file_becomes_a_model_that_is_right_to_the_noise(typed):
    shown = typed("import measured.mat --mapping mapping.toml -o data.h5 --overwrite")
    assert "6 records at 512 Hz, periods of 512 samples" in shown
    assert "input  force     V" in shown
    line = "identify data.h5 --model pnlss --degrees 3 --no-output-polynomials --iterations 60 -o model.h5 --json --overwrite"
    summary = json.loads(typed(line))
    assert {run["use"] for run in summary["errors"]} == {"training", "validation"}
    of = load_rms("data.h5")
    for run in summary["errors"]:
        # The mean over two periods has 1 / sqrt(2) of the noise; the model cannot be better, and has few numbers.
        noise = NOISE / np.sqrt(PERIODS) / of[run["name"].removeprefix("data, ")]
        assert run["errors"]["output"] == pytest.approx(noise, rel=0.25)
    poles = np.linalg.eigvals(load_model("model.h5").a)
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(np.linalg.eigvals(A)), atol=2e-4)


def load_rms(name):
    data = load(Path(name))
    return {one.name: np.std(one.samples[1]) for one in data.records}


def load_model(name):
    return load(Path(name)).model


def test_a_proposed_mapping_finds_dimensions_rate_and_band(typed, folder):
    assert "roles and units to be checked" in typed("new mapping measured.mat -o proposed.toml --overwrite")
    text = (folder / "proposed.toml").read_text()
    for line in (
        "sample_rate_hz = 512.0",
        'axes = ["sample", "period", "realisation", "level"]',
        "lowest_hz = 4.0",
        "highest_hz = 119.0",
    ):
        assert f"\n{line}" in text
    shown = typed("import measured.mat --mapping proposed.toml -o proposed.h5 --overwrite")
    assert "excited 4 to 119 Hz" in shown


def test_linear_modes_of_the_low_level_keep_the_volts(typed, folder):
    data = scipy.io.loadmat(folder / "measured.mat")
    scipy.io.savemat(folder / "low.mat", {name: data[name][..., 0] for name in ("u", "y")})
    (folder / "low.toml").write_text(MAPPING.replace(', "level"]', "]"))
    typed("import low.mat --mapping low.toml -o low.h5 --overwrite")
    shown = typed("identify low.h5 --model linear -o modes.h5 --overwrite")
    assert "V RMS" in shown
    assert " N RMS" not in shown
    pole, modes = np.log(np.linalg.eigvals(A)[0]) * RATE_HZ, load(folder / "modes.h5").modes
    assert modes.frequency_hz == pytest.approx([abs(pole) / (2 * np.pi)], rel=1e-3)
    assert modes.damping_ratio == pytest.approx([-pole.real / abs(pole)], rel=0.03)


def test_a_generator_of_any_name_is_the_instrument_of_linear_modes(typed, folder):
    data = multisines(periods=4, noise=0.02, realisations=4)
    save(data, folder / "generator.h5")
    typed("identify generator.h5 --model linear -o generator-modes.h5 --overwrite")
    modes = load(folder / "generator-modes.h5").modes
    assert modes.frequency_hz == pytest.approx([F0], abs=4 * modes.frequency_std_hz[0])
    assert modes.damping_ratio == pytest.approx([ZETA], abs=4 * modes.damping_ratio_std[0])


def test_time_data_are_drawn_reported_exported_and_read_back(typed, folder):
    typed("import measured.mat --mapping mapping.toml -o data.h5 --overwrite")
    typed("plot data.h5 -o data.png")
    typed("report data.h5 -o report.html --overwrite")
    assert "time-data of circuit" in (folder / "report.html").read_text()
    typed("export data.h5 --item 2 -o two.mat --overwrite")
    typed("import two.mat -o two.h5 --overwrite")
    one, two = (load(folder / name) for name in ("data.h5", "two.h5"))
    np.testing.assert_array_equal(two.records[0].samples, one.records[1].samples)
    assert two.channels == one.channels
