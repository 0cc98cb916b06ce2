import numpy as np
import pytest

from identification import ContinuousBackbone, IdentificationError, SlowFlow, continuous_backbone, slow_flow
from tests.identification.slow_flows.ramps import (
    CHANNELS,
    PHI,
    RATE_HZ,
    damping_ratio,
    half_cosine,
    modal_rad_s,
    ramp,
)
from tests.refused import refused

LEVELS = np.geomspace(1.2e-4, 1.9e-3, 9)


def ramps(excess: float = 0.0, seed: int = 0, noise: tuple[float, float] = (1e-3, 5e-3)) -> tuple[SlowFlow, SlowFlow]:
    """Sixty periods up and sixty down; ``excess`` damping on the way up, as much too little on the way down."""
    ways = [
        ramp(half_cosine(low, high, 2.4), 2.4, noise=noise, seed=2 * seed + n, excess=sign * excess)
        for n, (low, high, sign) in enumerate([(1e-4, 2e-3, 1.0), (2e-3, 1e-4, -1.0)])
    ]
    up, down = (
        slow_flow(way.theta, way.samples, CHANNELS, sample_rate_hz=RATE_HZ, drive_mode_shape=PHI) for way in ways
    )
    return up, down


def found(excess: float = 0.0, seed: int = 0) -> ContinuousBackbone:
    return continuous_backbone(*ramps(excess, seed), levels_m=LEVELS)


def test_ramps_up_and_down_give_the_backbone() -> None:
    mode = found().nonlinear_mode()
    np.testing.assert_allclose(mode.amplitude_m, LEVELS, rtol=1e-12)
    np.testing.assert_allclose(mode.modal_frequency_hz, modal_rad_s(LEVELS) / (2 * np.pi), rtol=2e-4)
    np.testing.assert_allclose(mode.damping_ratio, damping_ratio(LEVELS), rtol=0.02)
    assert mode.source == "continuous backbone"


def test_a_bias_of_opposite_signs_cancels_and_is_given_as_systematic_error() -> None:
    backbone = found(excess=0.08)
    mode = backbone.nonlinear_mode()
    up, down = backbone.damping_ratio
    np.testing.assert_allclose(up, 1.08 * damping_ratio(LEVELS), rtol=0.02)
    np.testing.assert_allclose(down, 0.92 * damping_ratio(LEVELS), rtol=0.02)
    np.testing.assert_allclose(mode.damping_ratio, damping_ratio(LEVELS), rtol=0.02)
    np.testing.assert_allclose(mode.systematic("damping_ratio"), 0.08 / 3.0 * damping_ratio(LEVELS), rtol=0.2)
    assert np.all(mode.damping_ratio_std >= mode.systematic("damping_ratio"))
    inside = mode.interval("damping_ratio")
    assert np.all((inside[:, 0] < damping_ratio(LEVELS)) & (damping_ratio(LEVELS) < inside[:, 1]))


def test_without_hysteresis_no_systematic_error_stands_out() -> None:
    mode = found().nonlinear_mode()
    assert np.all(mode.systematic("damping_ratio") < 0.01 * mode.damping_ratio)


def test_random_errors_are_those_of_the_noise_or_more() -> None:
    noisy = [continuous_backbone(*ramps(seed=seed, noise=(0.01, 0.05)), levels_m=LEVELS[:4]) for seed in range(8)]
    values = np.mean([one.damping_1_s for one in noisy], axis=1)
    claimed = np.sqrt(np.mean([0.25 * np.sum(one.damping_std_1_s**2, axis=0) for one in noisy]))
    assert 0.8 < claimed / np.sqrt(np.mean(np.var(values, axis=0, ddof=1))) < 2.2


def test_levels_are_chosen_over_what_both_ramps_cover() -> None:
    up, down = ramps()
    backbone = continuous_backbone(up, down, number=6)
    assert backbone.amplitude_m.size == 6
    assert backbone.amplitude_m[0] >= max(up.amplitude_m.min(), down.amplitude_m.min())
    assert backbone.amplitude_m[-1] <= min(up.amplitude_m.max(), down.amplitude_m.max())
    assert backbone.periods == pytest.approx(2 * 57, rel=0.05)


def test_levels_beyond_the_ramps_and_ramps_that_do_not_meet_are_refused() -> None:
    up, down = ramps()
    with refused(IdentificationError, field="levels_m"):
        continuous_backbone(up, down, levels_m=[5e-3])
    with refused(IdentificationError, "in-common", field="up, down"):
        continuous_backbone(up.select(up.amplitude_m < 4e-4), down.select(down.amplitude_m > 6e-4))


def test_a_fast_ramp_is_not_biased_by_the_window_in_which_the_level_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ways of 30 periods; the window alone raises the frequency by (f_l + f_ll) r^2 s^2 / 2, here by 0.01 %."""
    ways = [ramp(half_cosine(*ends, 1.2), 1.2) for ends in ((1e-4, 2e-3), (2e-3, 1e-4))]
    flows = [slow_flow(way.theta, way.samples, CHANNELS, sample_rate_hz=RATE_HZ, drive_mode_shape=PHI) for way in ways]
    levels = np.geomspace(6e-4, 1.5e-3, 5)

    def errors() -> np.ndarray:
        mode = continuous_backbone(flows[0], flows[1], levels_m=levels, bandwidth=0.08).nonlinear_mode()
        return mode.modal_frequency_hz / (modal_rad_s(levels) / (2 * np.pi)) - 1.0

    assert np.abs(errors()).max() < 3e-5
    monkeypatch.setattr("identification.slow_flows.continuous.WINDOW_VARIANCE", 0.0)
    assert errors().max() > 1e-4
