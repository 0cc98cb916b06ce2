"""A tuning finds what the virtual rig is made of, and its plan runs as it is."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure

import rig
from identification import nonlinear_mode
from rig.arming.run_options import RunOptions, Silent
from rig.bench import Bench
from rig.campaigns.plans import load_plan
from rig.errors import ConfigurationError
from rig.measurements import spectra
from rig.recording.reader import Recording
from rig.tuning import TuningError, TuningRequest, tune
from rig.tuning.design import choose as choose_gains
from rig.tuning.figure import draw_on
from rig.tuning.levels import LowestForce, choose_levels
from rig.tuning.plant import UnsuitedError, compared_with_bench
from rig.tuning.report import summary
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.rigs import bench_with
from tests.rig.tuning.tuned import tuned_once

NAMES = ("magnet-beam", "friction-beam")


@pytest.fixture(params=NAMES)
def tuned(request):
    return tuned_once(request.param)


@pytest.fixture
def magnet():
    return tuned_once("magnet-beam")


def coupled_pole_of(virtual, near_hz):
    """Eigenvalue of the rig's linear part, exciter included, that is nearest to a frequency."""
    poles = np.linalg.eigvals(virtual.plant.dynamics)
    return complex(poles[np.argmin(np.abs(poles - 2j * np.pi * near_hz))])


@pytest.mark.slow
def test_the_structure_is_found_as_it_was_made(tuned):
    mode = VirtualRig.shipped(tuned.bench.name).linear_modes
    truth = int(np.argmin(np.abs(mode.frequency_hz - tuned.bench.specimen.linear_frequency_hz)))
    assert tuned.plant.frequency_rad_s / (2 * math.pi) == pytest.approx(mode.frequency_hz[truth], rel=2e-4)
    # at the level of the multisine the joint's damping is 2.5 % higher; a seed scatters by 0.6 %
    assert tuned.plant.damping_ratio == pytest.approx(mode.damping_ratio[truth], rel=0.045)
    assert tuned.plant.drive_shape == pytest.approx(tuned.bench.specimen.drive_mode_shape, rel=2e-3)


def test_the_pole_that_the_response_loop_cancels_is_that_of_the_coupled_rig(tuned):
    hertz = tuned.plant.coupled_pole_rad_s.imag / (2 * math.pi)
    truth = coupled_pole_of(VirtualRig.shipped(tuned.bench.name), hertz)
    offset = truth - 1j * tuned.plant.lock_frequency_rad_s()
    assert tuned.chosen.cancels * complex(*tuned.plan.controller.plant_pole_rad_s) == pytest.approx(
        offset, abs=0.03 * abs(offset)
    )


def test_the_level_is_told_from_noise_and_far_from_the_limits(tuned):
    assert min(tuned.test.coherence) > 0.999
    with Recording(tuned.recording) as recording:
        peak = max(point["voltage_peak_v"] for point in recording.latest.values())
        assert recording.complete
        assert list(spectra(recording)) == [tuned.test.level_rms_v]
    assert peak < 0.1 * tuned.bench.limits.voltage_v


def test_the_closed_form_is_taken_only_where_its_assumptions_hold(tuned):
    failed = tuned.chosen.closed_form.failed
    assert bool(failed) == (tuned.bench.name == "friction-beam")


def test_every_loop_is_stable_with_its_margins_at_all_dampings(tuned):
    for design in (tuned.chosen.design, *tuned.chosen.others):
        assert design.suited
        assert design.frequency_margins.sensitivity_peak < 3
    assert tuned.chosen.design.frequency_margins.sensitivity_peak < 2
    assert tuned.chosen.outside[0] < 0.5


