"""The shipped backbone of the friction-joint beam: the published numbers, and harmonic balance of the coupled rig."""

import numpy as np
import pytest

import rig
from identification import nonlinear_mode
from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.rig.rigs import bench_with


def test_the_published_backbone_comes_out_with_noise_and_converters():
    with rig.run("friction-beam/backbone", seed=3) as run:
        assert run.complete
        assert not any(point["warnings"] for point in run.recording.points[2:])
        mode = nonlinear_mode(run.backbone())
    assert mode.force_n[0] == pytest.approx(0.1, rel=0.02)
    assert mode.force_n[-1] == pytest.approx(16.6, rel=0.01)
    assert 100.0 * mode.frequency_shift == pytest.approx(-2.22, abs=0.03)
    assert 100.0 * mode.damping_ratio[0] == pytest.approx(0.171, abs=0.01)
    assert 100.0 * mode.damping_ratio[-1] == pytest.approx(1.322, abs=0.01)


def test_time_integration_and_harmonic_balance_agree_at_every_level():
    quiet = bench_with(name="friction-beam", noise_scale=0.0, converter={"adc_bits": 0, "dac_bits": 0})
    plan = load_plan("friction-beam/backbone")
    truth = phase_resonance_backbone(VirtualRig.shipped("friction-beam"), voltages_v=plan.levels)
    with rig.run(plan, bench=quiet) as run:
        assert run.complete
        mode = nonlinear_mode(run.backbone())
    assert mode.force_n.size == 11
    np.testing.assert_allclose(mode.frequency_hz, truth.frequency_hz, rtol=1e-4)
    np.testing.assert_allclose(mode.damping_ratio, truth.damping_ratio, rtol=5e-3)
    np.testing.assert_allclose(mode.force_n, truth.force_n, rtol=6e-3)


def test_the_bench_knows_the_mode_that_it_tests():
    facts = load_bench("friction-beam").specimen
    modes = VirtualRig.shipped("friction-beam").linear_modes
    tested = int(np.argmin(np.abs(modes.frequency_hz - facts.linear_frequency_hz)))
    assert facts.linear_frequency_hz == pytest.approx(modes.frequency_hz[tested], rel=1e-4)
    assert facts.drive_mode_shape == pytest.approx(modes.drive_shape[tested], rel=1e-5)
