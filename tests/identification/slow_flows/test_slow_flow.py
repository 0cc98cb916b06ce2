from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from identification import Channel, IdentificationError, SlowFlow, slow_flow
from simulators import Simulation, VirtualRig
from simulators.analysis import phase_resonance_backbone
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

UP = half_cosine(1e-4, 2e-3, 2.4)
LEVEL = half_cosine(3e-4, 3e-4, 2.0)


def flow_of(record: Ramp, **options: Any) -> SlowFlow:
    given: dict[str, Any] = {"sample_rate_hz": RATE_HZ, "drive_mode_shape": PHI, **options}
    return slow_flow(record.theta, given.pop("samples", record.samples), given.pop("channels", CHANNELS), **given)


def inner(flow: SlowFlow) -> slice:
    """Instants away from the ends, where the fits are one-sided."""
    return slice(6, flow.time_s.size - 6)


def test_frequency_and_damping_come_out_while_the_vibration_grows_twentyfold() -> None:
    flow = flow_of(ramp(UP, 2.4, wobble_hz=0.2), fit_periods=3.0)
    some = inner(flow)
    size = flow.amplitude_m[some]
    np.testing.assert_allclose(flow.modal_frequency_hz[some], modal_rad_s(size) / (2 * np.pi), rtol=3e-4)
    np.testing.assert_allclose(flow.damping_ratio[some], damping_ratio(size), rtol=0.02)
    assert flow.growth_1_s.max() > 1.5, "the vibration grows faster than it would decay freely"


def test_a_linear_mode_is_found_exactly_however_it_is_driven() -> None:
    flow = flow_of(ramp(UP, 2.4, wobble_hz=0.5, linear=True))
    some = inner(flow)
    np.testing.assert_allclose(flow.modal_frequency_hz[some], 25.0, rtol=2e-6)
    np.testing.assert_allclose(flow.damping_ratio[some], 0.004, rtol=2e-3)


def test_amplitude_lag_force_and_shape_are_those_of_the_moment() -> None:
    record = ramp(UP, 2.4)
    flow = flow_of(record)
    some = inner(flow)
    true = np.interp(flow.time_s, np.arange(record.size_m.size) / RATE_HZ, record.size_m)
    np.testing.assert_allclose(flow.amplitude_m[some], true[some], rtol=3e-3)
    np.testing.assert_allclose(flow.deflection_ratio("tip")[some], TIP, rtol=1e-9)
    w = 2 * np.pi * flow.modal_frequency_hz[some]
    settled = 2 * damping_ratio(true[some]) * w**2 * true[some] / PHI**2
    np.testing.assert_allclose(flow.resonant_force_n[some], settled, rtol=0.04)
    assert np.all(flow.force_n[some] > settled), "a growing vibration takes more force than a settled one"


def test_harmonics_of_the_force_do_not_disturb_and_are_measured() -> None:
    flow = flow_of(ramp(LEVEL, 2.0, second_harmonic_n=0.5))
    some = inner(flow)
    size = flow.amplitude_m[some]
    np.testing.assert_allclose(flow.damping_ratio[some], damping_ratio(size), rtol=2e-3)
    np.testing.assert_allclose(flow.force[some, 2], 0.5 * np.exp(0.3j), rtol=1e-4)


@pytest.mark.parametrize("unit", ["m", "m/s"])
def test_displacement_and_velocity_sensors_serve_as_well(unit: str) -> None:
    record = ramp(LEVEL, 2.0)
    x = record.size_m * np.exp(1j * record.theta)
    motion = x.real if unit == "m" else (1j * modal_rad_s(record.size_m) * x).real
    channels = (CHANNELS[0], Channel("drive", "drive", unit))
    flow = flow_of(record, samples=np.array([record.samples[0], motion]), channels=channels)
    some = inner(flow)
    np.testing.assert_allclose(flow.damping_ratio[some], damping_ratio(flow.amplitude_m[some]), rtol=1e-3)


def test_the_high_pass_of_the_sensors_does_no_harm() -> None:
    record = ramp(UP, 2.4)
    corner = np.exp(-2 * np.pi * 0.3 / RATE_HZ)
    passed = lfilter([corner, -corner], [1.0, -corner], record.samples, axis=1)
    plain, filtered = flow_of(record), flow_of(record, samples=passed)
    some = inner(plain)
    np.testing.assert_allclose(filtered.modal_frequency_hz[some], plain.modal_frequency_hz[some], rtol=2e-4)
    np.testing.assert_allclose(filtered.damping_ratio[some], plain.damping_ratio[some], rtol=0.01)