def test_the_plan_runs_as_it_is_onto_the_curve_of_harmonic_balance(tuned):
    plan = tuned.plan
    levels = plan.levels_m[3::2]  # some of them, for time
    plan = plan.model_copy(update={"levels_m": levels, "start_v": tuned.levels.needed_v[3]})
    with rig.run(plan, bench=tuned.bench, seed=1) as run:
        assert run.complete
        settled = [point["settle_periods"] for point in run.recording.points]
        mode = nonlinear_mode(run.backbone())
    assert max(settled) < 250
    virtual = VirtualRig.shipped(tuned.bench.name)
    for force, hertz, damping in zip(mode.force_n, mode.modal_frequency_hz, mode.damping_ratio, strict=True):
        truth = phase_resonance_backbone(virtual, forces_n=np.geomspace(0.2 * force, force, 5))
        assert hertz == pytest.approx(truth.modal_frequency_hz[-1], rel=2e-4)
        assert damping == pytest.approx(truth.damping_ratio[-1], rel=0.02)


def test_a_wrong_mode_shape_of_the_bench_is_said_and_not_used(magnet):
    wrong = bench_with({"specimen": {"drive_mode_shape": 1.5 * 0.908466}})
    (said,) = compared_with_bench(wrong, magnet.plant)
    assert "1.50 times" in said
    assert "2.25 times" in said
    assert magnet.plan.controller.drive_mode_shape == pytest.approx(0.908466, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_a_linear_frequency_that_is_30_percent_off_is_refused_with_the_measured_one(factor, tmp_path):
    wrong = bench_with({"specimen": {"linear_frequency_hz": factor * 24.37}})
    with refused(TuningError, "lies-at-24-3-hz", field="specimen.linear_frequency_hz", value=factor * 24.37):
        tune(wrong, tmp_path / "test.h5", TuningRequest(level_rms_v=0.02))


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"level_rms_v": 5.0}, {"allowed": "peaks above 0 and up to 9.5 V"}),
        ({"level_rms_v": -1.0}, {"field": "level_rms_v", "value": -1.0, "allowed": "above 0"}),
        ({"law": "pid"}, {"field": "law", "value": "pid", "allowed": "frequency-error, phase"}),
        ({"to_m": 0.02}, {"says": "up-to-channel-mode-shape-moves", "field": "to_m", "value": 0.02}),
        ({"to_m": 0.005}, {"field": "to_m", "value": 0.005}),
        ({"from_m": 0.002, "to_m": 0.001}, {"field": "from_m", "value": 0.002, "allowed": "below `to_m` = 0.001 m"}),
        ({"points": 0}, {"field": "points", "value": 0}),
    ],
)
def test_what_cannot_be_is_refused_before_anything_moves(request_, said, tmp_path):
    with refused(ConfigurationError, **said):
        tune("magnet-beam", tmp_path / "test.h5", TuningRequest(**request_))
    assert not (tmp_path / "test.h5").exists()


def test_levels_below_the_noise_are_refused_with_the_noise():
    tuning = tuned_once("magnet-beam")
    choice = partial(choose_levels, tuning.bench, tuning.plant, tuning.response_ratios, highest_m=1e-4)
    with refused(ConfigurationError, "force-is-above-noise-no-level"):
        choice(lowest=LowestForce(10.0))
    with refused(ConfigurationError, "force-is-above-noise", field="from_m", value=2e-4):
        choice(lowest=LowestForce(1e-3), from_m=2e-4)


def sensors_with(name, **changes):
    sensors = [sensor.model_dump() for sensor in VirtualRig.shipped("magnet-beam").sensors]
    return [sensor | (changes if sensor["name"] == name else {}) for sensor in sensors]


@pytest.mark.parametrize("name", ["force", "drive"])
def test_a_dead_sensor_is_named(name, tmp_path):
    bench = bench_with(sensors=sensors_with(name, sensitivity_v_per_unit=1e-9, noise_rms=0.0))
    with refused(TuningError, f"dead-stuck-or-below-one-bit-{name}"):
        tune(bench, tmp_path / "test.h5")


def test_a_sensor_that_shows_noise_alone_is_named(tmp_path):
    table = bench_with(sensors=sensors_with("drive", sensitivity_v_per_unit=1e-6, noise_rms=200.0)).model_dump()
    with refused(TuningError, "coherence-of-channel-drive-needed-is"):
        tune(Bench.model_validate(table), tmp_path / "test.h5", TuningRequest(level_rms_v=0.05))


