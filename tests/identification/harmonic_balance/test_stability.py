"""Multipliers, folds and losses of stability against products of Jacobians, theory and disturbed simulations."""

import numpy as np
import pytest

from identification import PnlssModel, SteadyStates, harmonic_response, steady_state
from identification.harmonic_balance.stability import loss_of_stability
from tests.identification.models.pnlss.steady.oscillators import (
    DAMPING,
    HZ,
    RATE_HZ,
    after_disturbance,
    oscillator,
    phases,
    waveform,
)
from vibrolock.arrays import Complex, Float

FORCE_N, CUBIC = 1.2, 6e8


def over_a_period(model: PnlssModel, state: SteadyStates, samples: int) -> Complex:
    """Eigenvalues of the product of the Jacobians over a period that holds a whole number of samples."""
    theta = phases(state, 0, samples, model.sample_rate_hz)
    v = np.vstack([waveform(state.states[0], theta), waveform(state.inputs[0], theta)])
    slopes = model.state_features.derivatives(v)
    product = np.eye(model.states)
    for k in range(samples):
        product = (model.a + model.e @ slopes[:, : model.states, k]) @ product
    return np.linalg.eigvals(product)


@pytest.mark.parametrize("samples", [128, 124, 120, 64])
def test_multipliers_are_those_of_a_period(samples: int) -> None:
    model = oscillator(CUBIC, 1e6)
    state = steady_state(model, RATE_HZ / samples, FORCE_N, force="pure-sine", harmonics=9, largest_range_use=3.0)
    np.testing.assert_allclose(
        np.sort_complex(state.multipliers[0] ** samples),
        np.sort_complex(over_a_period(model, state, samples)),
        rtol=1e-7,
    )


def folds_in_continuous_time(force: float, cubic: float) -> Float:
    """Hz, lower first: where the one-harmonic response of the hardening oscillator turns back, from its cubic equation."""
    w0 = 2 * np.pi * HZ
    s = np.linspace(1e-9, 6e-5, 2_000_001)  # a^2
    k = w0**2 + 0.75 * cubic * s
    # (k - w)^2 + (2 z w0)^2 w = F^2 / s in w = W^2
    half = k - 2 * (DAMPING * w0) ** 2
    root = half**2 - k**2 + force**2 / s
    kept = root >= 0.0
    edges = []
    for sign in (1.0, -1.0):
        squared = half[kept] + sign * np.sqrt(root[kept])
        hz = np.sqrt(squared[squared > 0.0]) / (2 * np.pi)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(hz)))) + 1
        edges.extend(hz[turns])
    return np.sort(edges)


def test_folds_lie_where_theory_in_continuous_time_has_them() -> None:
    found = harmonic_response(oscillator(CUBIC, rate_hz=12800.0), FORCE_N, force="pure-sine", largest_range_use=3.0)
    exact = folds_in_continuous_time(FORCE_N, CUBIC)
    assert exact.size == 2
    assert exact[1] - exact[0] > 0.1
    np.testing.assert_allclose(np.sort(found.folds.frequency_hz), exact, rtol=2e-4)
    for multipliers, hz in zip(found.folds.multipliers, found.folds.frequency_hz, strict=True):
        at_the_fold = multipliers[np.argmin(np.abs(multipliers - 1.0))]
        assert abs(at_the_fold ** (12800.0 / hz) - 1.0) < 1e-5


def test_the_part_between_the_folds_is_unstable_and_nothing_else() -> None:
    found = harmonic_response(oscillator(CUBIC), FORCE_N, force="pure-sine", largest_range_use=3.0)
    hz = found.points.frequency_hz
    backwards = np.gradient(hz) < 0.0
    assert 5 < np.count_nonzero(backwards) < hz.size - 20
    turning = np.zeros(hz.size, dtype=bool)
    for edge in np.flatnonzero(np.diff(backwards.astype(int))):
        turning[edge - 1 : edge + 3] = True
    np.testing.assert_array_equal(found.points.stable[~turning], ~backwards[~turning])
    assert set(found.points.loss) == {"", "fold"}


def test_disturbed_simulations_come_back_to_stable_points_and_leave_others() -> None:
    model = oscillator(CUBIC, 1e6)
    found = harmonic_response(model, FORCE_N, force="pure-sine", harmonics=9, largest_range_use=3.0).points
    unstable = np.flatnonzero(~found.stable)
    points = [5, unstable[2], unstable[unstable.size // 2], unstable[0] - 8, unstable[-1] + 8, found.count - 5]
    for point in points:
        away = np.log(after_disturbance(model, found, int(point), 80)[20:])
        largest = np.abs(found.multipliers[point]).max() ** (RATE_HZ / found.frequency_hz[point])
        rate = np.polyfit(np.arange(60), away, 1)[0]
        assert (rate < 0.0) == found.stable[point]
        assert rate == pytest.approx(np.log(largest), abs=0.01)


def test_a_spring_that_the_force_modulates_doubles_the_period() -> None:
    model = oscillator(5e7, parametric=900.0)
    found = [
        steady_state(model, RATE_HZ / 64, force, force="pure-sine", harmonics=9, largest_range_use=3.0)
        for force in (0.3, 30.0)
    ]
    for state in found:
        np.testing.assert_allclose(
            np.sort(np.abs(state.multipliers[0] ** 64)), np.sort(np.abs(over_a_period(model, state, 64))), rtol=1e-6
        )
    assert [state.loss for state in found] == [("",), ("period doubling",)]
    away = after_disturbance(model, found[1], 0, 12, share=1e-8)
    assert away[10] / away[4] == pytest.approx(float(np.abs(found[1].multipliers).max()) ** (6 * 64), rel=0.2)


def test_a_multiplier_says_what_becomes_of_the_vibration() -> None:
    angle = 2 * np.pi / 50.0
    for turn, kind in ((0.0, "fold"), (1.0, "fold"), (0.5, "period doubling"), (-0.5, "period doubling")):
        assert loss_of_stability(np.array([1.01 * np.exp(1j * turn * angle), 0.9]), angle) == kind
    assert loss_of_stability(1.01 * np.exp([0.3j * angle, -0.3j * angle]), angle) == "Neimark-Sacker"
    assert loss_of_stability(np.array([0.99, -0.98]), angle) == ""
    assert loss_of_stability(np.array([1.01, 0.9j]), angle, real=False) == ""


def test_a_vibration_that_is_modulated_is_told_from_one_that_jumps() -> None:
    late = oscillator(5e7, rate_hz=400.0, damping=0.004)
    slow = PnlssModel(**{**vars(late), "e": late.b @ late.f[:1]})  # the spring acts a sample late and feeds vibration
    found = harmonic_response(slow, 0.6, force="pure-sine", largest_range_use=3.0)
    assert "Neimark-Sacker" in found.points.loss
    assert any("the amplitude is modulated" in note for note in found.notes)
    growth = np.abs(found.points.multipliers).max(axis=1) ** (400.0 / found.points.frequency_hz)
    point = next(k for k, loss in enumerate(found.points.loss) if loss == "Neimark-Sacker" and growth[k] > 1.025)
    away = np.log(after_disturbance(slow, found.points, point, 200, share=1e-7)[20:])
    assert np.polyfit(np.arange(180), away, 1)[0] == pytest.approx(np.log(growth[point]), rel=0.25)