def test_the_residual_of_other_modes_matters_off_resonance_and_is_taken_out() -> None:
    record = ramp(LEVEL, 2.0, linear=True)
    turned = record.theta * (1.0 - 0.01)
    own = 3e-4 * np.exp(1j * turned)
    rate = 0.99j * modal_rad_s(np.zeros(1))[0]
    w = modal_rad_s(np.zeros(1))[0]
    force = (rate**2 + 0.008 * w * rate + w**2) * own / PHI**2
    residual = 4e-6
    motion = rate**2 * (own + residual * force)
    pure = Ramp(turned, np.array([force.real, motion.real, TIP * motion.real]), record.size_m)
    with_it, without = flow_of(pure, residual_m_n=residual), flow_of(pure)
    some = inner(with_it)
    np.testing.assert_allclose(with_it.damping_ratio[some], 0.004, rtol=5e-4)
    settled = 1.0 / (1.0 / (0.008j * w**2) + residual / PHI**2)
    np.testing.assert_allclose(with_it.stiffness[some], w**2 + settled.real, rtol=5e-6)
    assert np.abs(without.damping_ratio[some] / 0.004 - 1.0).min() > 3e-3


def test_skew_between_the_channels_is_taken_out() -> None:
    record = ramp(LEVEL, 2.0)
    late = record.samples.copy()
    late[0, 3:] = record.samples[0, :-3]
    right = flow_of(record, samples=late, skew_samples=[3.0, 0.0, 0.0])
    wrong = flow_of(record, samples=late)
    some = inner(right)
    true_hz = modal_rad_s(right.amplitude_m) / (2 * np.pi)
    np.testing.assert_allclose(right.modal_frequency_hz[some], true_hz[some], rtol=2e-6)
    assert np.abs(wrong.modal_frequency_hz / true_hz - 1.0)[some].min() > 2e-4, "the skew matters if left"


@pytest.mark.parametrize(
    ("noise", "at_most"),
    [((0.02, 0.0), 1.4), ((0.02, 0.05), 1.6), ((0.0, 0.05), 2.3)],
    ids=["of the force", "of both", "of the motion"],
)
def test_standard_errors_are_the_scatter_over_noise_or_more(noise: tuple[float, float], at_most: float) -> None:
    flows = [flow_of(ramp(LEVEL, 2.0, noise=noise, seed=seed)) for seed in range(12)]
    for name, std in (("damping_ratio", "damping_ratio_std"), ("modal_frequency_hz", "modal_frequency_std_hz")):
        values = np.array([getattr(flow, name)[12:-12:12] for flow in flows])
        claimed = np.sqrt(np.mean([getattr(flow, std)[12:-12:12] ** 2 for flow in flows]))
        assert 0.8 < claimed / np.std(values) < at_most


@pytest.mark.slow
def test_a_rig_driven_open_loop_from_rest_tells_its_properties_before_it_has_settled() -> None:
    rig = VirtualRig.shipped("magnet-beam", noise_scale=1.0)
    hz, periods = 24.5, 40
    theta = 2 * np.pi * hz * np.arange(int(periods / hz * RATE_HZ)) / RATE_HZ
    seen = Simulation(rig, seed=4).run(0.5 * (1 - np.cos(np.minimum(theta / 16, np.pi))) * np.cos(theta))
    channels = (CHANNELS[0], CHANNELS[1])
    samples = np.array([seen.measured["force"], seen.measured["drive"]])
    flow = slow_flow(theta, samples, channels, sample_rate_hz=RATE_HZ, drive_mode_shape=rig.drive_shape(24.4))
    level = int(np.argmin(np.abs(flow.phase_periods - 12.0)))
    forces = np.geomspace(0.02, 0.3, 12)
    truth = phase_resonance_backbone(rig, forces_n=forces)
    order = np.argsort(truth.amplitude_m)
    size = truth.amplitude_m[order]
    at = flow.amplitude_m[level]
    assert abs(flow.growth_1_s[level]) > 0.1, "it has not settled"
    assert flow.modal_frequency_hz[level] == pytest.approx(
        np.interp(at, size, truth.modal_frequency_hz[order]), rel=2e-4
    )
    assert flow.damping_ratio[level] == pytest.approx(np.interp(at, size, truth.damping_ratio[order]), rel=0.02)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"drive_mode_shape": 0.0}, {"field": "drive_mode_shape", "value": 0.0}),
        ({"harmonics": 0}, {"field": "harmonics", "value": 0}),
        ({"harmonics": 150}, {"says": "samples-per-period", "field": "harmonics"}),
        ({"fit_periods": 0.5}, {"field": "fit_periods", "value": 0.5}),
        ({"fit_periods": 60.0}, {"says": "covers", "field": "theta_rad"}),
        ({"points_per_period": 0}, {"field": "points_per_period", "value": 0}),
        ({"skew_samples": [1.0]}, {"field": "skew_samples"}),
        ({"samples": np.zeros((3, 5))}, {"field": "samples"}),
    ],
)
def test_bad_input_is_refused_by_name(changes: dict[str, Any], message: str) -> None:
    with refused(IdentificationError, **message):
        flow_of(ramp(LEVEL, 2.0), **changes)


def test_an_interval_without_instants_is_refused() -> None:
    with refused(IdentificationError, "no-instant", field="start_s, stop_s"):
        flow_of(ramp(LEVEL, 2.0)).between(5.0, 6.0)
