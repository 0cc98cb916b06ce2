"""Decay campaigns: 0 V at once under armed limits, and the structure's own damping beside the settled point."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import binomtest

import rig
from identification import Backbone, DecayBackbone, nonlinear_mode
from rig.bench import Bench, load_bench
from rig.campaigns.decay.plan import DecayPlan
from rig.campaigns.kinds import kinds_that_yield
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.measurements import backbone, decays, point_rows
from rig.tick.safety.layout import GuardMode
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.tick.blocks import nothing_told


def decay(name="magnet-beam", **changes):
    return DecayPlan.model_validate(load_plan(f"{name}/decay").model_dump() | changes)


@pytest.fixture(scope="module")
def magnet():
    with rig.run(decay(levels_v=[1.0, 1.8]), seed=3) as run:
        yield run.recording


@pytest.fixture(scope="module")
def friction():
    with rig.run(decay("friction-beam", levels_v=[0.41191]), seed=3) as run:
        yield run.recording


def against_harmonic_balance(found, specimen, near_hz):
    """Errors of modal frequency and damping in half widths of their intervals, and the relative error of the damping."""
    truth = phase_resonance_backbone(
        VirtualRig.shipped(specimen), amplitudes_m=found.amplitude_m[::-1], excitation="pure-sine", near_hz=near_hz
    )
    frequency = found.modal_frequency_hz - truth.modal_frequency_hz[::-1]
    damping = found.damping_ratio - truth.damping_ratio[::-1]
    return (
        frequency / found.modal_frequency_bound_95_hz,
        damping / found.damping_ratio_bound_95,
        damping / truth.damping_ratio[::-1],
    )


def test_the_exciters_part_is_taken_out_of_the_decay_of_the_magnet_beam(magnet):
    found = decays(magnet)
    assert set(found) == {0, 1}
    inside = []
    for one in found.values():
        mode = one.mode()
        assert np.all(mode.decay_ratio > 0.07)  # 0.4 % without the exciter
        frequency, damping, relative = against_harmonic_balance(mode, "magnet-beam", 24.4)
        inside += [*np.abs(frequency), *np.abs(damping)]
        assert np.abs(relative[:3]).max() < 0.04
    held = int(np.count_nonzero(np.array(inside) < 1.0))
    assert binomtest(held, len(inside), 0.93, alternative="less").pvalue > 0.01


@pytest.mark.slow
def test_the_friction_beam_decays_along_its_backbone_over_a_decade(friction):
    mode = decays(friction)[0].mode()
    _, damping, relative = against_harmonic_balance(mode, "friction-beam", 149.0)
    upper = mode.amplitude_m > 0.1 * mode.amplitude_m[0]
    assert upper.sum() >= 5
    assert np.abs(relative[upper]).max() < 0.03
    assert np.mean(np.abs(damping) < 1.0) >= 0.9


def test_the_note_says_what_is_left_of_the_accuracy(magnet):
    (note,) = decays(magnet)[0].notes
    assert "using the measured force" in note
    assert "drive_mode_shape" in note


def test_the_settled_points_are_a_backbone_as_any_other(magnet):
    mode = nonlinear_mode(backbone(magnet))
    truth = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), voltages_v=[1.0, 1.8])
    np.testing.assert_allclose(mode.modal_frequency_hz, truth.modal_frequency_hz, rtol=2e-4)
    assert "decay" in kinds_that_yield(Backbone)
    assert kinds_that_yield(DecayBackbone) == ("decay",)


def test_the_output_is_at_0_v_from_one_sample_to_the_next_and_the_guard_stays_armed(magnet):
    rows = point_rows(magnet, 1)
    release = int(np.flatnonzero(rows["segment"] == rows["segment"][-1])[0])
    amplitude = np.abs(rows["command_v"])
    off = release - 20 + np.flatnonzero(amplitude[release - 20 :] == 0.0)
    assert amplitude[off[0] - 1] == pytest.approx(1.8, rel=1e-3)
    assert abs(off[0] - release) <= 8  # the device's latency
    assert np.all(rows["output_v"][off[0] :] == 0.0)
    assert np.all(rows["guard"] == GuardMode.ARMED)
    still = rows["frequency_hz"][off[0] :]
    np.testing.assert_allclose(still, still[0], rtol=1e-6)


def test_every_run_ends_at_0_v_by_the_one_ramp(magnet):
    part = magnet.parts[-1]
    rows = part.read(part.n_rows - 10, part.n_rows)
    assert np.all(rows["output_v"] == 0.0)
    assert magnet.parts[-1].end["reason"] == "completed"


def test_a_limit_trips_during_the_decay_and_latches():
    """A knock during the decay: force and motion beyond their limits, at an output of 0 V."""
    import math

    from controller import AmplitudeLaw, preset
    from rig.tick.kernels import tick_block
    from rig.tick.safety.layout import EndReason
    from rig.tick.sequencer.layout import SegmentKind
    from rig.tick.sequencer.segments import Segment, SettleRule
    from rig.tick.tick import Tick, TickSettings
    from tests.rig.rigs import bench_with

    bench = bench_with()
    held = [Segment(SegmentKind.HOLD, -1, 0.5, 5.0), Segment(SegmentKind.RELEASE, -1, 0.5, 1000.0)]
    tick = Tick(TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), held), 1.5)
    outputs, reasons = [], []
    for sample in range(6000):
        theta = 2.0 * math.pi * 24.0 * sample / bench.sample_rate_hz
        volts = np.full((1, len(bench.channels)), 0.01 * math.cos(theta))
        if 4000 <= sample < 4004:
            volts[0, 1] = 0.98 * bench.channels[1].range_v
        readings, rows = tick.buffers(1)
        out = np.zeros(1)
        tick_block(tick.arrays, volts, np.zeros(1, np.uint16), readings, rows, out, *nothing_told(1))
        outputs.append(out[0])
        reasons.append(int(tick.guard["reason"][0]))
    released = 1 + max(index for index, value in enumerate(outputs) if value != 0.0)
    assert 5 * bench.sample_rate_hz / 26.0 < released < 3000
    assert reasons[3999] == EndReason.NONE
    assert EndReason(reasons[4010]).is_trip
    assert reasons[-1] == reasons[4010]
    assert not np.any(outputs[released:])


def test_a_stop_during_the_decay_ends_the_run(tmp_path):
    from controller import AmplitudeLaw, preset
    from rig.tick.kernels import tick_block
    from rig.tick.safety.layout import EndReason
    from rig.tick.sequencer.layout import SegmentKind
    from rig.tick.sequencer.segments import Segment, SettleRule
    from rig.tick.tick import Tick, TickSettings
    from tests.rig.rigs import bench_with

    bench = bench_with()
    segments = [Segment(SegmentKind.RELEASE, -1, 0.5, 1000.0)]
    tick = Tick(TickSettings(bench, preset("magnet-beam"), AmplitudeLaw.VOLTAGE, SettleRule(), segments), 1.5)
    readings, rows = tick.buffers(1)
    noise = np.random.default_rng(0).normal(size=(4000, 1, len(bench.channels))) * 1e-3
    for sample, volts in enumerate(noise):
        if sample == 100:
            tick.request_stop()
        tick_block(tick.arrays, volts, np.zeros(1, np.uint16), readings, rows, np.zeros(1), *nothing_told(1))
    assert int(tick.guard["reason"][0]) == EndReason.STOP_REQUESTED
    assert tick.over


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"decay_periods": 5}, {"field": "decay_periods", "value": 5}),
        ({"record_periods": 2}, {"field": "record_periods", "value": 2}),
        ({"decay_levels": 0}, {"field": "decay_levels", "value": 0}),
        ({"levels_v": []}, {"says": "at-least-one-level", "field": "levels_v"}),
    ],
)
def test_values_that_are_not_allowed_are_named(changes, message):
    with refused(ValidationError, **message):
        decay(**changes)


def test_a_harmonics_loop_is_refused():
    table = load_plan("magnet-beam/decay").model_dump()
    table["controller"]["harmonics"] = {"highest": 5}
    with refused(ValidationError, "harmonics-not-allowed-with-kind-decay", field="controller.harmonics"):
        DecayPlan.model_validate(table)


def test_a_plan_without_a_measured_plant_is_refused_before_anything_moves():
    with refused(ConfigurationError, "is-missing-rig-tune"):
        decay(plant=None).check(load_bench("magnet-beam"))


def test_a_decay_becomes_a_model_of_a_file(magnet, tmp_path):
    from rig.results.decay_backbone.options import DecayOptions
    from rig.results.files import load
    from rig.results.identify import identify_model
    from rig.results.nonlinear_mode.options import NonlinearModeOptions

    with refused(ConfigurationError, "decay-campaign-knows-it-from-its"):
        identify_model([magnet.path], DecayOptions(near="24"))
    found = identify_model([magnet.path], DecayOptions())
    assert isinstance(found, DecayBackbone)
    assert found.mode().amplitude_m[0] == pytest.approx(decays(magnet)[1].mode().amplitude_m[0])
    from rig.results.files import save

    save(found, tmp_path / "decay.h5")
    assert load(tmp_path / "decay.h5").mode().table() == found.mode().table()
    mode = identify_model([tmp_path / "decay.h5"], NonlinearModeOptions())
    assert mode.source == "free decay"


def released(how, decay_periods, **options):
    table = load_bench("magnet-beam").model_dump(mode="json", exclude_unset=True)
    table["driver"]["options"] |= {"at_zero_v": how, **options}
    plan = decay(levels_v=[1.8], decay_periods=decay_periods)
    return rig.run(plan, bench=Bench.model_validate(table), seed=3)


@pytest.mark.parametrize(
    ("how", "periods", "with_exciter"), [("open-circuit", 120, 0.031), ("stinger-dropped", 300, 0.004)]
)
def test_a_virtual_exciter_may_be_opened_or_dropped_at_the_release(how, periods, with_exciter):
    with released(how, periods) as run:
        mode = decays(run.recording)[0].mode()
    np.testing.assert_allclose(mode.decay_ratio[:3], with_exciter, rtol=0.06)
    _, damping, relative = against_harmonic_balance(mode, "magnet-beam", 24.4)
    assert np.abs(damping).max() < 1.0
    assert np.abs(relative[:4]).max() < 0.01


def test_a_way_to_release_that_does_not_exist_or_a_worn_specimen_is_refused():
    with refused(ConfigurationError, field="at_zero_v", value="unplugged"):
        released("unplugged", 60)
    wear = {"frequency_per_s": [-0.0004], "until_s": 60.0, "every_s": 0.1}
    with refused(
        ConfigurationError,
        field="driver.options.at_zero_v",
        value="open-circuit",
        allowed="'attached' for a specimen that wears",
    ):
        released("open-circuit", 60, wear=wear)
