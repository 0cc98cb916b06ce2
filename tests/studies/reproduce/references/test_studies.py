"""Reference studies on the data themselves, against the figures that were published; skipped where the data are not at hand."""

import json
import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from identification import FitSettings, pnlss_errors
from rig.errors import ConfigurationError, RecordingError
from rig.results.files import load
from studies.reproduce.references import bouc_wen, silverbox
from studies.reproduce.references.data import found
from studies.reproduce.references.studies import STUDIES
from tests.command import run_command
from tests.refused import refused


def data_of(name: str) -> tuple[Path, ...]:
    """The files of a study, from the folder that VIBROLOCK_DATA names."""
    folder = os.environ.get("VIBROLOCK_DATA")
    data = STUDIES[name].data
    try:
        return found(data, Path(folder) if folder else None)
    except ConfigurationError:
        pytest.skip(f"set VIBROLOCK_DATA to a folder that holds {data.needs} (not shipped)")


@pytest.fixture(scope="module")
def oscillator() -> silverbox.Oscillator:
    return silverbox.read(*data_of("silverbox"))


@pytest.fixture(scope="module")
def hysteresis() -> bouc_wen.HystereticData:
    return bouc_wen.read(*data_of("bouc-wen"))


def decibels(model, data):
    return 20.0 * np.log10(pnlss_errors(model, data.tests).rms[:, 0])


def test_the_arrow_of_the_silverbox_is_predicted_beyond_the_range_of_the_estimation(oscillator):
    fit = silverbox.fitted(oscillator, 0, settings=FitSettings(iterations=12))
    arrow = pnlss_errors(fit.model, oscillator.test)
    assert arrow.rms[0, 0] < 0.28e-3  # Paduart 2008: 0.26 mV
    assert arrow.range_use[0] > 1.3
    assert pnlss_errors(fit.linear, oscillator.test).rms[0, 0] > 5e-3


def test_polynomials_predict_a_hysteresis_to_ninety_decibels(hysteresis):
    fit = bouc_wen.fitted(hysteresis, degrees=(2, 3), output_degrees=(), settings=FitSettings(iterations=20))
    assert np.all(decibels(fit.model, hysteresis) < -90.0)
    assert decibels(fit.linear, hysteresis)[0] > -78.0


def test_a_few_saturating_features_predict_it_better_than_any_polynomial(hysteresis):
    fit = bouc_wen.fitted(hysteresis, saturating=10, seed=1, settings=FitSettings(iterations=30))
    assert decibels(fit.model, hysteresis)[0] < -98.0  # the best that was published for polynomials: -94.6 dB
    assert pnlss_errors(fit.model, hysteresis.tests).unbounded == 0


@pytest.mark.slow
def test_four_of_five_starts_are_far_beyond_what_was_published(hysteresis):
    reached = [
        decibels(bouc_wen.fitted(hysteresis, saturating=10, seed=seed).model, hysteresis)[0] for seed in range(5)
    ]
    assert sorted(reached)[3] < -111.0  # -112.3 dB; rounding moves it by some tenths


@pytest.mark.slow
def test_the_model_that_validation_data_choose_predicts_the_whole_arrow_to_a_quarter_millivolt(tmp_path):
    (path,) = data_of("silverbox")
    run_command(f"reproduce silverbox --data {path.parent} -o {tmp_path}").succeeded()
    results = json.loads((tmp_path / "reference.json").read_text())
    (chosen,) = [line for line in results["ours"] if line["chosen"]]
    # the smallest model within one standard error of the best, which is not always the best itself
    assert chosen["validation_mv"] < 1.2 * min(line["validation_mv"] for line in results["ours"])
    assert chosen["arrow_mv"] < 0.25
    assert load(tmp_path / "chosen.h5").model.specimen == "Silverbox"


def test_the_measured_beam_is_predicted_as_the_table_says(tmp_path):
    (path,) = data_of("brake-reuss")
    done = run_command(f"reproduce brake-reuss --data {path.parent} -o {tmp_path}").succeeded()
    results = json.loads((tmp_path / "reference.json").read_text())
    assert [line["method"] for line in results["ours"]] == ["0.19 N", "0.52 N", "0.95 N", "1.43 N"]
    for line in results["ours"]:
        assert abs(line["peak_percent"]) < 5.0
        assert abs(line["frequency_percent"]) < 0.25
        assert line["range_use"] < 0.9
        assert line["method"] in done.out
    for line in results["ours"][1:]:
        assert abs(line["recorded_peak_percent"]) < 3.0
        assert line["recorded_envelope_percent"] < 5.0
    assert (tmp_path / "reference.png").stat().st_size > 10_000
    assert load(tmp_path / "mode.h5").frequency_hz.size == 8


def test_contents_that_are_others_are_refused_by_name(tmp_path):
    path = tmp_path / "train.h5"
    with h5py.File(path, "w") as file:
        file["multisine/u"] = np.zeros(5)
    with refused(RecordingError, "train-holds-no-signals-and-in"):
        bouc_wen.read(path, path)
    with refused(RecordingError, "train-holds-no-signals-and"):
        silverbox.read(path)
