from dataclasses import replace

import numpy as np
import pytest

from identification import Backbone, IdentificationError, SlowFlow, nonlinear_mode, short_point, slow_flow
from tests.identification.slow_flows.ramps import (
    CHANNELS,
    PHI,
    RATE_HZ,
    TIP,
    Ramp,
    damping_ratio,
    half_cosine,
    modal_rad_s,
    ramp,
)
from tests.refused import refused

NOISE = (1e-3, 5e-3)


def flow_of(record: Ramp) -> SlowFlow:
    return slow_flow(record.theta, record.samples, CHANNELS, sample_rate_hz=RATE_HZ, drive_mode_shape=PHI)


def approached(low_m: float, high_m: float, seed: int = 0, wobble_hz: float = 0.0) -> Ramp:
    """Fifteen periods: six on the way to the level, nine at it."""
    return ramp(half_cosine(low_m, high_m, 6 / 25), 15 / 25, noise=NOISE, seed=seed, wobble_hz=wobble_hz)


@pytest.mark.parametrize("wobble_hz", [0.0, 0.1])
def test_a_point_of_fifteen_periods_gives_the_settled_point_at_phase_resonance(wobble_hz: float) -> None:
    levels = np.geomspace(1e-4, 1.6e-3, 10)
    records = [approached(level, 1.25 * level, n, wobble_hz) for n, level in enumerate(levels)]
    points = [short_point(flow_of(record), start_s=6 / 25) for record in records]
    mode = nonlinear_mode(Backbone(tuple(point.vibration for point in points), "mode", PHI))
    size = 1.25 * levels
    np.testing.assert_allclose(mode.amplitude_m, size, rtol=5e-3)
    np.testing.assert_allclose(mode.modal_frequency_hz, modal_rad_s(mode.amplitude_m) / (2 * np.pi), rtol=2e-4)
    np.testing.assert_allclose(mode.damping_ratio, damping_ratio(mode.amplitude_m), rtol=0.02)
    np.testing.assert_allclose(mode.phase_lag_deg, 90.0, atol=1e-9)
    np.testing.assert_allclose(mode.force_n, 2 * mode.damping_ratio * modal_rad_s(size) ** 2 * size / PHI**2, rtol=0.01)
    tip = [abs(point.vibration.displacement_m("tip")[1]) / point.vibration.amplitude_m for point in points]
    np.testing.assert_allclose(tip, TIP, rtol=2e-3)


def test_the_nonlinear_mode_finds_what_the_point_says_with_its_standard_errors() -> None:
    point = short_point(flow_of(approached(3e-4, 4e-4)), start_s=6 / 25)
    mode = nonlinear_mode(Backbone((point.vibration,), "mode", PHI), draws=4000)
    assert mode.modal_frequency_hz[0] == pytest.approx(point.modal_frequency_hz, rel=1e-12)
    assert mode.damping_ratio[0] == pytest.approx(point.damping_ratio, rel=1e-12)
    assert mode.damping_ratio_std[0] == pytest.approx(point.damping_ratio_std, rel=0.2)
    assert mode.modal_frequency_std_hz[0] == pytest.approx(point.modal_frequency_std_hz, rel=0.2)


def test_doubt_about_other_modes_is_a_systematic_error() -> None:
    record = approached(3e-4, 4e-4)
    other = slow_flow(
        record.theta, record.samples, CHANNELS, sample_rate_hz=RATE_HZ, drive_mode_shape=PHI, residual_m_n=2e-6
    )
    sure, doubted = (short_point(flow_of(record), start_s=6 / 25, other_modes=one) for one in (None, other))
    shifted = short_point(other, start_s=6 / 25)
    apart = shifted.damping_ratio - sure.damping_ratio
    assert doubted.damping_ratio == sure.damping_ratio
    assert abs(apart) > 0.1 * sure.damping_ratio_std
    assert doubted.damping_ratio_std == pytest.approx(np.hypot(sure.damping_ratio_std, apart), rel=0.02)
    mode = nonlinear_mode(Backbone((doubted.vibration,), "mode", PHI), draws=4000)
    assert mode.damping_ratio_std[0] == pytest.approx(doubted.damping_ratio_std, rel=0.2)
    assert mode.systematic("damping_ratio")[0] > 0.0


def test_what_goes_with_the_growth_is_gone_at_the_end_of_the_approach() -> None:
    growth = 0.35  # 1/s, of an exponential approach; the joint feigns 3 % of damping per unit of it
    turns = np.arange(0.0, 20.0, 0.5)
    level = -0.1 * np.exp(-turns / 4.0)
    flow = flow_of(approached(3e-4, 4e-4))
    keep = np.zeros(flow.time_s.size, bool)
    keep[: turns.size] = True
    rate = 2j * np.pi * 25.0 + growth * np.exp(-turns / 4.0)
    damping = 2.0 * 0.004 * 157.0 * (1.0 + 0.03 * rate.real / growth)
    part = replace(
        flow.select(keep),
        time_s=turns[: keep.sum()] / 25.0,
        phase_periods=turns[: keep.sum()],
        drive_m=(4e-4 * np.exp(level))[: keep.sum()].astype(complex),
        rate_1_s=rate[: keep.sum()],
        dynamic_stiffness=(157.0**2 + damping * rate)[: keep.sum()],
    )
    point = short_point(part)
    assert point.damping_ratio == pytest.approx(0.004, rel=0.004)
    assert point.vibration.amplitude_m > 0.99 * 4e-4 * np.exp(level[: keep.sum()][-1])


def test_the_lag_and_the_growth_as_they_were_are_told() -> None:
    growing = ramp(half_cosine(3e-4, 4e-4, 1.2), 1.2)
    point = short_point(flow_of(growing), start_s=0.4, stop_s=0.8)
    assert point.growth_1_s == pytest.approx(np.log(4 / 3) * np.pi / 2 / 1.2, rel=0.1)
    assert point.force_n > point.vibration.force_n
    assert point.vibration.phase_lag_deg == pytest.approx(90.0, abs=1e-9)


def test_scatter_over_noise_is_what_the_point_claims() -> None:
    points = [short_point(flow_of(approached(3e-4, 4e-4, seed)), start_s=6 / 25) for seed in range(40)]
    damping = [point.damping_ratio for point in points]
    claimed = np.sqrt(np.mean([point.damping_ratio_std**2 for point in points]))
    assert 0.75 < claimed / np.std(damping) < 2.0
    assert np.mean(damping) == pytest.approx(damping_ratio(np.array(4e-4)), rel=0.01)


def test_too_short_a_point_and_too_large_a_change_are_refused() -> None:
    flow = flow_of(ramp(half_cosine(1e-4, 2e-3, 2.0), 2.0))
    with refused(IdentificationError, "periods-between", field="start_s, stop_s"):
        short_point(flow, start_s=1.0, stop_s=1.05)
    with refused(IdentificationError, "amplitude-changes", field="start_s, stop_s"):
        short_point(flow)


def test_a_reversed_force_is_refused_or_shows_as_negative_damping() -> None:
    record = approached(3e-4, 3e-4)
    record.samples[0] *= -1.0
    point = short_point(flow_of(record), start_s=6 / 25)
    assert point.damping_ratio < 0.0
    with refused(IdentificationError, "polarity", field="points"):
        nonlinear_mode(Backbone((point.vibration,), "mode", PHI))
