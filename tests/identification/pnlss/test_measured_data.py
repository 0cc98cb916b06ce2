"""Public benchmarks: a measured oscillator with a hardening spring, and a simulated hysteresis."""

import numpy as np
import pytest

from benchmarks.bouc_wen import identified as identified_hysteresis
from benchmarks.measured_data import BOUC_WEN, SILVERBOX, Benchmark, bouc_wen, path_of, silverbox
from benchmarks.silverbox import identified as identified_silverbox
from identification import pnlss_errors


@pytest.fixture(scope="module")
def oscillator() -> Benchmark:
    path = path_of(SILVERBOX)
    if path is None:
        pytest.skip(f"set VIBROLOCK_DATA to a folder that holds {SILVERBOX} from https://www.nonlinearbenchmark.org")
    return silverbox(path)


@pytest.fixture(scope="module")
def hysteresis() -> Benchmark:
    paths = [path_of(name) for name in BOUC_WEN]
    if None in paths:
        pytest.skip(
            f"set VIBROLOCK_DATA to a folder that holds {' and '.join(BOUC_WEN)} from https://github.com/forgi86/dynonet "
            "(MIT, not shipped)"
        )
    return bouc_wen(*paths)  # type: ignore[arg-type]


def test_the_arrow_of_the_silverbox_is_predicted_beyond_the_range_of_the_estimation(oscillator: Benchmark) -> None:
    found = identified_silverbox(oscillator, (2, 3), 12)
    arrow = pnlss_errors(found.model, oscillator.test)
    assert arrow.rms[0, 0] < 0.28e-3  # 0.26 mV; the linear model is above 5 mV
    assert arrow.range_use[0] > 1.3
    assert pnlss_errors(found.model, oscillator.validation).rms[0, 0] < 0.25e-3
    assert pnlss_errors(found.linear, oscillator.test).rms[0, 0] > 5e-3


def test_polynomials_predict_a_hysteresis_to_ninety_decibels(hysteresis: Benchmark) -> None:
    found = identified_hysteresis(hysteresis, 20, degrees=(2, 3), output_degrees=())
    error = pnlss_errors(found.model, hysteresis.test)
    assert np.all(20 * np.log10(error.rms[:, 0]) < -90.0)
    assert 20 * np.log10(pnlss_errors(found.linear, hysteresis.test).rms[0, 0]) > -78.0


def test_a_few_saturating_features_predict_it_better_than_any_polynomial(hysteresis: Benchmark) -> None:
    found = identified_hysteresis(hysteresis, 40, saturating=10, seed=1)
    error = pnlss_errors(found.model, hysteresis.test)
    assert 20 * np.log10(error.rms[0, 0]) < -98.0  # polynomials of degrees 2 and 3: -94 dB
    assert error.unbounded == 0