@pytest.mark.slow
def test_a_sensor_that_is_mounted_the_other_way_round_is_told(tmp_path):
    table = bench_with().model_dump()
    table["channels"] = [
        channel | {"sensitivity_v_per_unit": -channel["sensitivity_v_per_unit"]}
        if channel["role"] == "drive"
        else channel
        for channel in table["channels"]
    ]
    with refused(TuningError, "polarity"):
        tune(Bench.model_validate(table), tmp_path / "test.h5", TuningRequest(level_rms_v=0.02))


@pytest.mark.slow
def test_a_delay_that_no_gains_bear_makes_a_rig_unsuited_and_the_numbers_are_said(tmp_path):
    bench = bench_with(name="friction-beam", delay_samples=1000)
    with refused(TuningError, "unsuited-sets-of-gains-tried-max"):
        tune(bench, tmp_path / "test.h5", TuningRequest(level_rms_v=0.02))


@pytest.fixture
def measured(magnet, monkeypatch):
    """Levels that a tuning measures at; the test is that of the magnet beam, its first level 0.02 V RMS."""
    levels = []

    def measure(series, name, damping_of, level_rms_v=None, highest_hz=None):
        levels.append(level_rms_v)
        return replace(magnet.test, level_rms_v=level_rms_v or 0.02, share_of_limits=0.1, distortion=0.0)

    monkeypatch.setattr("rig.tuning.tuning.measure", measure)
    return levels


@pytest.mark.parametrize("unsuited", [1, 2, 3])
def test_a_rig_is_refused_only_after_a_test_at_other_levels(unsuited, magnet, measured, monkeypatch, tmp_path):
    def choose(*arguments):
        if len(measured) <= unsuited:
            raise UnsuitedError("the loop is unstable")
        return choose_gains(*arguments)

    monkeypatch.setattr("rig.tuning.tuning.choose", choose)
    if unsuited == 3:
        with refused(TuningError, "no-gains-suit-the-plant-at-either"):
            tune(magnet.bench, tmp_path / "test.h5")
    else:
        found = tune(magnet.bench, tmp_path / "test.h5")
        first, then = "the multisine at 0.02 V RMS", f"the plant at {measured[-1]:g} V RMS"
        assert f"no gains suit the plant as {first} shows it; those of this plan are for {then}" in found.notes
        assert found.test.level_rms_v == measured[-1]
    assert measured == [None, 0.04, 0.01][: unsuited + 1]


def test_a_rig_is_refused_at_once_at_a_level_that_was_asked_for(magnet, measured, monkeypatch, tmp_path):
    def choose(*_):
        raise UnsuitedError("the loop is unstable")

    monkeypatch.setattr("rig.tuning.tuning.choose", choose)
    with pytest.raises(UnsuitedError, match=r"^the loop is unstable$"):
        tune(magnet.bench, tmp_path / "test.h5", TuningRequest(level_rms_v=0.02))
    assert measured == [0.02]


@pytest.mark.parametrize(
    ("share", "coherence", "distortion", "levels"),
    [
        (0.1, 0.9999, 0.001, (0.04, 0.01)),
        (0.1, 0.9999, 0.02, (0.01,)),
        (0.3, 0.9999, 0.001, (0.01,)),
        (0.1, 0.95, 0.001, (0.04,)),
        (0.3, 0.95, 0.001, ()),
    ],
)
def test_other_levels_are_those_that_limits_noise_and_distortion_allow(magnet, share, coherence, distortion, levels):
    test = replace(
        magnet.test,
        level_rms_v=0.02,
        share_of_limits=share,
        coherence=(coherence, 1.0),
        distortion=distortion,
    )
    assert test.other_levels_v == pytest.approx(levels)


@pytest.mark.slow
def test_a_level_that_leaves_little_room_is_said_to(magnet, tmp_path):
    tuned = tune("magnet-beam", tmp_path / "test.h5", TuningRequest(level_rms_v=0.05, to_m=0.0037, points=3))
    assert [note for note in tuned.notes if "damping rises beyond 1.7" in note]
    assert not magnet.notes


