"""What counts as unbounded, and how much of the trained range a run uses."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Channel, Features, coupled_run
from tests.identification.models.pnlss.steady.oscillators import oscillator, shaker
from tests.identification.models.pnlss.systems import linear_system


def test_a_run_ends_where_an_output_is_no_longer_finite() -> None:
    linear = linear_system(2, 1, 2)
    model = linear.with_features(Features.none(2, 1), Features.monomials(2, 1, (3,), of=(2,)))
    model = replace(model, f=np.array([[0.0], [1.0]]))
    inputs = np.ones((1, 50))
    inputs[0, 30] = 1e110  # whose cube is beyond all numbers; the states stay as bounded as they were
    run = model.simulate(inputs)
    assert run.unbounded_at == 30
    assert np.isfinite(run.outputs[:, :30]).all()
    assert np.isnan(run.outputs[:, 30:]).all()
    assert not run.bounded


def test_a_state_that_never_moved_in_training_makes_no_use_of_the_range() -> None:
    model = replace(linear_system(2, 1, 1), state_range=np.array([0.0, 50.0]), input_range=np.array([2.0]))
    run = model.simulate(np.ones((1, 50)))
    assert run.bounded
    assert np.isnan(run.state_use[0])
    assert run.range_use == pytest.approx(max(0.5, np.abs(run.states[1]).max() / 50.0))


def test_a_run_with_an_exciter_ends_there_too() -> None:
    plain = oscillator(rate_hz=800.0)
    model = replace(
        plain,
        outputs=(*plain.outputs, Channel("strain", "monitor", "1")),
        c=np.vstack([plain.c, np.zeros(2)]),
        d=np.vstack([plain.d, [[0.0]]]),
        f=np.vstack([plain.f, np.zeros(plain.f.shape[1])]),
        state_range=np.array([0.0, 1.0]),
    )
    voltage = 2.0 * np.cos(2 * np.pi * 25.0 / 800.0 * np.arange(2000))
    bounded = coupled_run(model, shaker(), voltage, lowest_hz=10.0)
    assert bounded.bounded
    assert np.isnan(bounded.state_use[0])
    assert np.isfinite(bounded.range_use)
    reached = 0.5 * np.abs(bounded.force_n).max()
    strain = np.array(model.d)
    strain[3] = np.finfo(float).max / reached  # beyond all numbers at a larger force
    found = coupled_run(replace(model, d=strain), shaker(), voltage, lowest_hz=10.0)
    assert found.unbounded_at == int(np.argmax(np.abs(bounded.force_n) > reached))
    assert np.isnan(found.force_n[found.unbounded_at :]).all()
