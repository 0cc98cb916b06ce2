"""Guesses of a proposed mapping: periods, transients, roles, channels in a matrix, the parts that are not told."""

import sys
import tomllib

import h5py
import numpy as np
import pytest
import scipy.io

from rig.exchange.child_reading import ImportFailed
from rig.exchange.proposal.guesses import dimensions, period_of, rate_in, role_of, transient_periods
from rig.exchange.proposal.proposal import proposed_mapping
from tests.refused import refused

RANDOM = np.random.default_rng(4)


@pytest.fixture(autouse=True)
def draws_of_its_own(monkeypatch):
    """Each test draws the same numbers, whatever has run before it."""
    monkeypatch.setattr(sys.modules[__name__], "RANDOM", np.random.default_rng(4))


@pytest.mark.parametrize(("period", "count"), [(100, 5), (333, 3), (512, 2), (64, 40)])
def test_the_period_of_a_repeated_signal_is_found(period, count):
    signal = np.tile(RANDOM.normal(size=period), count)
    assert period_of(signal + 0.002 * RANDOM.normal(size=signal.size)) == period


def test_what_does_not_repeat_has_no_period():
    t = np.arange(4000) / 1000.0
    assert period_of(RANDOM.normal(size=4000)) == 0
    assert period_of(np.sin(2 * np.pi * (5.0 + 10.0 * t) * t)) == 0
    assert period_of(np.zeros(4000)) == 0


def test_a_transient_ends_where_periods_differ_no_more_than_by_noise():
    steady, decay = np.sin(np.arange(200.0)), np.exp(-np.arange(1600.0) / 100.0)
    periods = (np.tile(steady, 8) + decay).reshape(8, 200) + 1e-3 * RANDOM.normal(size=(8, 200))
    assert transient_periods(periods) in (2, 3)  # exp(-4) of the size is above the noise, exp(-6) is not far from it
    assert transient_periods(periods[:2]) == 0


def test_dimensions_are_told_by_what_repeats_and_what_grows():
    one = RANDOM.normal(size=(64, 3, 2)) * np.array([1.0, 2.0])
    values = np.repeat(one[:, None], 4, axis=1)
    assert dimensions(values, 64) == ("sample", "period", "realisation", "level")


@pytest.mark.parametrize(
    ("name", "unit", "role"),
    [
        *(
            ("F", "", "force"),
            ("u2", "", "force"),
            ("hammer", "", "force"),
            ("Kraft", "", "force"),
            ("ch7", "lbf", "force"),
        ),
        *(("acc_tip", "", "motion"), ("x", "", "motion"), ("y1", "", "motion"), ("ch1", "g", "motion")),
        *(("voltage", "", "monitor"), ("ch3", "V", "monitor"), ("speed", "rpm", "monitor"), ("ch", "", "")),
    ],
)
def test_roles_are_guessed_by_unit_and_name(name, unit, role):
    assert role_of(name, unit)[0] == role


def test_sample_rates_are_guessed_by_the_names_of_single_numbers():
    assert rate_in({"mass": 3.0, "setup.Fs": 512.0}) == ("setup.Fs", 512.0)
    assert rate_in({"dt": 0.25}) == ("dt", 4.0)
    assert rate_in({"temperature": 20.0}) is None


def test_columns_of_the_only_matrix_are_channels_and_a_mean_is_remarked(tmp_path):
    columns = RANDOM.normal(size=(500, 3)) + np.array([0.0, 0.0, 2.0])
    scipy.io.savemat(tmp_path / "x.mat", {"data": columns, "fs": 100.0})
    text, missing = proposed_mapping([tmp_path / "x.mat"])
    table = tomllib.loads(text)
    assert not missing
    assert table["axes"] == ["sample", "channel"]
    assert [channel["index"] for channel in table["channels"]] == [1, 2, 3]
    assert [channel["role"] for channel in table["channels"]] == ["force", "drive", "response"]
    assert 'offset = "mean"' in text


def test_what_is_no_time_data_is_said_so(tmp_path):
    scipy.io.savemat(tmp_path / "few.mat", {"x": np.arange(5.0), "name": "beam"})
    with refused(ImportFailed, "few-mat-holds-no-array-of"):
        proposed_mapping([tmp_path / "few.mat"])
    with h5py.File(tmp_path / "ours.h5", "w") as file:
        file.attrs["format"], file.attrs["kind"] = "vibrolock", "backbone"
    with refused(ImportFailed, "is-file-of-this-program-of"):
        proposed_mapping([tmp_path / "ours.h5"])


def test_names_from_a_file_cannot_leave_their_comment(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file['evil"\nkind = "multisine'] = RANDOM.normal(size=300)
        file["y\x1b[31m"] = RANDOM.normal(size=300)
    text, _ = proposed_mapping([tmp_path / "x.h5"])
    assert tomllib.loads(text)["kind"] == "time-data"
    assert all(letter.isprintable() or letter == "\n" for letter in text)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("new mapping -o m.toml", "FILE: is missing"),
        ("new mapping nowhere.mat -o m.toml", "nowhere.mat: there is no such file"),
        ("new bench x.mat -o m.toml", "FILES: is for a mapping"),
        ("new mapping x.dat -o m.toml", "the ending says no format; give"),
    ],
)
def test_wrong_words_are_named(command, tmp_path, line, message):
    status, _, err = command(line)
    assert status
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "m.toml").exists()


def test_a_motion_without_a_force_is_a_decay_and_has_no_period(command, tmp_path):
    times = np.arange(12000) / 2000.0
    motion = np.exp(-2.0 * np.pi * 40.0 * 0.01 * times) * np.cos(2.0 * np.pi * 40.0 * times)
    scipy.io.savemat("decay.mat", {"x": motion, "fs": 2000.0})
    for line in (
        "new mapping decay.mat -o decay.toml",
        "import decay.mat --mapping decay.toml -o decay.h5",
        "identify decay.h5 --model decay -o backbone.h5 --json",
    ):
        command(line).succeeded()
    table = tomllib.loads((tmp_path / "decay.toml").read_text(encoding="utf-8"))
    assert [channel["role"] for channel in table["channels"]] == ["drive"]
    assert "period_samples" not in table


def test_channels_of_one_name_are_numbered_and_the_others_keep_theirs(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        for path in ("left/acc", "right/acc", "hammer", "tip"):
            file[path] = RANDOM.normal(size=300)
        file["fs"] = 1000.0
    table = tomllib.loads(proposed_mapping([tmp_path / "x.h5"])[0])
    names = [(channel["value"], channel["name"]) for channel in table["channels"]]
    assert names == [("left/acc", "acc_1"), ("right/acc", "acc_2"), ("hammer", "hammer"), ("tip", "tip")]