def test_the_figure_names_what_a_test_engineer_looks_for(magnet):
    page = Figure(figsize=(11.0, 6.8), layout="constrained")
    draw_on(page, magnet)
    plant, gain, _, phase, loop_phase, _ = page.axes
    legend = {text.get_text() for text in gain.get_legend().get_texts()}
    margins = magnet.chosen.design.frequency_margins
    decibels = 20.0 * math.log10(margins.gain_margin)
    assert f"frequency loop: {decibels:.0f} dB, {margins.phase_margin_deg:.0f} deg" in legend
    assert len(legend) == 2
    curve = gain.get_lines()[0]
    crossover = np.interp(0.0, -np.log(curve.get_ydata()), curve.get_xdata())  # the gain falls through one
    assert crossover == pytest.approx(margins.crossover_rad_s / (2.0 * math.pi), rel=0.02)
    margin = 180.0 + np.interp(crossover, *loop_phase.get_lines()[0].get_data())
    assert margin == pytest.approx(margins.phase_margin_deg, abs=1.0)
    (coherence,) = phase.child_axes
    for line, known in zip(coherence.get_lines(), magnet.test.coherence, strict=True):
        seen = np.asarray(line.get_ydata())
        assert np.median(seen) > known - 1e-3  # of the mean over several periods, at most as noisy as one
        assert seen.max() <= 1.0
    measured = next(line for line in plant.get_lines() if line.get_marker() == ".")
    np.testing.assert_allclose(measured.get_ydata(), np.abs(magnet.test.responses.value[:, 0, 0]))


@pytest.mark.slow
def test_a_remark_on_the_bench_is_made_once(magnet, tmp_path, monkeypatch):
    monkeypatch.setattr("rig.tuning.tuning.choose", lambda *_: magnet.chosen)  # gains do not matter
    said = []

    class Listening(Silent):
        def remark(self, text):
            said.append(text)

    odd = bench_with({"specimen": {"drive_mode_shape": 0.7}})
    tune(odd, tmp_path / "odd.h5", TuningRequest(level_rms_v=0.02, points=3), RunOptions(progress=Listening()))
    assert len(said) == 1
    assert "drive_mode_shape = 0.7" in said[0]


@pytest.mark.slow
def test_the_command_writes_plan_recording_and_figure_and_overwrites_nothing(command, tmp_path):
    line = "tune --bench magnet-beam -o tuned.toml --level 0.02 --figure tuned.png --law phase --points 3 --rehearse 2"
    told = json.loads(command(f"{line} --json").succeeded().out)
    assert told["plan"] == "tuned.toml"
    assert told["plant"]["drive_mode_shape"] == pytest.approx(0.908466, rel=2e-3)
    names = {"tuned.toml", "tuned.h5", "tuned.png", "tuned-trial.h5", "tuned-rehearsal.h5"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert told["rehearsal"]["draws"] == 2
    assert (tmp_path / "tuned.png").read_bytes()[:4] == b"\x89PNG"
    written = (tmp_path / "tuned.toml").read_text()
    assert written.startswith("# Rehearsal: on 2 twins of what was measured")
    plan = load_plan("tuned.toml")
    assert plan.levels_v == pytest.approx(told["needed_v"], rel=1e-4)
    assert plan.controller.k1 == pytest.approx(told["closed_form"]["k1"], rel=1e-4)
    assert plan.controller.k2 == pytest.approx(told["closed_form"]["k2"], rel=1e-4)
    again = command(line)
    assert again.status == 1
    assert "tuned.toml: exists already" in again.err
    assert (tmp_path / "tuned.toml").read_text() == written


def test_what_is_said_holds_numbers_alone(magnet):
    text = json.dumps(summary(magnet), default=lambda value: pytest.fail(f"{value!r} is no number"))
    assert json.loads(text)["law"] == "frequency-error"
