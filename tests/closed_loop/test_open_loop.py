"""Excitation without feedback, through the same tick: what goes out, and what comes back against harmonic balance."""

import itertools

import numpy as np
import pytest

import rig
from rig.arming.run_options import Silent
from rig.campaigns.evaluation.point import Quality
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MULTISINE_COLUMNS
from rig.campaigns.stepped_sine.plan import SteppedSinePlan
from rig.campaigns.stepped_sine.points import STEPPED_SINE_COLUMNS
from rig.campaigns.sweep.plan import SweepPlan
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from rig.measurements import point_rows
from rig.show.progress import RunProgress
from rig.show.summary import summarise_recording as show
from rig.tick.safety.layout import GuardMode
from simulators import VirtualRig
from tests.reference.harmonic_balance import response_to_voltage
from tests.reference.parameters import ONE_SIDED
from tests.refused import refused
from tests.rig.campaigns.made_points import made_point
from tests.rig.rigs import bench_with

QUIET = {"noise_scale": 0.0, "converter": {"adc_bits": 0, "dac_bits": 0}}


def _plan(**changes):
    return SteppedSinePlan.model_validate({"bench": "magnet-beam", "levels_v": (1.0,), **changes})


@pytest.fixture(scope="module")
def stepped():
    plan = _plan(frequencies_hz=(22.0, 24.0, 26.0), levels_v=(0.3, 1.5))
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        yield run


def test_stepped_sines_find_what_harmonic_balance_finds(stepped):
    assert stepped.complete
    for point in stepped.recording.points:
        truth = response_to_voltage(ONE_SIDED, [0.1, point["level"]], point["frequency_hz"])[-1]
        assert point["frequency_hz"] == pytest.approx(point["asked_frequency_hz"], rel=1e-6)
        assert point["force_n"] == pytest.approx(truth.force_amplitude_n, rel=1e-3)
        assert point["phase_lag_deg"] - 180.0 == pytest.approx(truth.lag_deg, abs=0.1)  # displacement, acceleration


def test_stepped_sines_are_handed_out_as_one_frequency_response_per_level(stepped):
    responses = stepped.frequency_responses()
    assert [response.level for response in responses] == [0.3, 1.5]
    for response in responses:
        points = [point for point in stepped.recording.points if point["level"] == response.level]
        np.testing.assert_allclose(response.force_n, [point["force_n"] for point in points])
        np.testing.assert_allclose(response.amplitude_m, [point["amplitude_m"] for point in points])
        np.testing.assert_allclose(response.phase_lag_deg, [point["phase_lag_deg"] for point in points], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, {"says": "exactly-one"}),
        ({"frequencies_hz": (24.0,), "start_hz": 22.0, "stop_hz": 25.0}, {"says": "exactly-one"}),
        ({"start_hz": 22.0}, {"says": "exactly-one"}),
        ({"frequencies_hz": (24.0, -1.0)}, {"field": "frequencies_hz[1]", "value": -1.0, "allowed": "above 0"}),
        ({"frequencies_hz": ()}, {"says": "at-least-one", "field": "frequencies_hz"}),
        (
            {"frequencies_hz": (24.0,), "levels_v": (1.0, 1.0)},
            {"says": "twice", "field": "levels_v", "hint": "use repeats to measure levels again"},
        ),
        ({"frequencies_hz": (24.0,), "levels_v": ()}, {"field": "levels_v"}),
    ],
)
def test_a_stepped_sine_plan_that_makes_no_sense_is_refused(changes, fault):
    with refused(ValueError, **fault):
        _plan(**changes)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"frequencies_hz": (24.0, 3000.0)}, {"field": "highest frequency", "value": 3000.0}),
        ({"frequencies_hz": (24.0, 0.1)}, {"field": "lowest frequency", "value": 0.1}),
        ({"frequencies_hz": (24.0,), "levels_v": (1.0, 50.0)}, {"field": "levels_v[1]", "value": 50.0}),
    ],
)
def test_what_the_bench_cannot_do_is_refused_before_anything_moves(changes, fault):
    with refused(ConfigurationError, **fault):
        rig.run(_plan(**changes))


def _sweep(**changes):
    table = {"bench": "magnet-beam", "levels_v": (0.2,), "start_hz": 22.0, "stop_hz": 27.0, "rate_hz_per_s": 5.0}
    return SweepPlan.model_validate(table | changes)


def _late():
    """Samples by which a row's phase is behind the start of the interval that it shows, from half the hold and the filter."""
    with make_daq(bench_with()) as daq:
        daq.start(1)
        return (1.0 + daq.latency_samples) % 1.0


def _swept_phase(plan):
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        assert run.complete
        rows = point_rows(run.recording, 0)
    theta = np.unwrap(rows["theta_rad"].astype(float))
    return np.arange(theta.size) / 5000.0, theta - theta[0], rows


@pytest.mark.parametrize(("start_hz", "stop_hz"), [(22.0, 27.0), (27.0, 22.0)])
def test_a_linear_sweep_has_the_phase_of_a_chirp(start_hz, stop_hz):
    t, theta, rows = _swept_phase(_sweep(start_hz=start_hz, stop_hz=stop_hz))
    assert t[-1] == pytest.approx(1.0, abs=2e-3)
    way = 5.0 if stop_hz > start_hz else -5.0
    before = int(np.argmax(rows["frequency_hz"] != np.float32(start_hz)))  # what was sent out before still shows first
    t = t - (before + _late()) / 5000.0  # a row has the phase that its instant's readings answer to
    lead = theta[before]
    np.testing.assert_allclose(
        theta[before:] - lead, 2.0 * np.pi * (start_hz * (t - t[before]) + 0.5 * way * t**2)[before:], atol=1e-4
    )
    held = rows["theta_rad"] + 2.0 * np.pi * _late() * rows["frequency_hz"] / 5000.0  # phase when it was put out
    np.testing.assert_allclose(rows["output_v"], 0.2 * np.cos(held.astype(float)), atol=1e-6)


def test_a_logarithmic_sweep_takes_its_time_by_the_octave():
    plan = _sweep(start_hz=20.5, stop_hz=29.0, rate_hz_per_s=None, rate_octaves_per_min=30.0)
    t, _, rows = _swept_phase(plan)
    assert t[-1] == pytest.approx(plan.sweep_s, abs=2e-3) == pytest.approx(np.log2(29.0 / 20.5) * 2.0, abs=2e-3)
    middle = t.size // 2
    assert rows["frequency_hz"][middle] == pytest.approx(np.sqrt(20.5 * 29.0), rel=2e-4)


def test_every_sweep_of_a_plan_begins_from_rest_at_its_first_frequency():
    plan = _sweep(levels_v=(0.1, 0.3), hold_periods=5)
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        assert run.complete
        first, second = point_rows(run.recording, 0), point_rows(run.recording, 1)
        transients = run.sweeps()
    assert first["frequency_hz"][0] == second["frequency_hz"][0] == pytest.approx(22.0)
    assert np.abs(second["command_v"]).max() == pytest.approx(0.3)
    assert set(transients) == {0, 1}


MULTISINE = MultisinePlan(
    bench="magnet-beam",
    levels_rms_v=(0.05,),
    lowest_hz=21.0,
    highest_hz=29.0,
    resolution_hz=0.5,
    realisations=2,
    periods=2,
    transient_periods=3,
)


@pytest.fixture(scope="module")
def multisine():
    with rig.run(MULTISINE, bench=bench_with(**QUIET)) as run:
        yield run


def test_a_multisine_is_put_out_as_it_was_designed(multisine):
    assert multisine.complete
    design = MULTISINE.design(5000.0)
    for point in multisine.recording.points:
        rows = point_rows(multisine.recording, point["number"])
        turns = rows["theta_rad"].astype(float) / (2.0 * np.pi)  # the recorded phase is late, like the readings
        played = np.round(turns * design.period_samples + _late()).astype(int)
        wanted = 0.05 * design.realisation(0, point["realisation"])[played % design.period_samples]
        np.testing.assert_allclose(rows["output_v"], wanted, atol=1e-6)
        assert point["voltage_rms_v"] == pytest.approx(0.05, rel=1e-4)
        phases = np.angle(np.fft.rfft(design.realisation(0, point["realisation"]))[design.lines])
        spectra = multisine.spectra()[0.05]
        recorded = spectra.mean[point["realisation"], spectra.index("voltage")][spectra.excited]
        np.testing.assert_allclose(np.angle(recorded * np.exp(-1j * phases)), 0.0, atol=1e-4)


def test_a_multisine_at_low_level_measures_the_linear_response_of_the_structure(multisine):
    spectra = multisine.spectra()[0.05]
    response = spectra.frequency_response("drive")
    modes = VirtualRig.shipped("magnet-beam").linear_modes
    omega = 2.0 * np.pi * response.frequency_hz[:, None]
    own, damping = 2.0 * np.pi * modes.frequency_hz, modes.damping_ratio
    linear = (-(omega**2) * modes.drive_shape**2 / (own**2 - omega**2 + 2j * damping * own * omega)).sum(axis=1)
    np.testing.assert_allclose(response.value, linear, rtol=0.02)


def test_a_multisine_that_is_not_settled_is_not_accepted():
    changes = {"transient_periods": 0, "realisations": 1, "ramp_s": 0.02, "accepted_change": 1e-4}
    hasty = MULTISINE.model_copy(update=changes)
    with rig.run(hasty, bench=bench_with(**QUIET)) as run:
        point = run.recording.points[0]
    assert not run.complete
    assert not point["accepted"]
    assert "transient_periods" in point["reason"]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        (
            {"resolution_hz": 0.3},
            {"field": "resolution_hz", "value": 0.3, "allowed": "a whole number, such as 0.299994 Hz gives"},
        ),
        ({"highest_hz": 4000.0}, {"field": "highest_hz", "value": 4000.0}),
        (
            {"levels_rms_v": (3.0,)},
            {"field": "levels_rms_v[0]", "value": 3.0, "allowed": "peaks above 0 and up to 9.5 V"},
        ),
        ({"lowest_hz": 25.1, "highest_hz": 25.2}, {"says": "no-line", "field": "lowest_hz, highest_hz"}),
        ({"resolution_hz": 0.001, "realisations": 21}, {"field": "realisations", "value": 21}),
        ({"resolution_hz": 1e5}, {"field": "resolution_hz", "value": 100000.0, "allowed": "3 to 1e+08"}),
    ],
)
def test_a_multisine_that_the_bench_cannot_play_is_refused(changes, fault):
    with refused(ConfigurationError, **fault):
        rig.run(MULTISINE.model_copy(update=changes))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"rate_octaves_per_min": 1.0}, {"says": "exactly-one"}),
        ({"rate_hz_per_s": None}, {"says": "exactly-one"}),
        ({"stop_hz": 22.0}, {"field": "stop_hz", "value": 22.0, "allowed": "anything but start_hz"}),
        ({"rate_hz_per_s": -1.0}, {"field": "rate_hz_per_s", "value": -1.0}),
        (
            {"rate_hz_per_s": 1e-300},
            {"field": "rate_hz_per_s", "value": 1e-300, "allowed": "from 5.787e-05, a sweep of a day"},
        ),
        (
            {"rate_hz_per_s": 1e4},
            {
                "field": "rate_hz_per_s",
                "value": 10000.0,
                "allowed": "up to 12.25 from 22 to 27 Hz, a sweep of 10 periods",
            },
        ),
        ({"off_resonance_hz": ()}, {"field": "off_resonance_hz"}),
    ],
)
def test_a_sweep_that_makes_no_sense_is_refused(changes, fault):
    with refused(ValueError, **fault):
        _sweep(**changes)


def test_a_ramp_to_a_limit_of_the_frequency_does_not_trip_by_rounding():
    settle = {"average_periods": 1, "settled_periods": 1, "amplitude": 0.5}
    plan = _plan(levels_v=(0.1,), frequencies_hz=(100.0, 8.0), record_periods=4, accepted_drift=1.0, settle=settle)
    omega, lowest = 2.0 * np.pi * 100.0, 2.0 * np.pi * 8.0
    assert omega + (lowest - omega) < lowest  # what the limit is up against
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        assert run.recording.parts[0].end["reason"] == "completed"


@pytest.mark.parametrize(
    ("plan", "highest_hz"),
    [
        (MULTISINE.model_copy(update={"levels_rms_v": (0.5,), "ramp_s": 1e-3, "transient_periods": 0}), 29.0),
        (_sweep(levels_v=(2.0,), ramp_periods=1, hold_periods=1, start_hz=200.0, stop_hz=190.0), 200.0),
    ],
    ids=["multisine", "sweep"],
)
def test_what_is_recorded_is_at_its_level_though_the_ramp_is_faster_than_the_slew_limit(plan, highest_hz):
    with rig.run(plan, bench=bench_with({"limits": {"slew_v_per_s": 20.0}}, **QUIET)) as run:
        for point in run.recording.points:
            commanded = np.abs(point_rows(run.recording, point["number"])["command_v"])
            assert commanded.min() >= 0.998 * commanded.max() > 0.0
        part = run.recording.parts[0]
        steps = np.abs(np.diff(part.rows("output_v")))  # one realisation does not break off into the next
        assert steps.max() < 1.1 * 2.0 * np.pi * highest_hz / 5000.0 * np.abs(part.rows("command_v")).max()


def test_every_level_of_a_stepped_sine_begins_from_rest_at_its_first_frequency():
    segments = _plan(frequencies_hz=(22.0, 26.0), levels_v=(0.1, 0.2)).segments(5000.0)
    rising = [before for before, after in itertools.pairwise(segments) if after.level > before.level]
    assert [before.excitation.frequency_hz for before in rising] == [22.0]


def test_a_point_that_failed_says_where_it_is_and_nothing_of_a_phase_that_nobody_controls(capsys):
    settle = {"amplitude": 1e-9, "longest_periods": 30}
    plan = _plan(frequencies_hz=(24.5,), settle=settle | {"settled_periods": 5})
    with rig.run(plan, bench=bench_with(**QUIET), progress=RunProgress(STEPPED_SINE_COLUMNS)) as run:
        assert "at 24.5 Hz: not settled" in run.recording.points[0]["reason"]
        assert "phase" not in run.recording.points[0]["reason"]
    assert "  not-settled: at 24.5 Hz" in capsys.readouterr().err


def test_an_interrupted_realisation_is_shown_as_failed_without_empty_columns(capsys):
    point = made_point(0.1, "V RMS", quality=Quality.INTERRUPTED, reason="interrupted", realisation=0)
    RunProgress(MULTISINE_COLUMNS).point(point, 1, 2)
    assert capsys.readouterr().err.endswith("0.1 V RMS  interrupted\n")


def test_a_level_of_a_multisine_stands_in_its_plan_once():
    with refused(ValueError, field="levels_rms_v[1]", value=0.05, allowed="each level once"):
        MultisinePlan.model_validate(MULTISINE.model_dump() | {"levels_rms_v": (0.05, 0.05)})


def test_one_period_of_a_multisine_does_not_count_as_settled():
    plan = MULTISINE.model_copy(update={"periods": 1, "realisations": 1, "transient_periods": 0})
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        (point,) = run.recording.points
    assert point["accepted"]
    assert point["settled"] is None


def test_a_vibration_beyond_the_limit_of_the_response_is_ramped_down_though_its_peaks_cannot_be_integrated():
    bench = bench_with({"limits": {"acceleration_m_s2": 60.0}}, **QUIET)
    with rig.run(_plan(frequencies_hz=(25.0,), levels_v=(2.5,)), bench=bench) as run:
        part = run.recording.parts[0]
        assert part.end["reason"] == "response_limit"
        ramp = np.count_nonzero(part.rows("guard") == GuardMode.RAMPING)
        assert np.abs(part.rows("inputs")).max() > 61.0
    assert ramp == bench.limits.ramp_down_s * bench.sample_rate_hz


def test_a_vibration_that_grows_on_while_it_is_ramped_down_is_dropped_at_five_quarters_of_the_limit():
    bench = bench_with({"limits": {"acceleration_m_s2": 60.0}}, **QUIET)
    with rig.run(_plan(frequencies_hz=(25.0,), levels_v=(4.0,)), bench=bench) as run:
        part = run.recording.parts[0]
        guard, readings = part.rows("guard"), np.abs(part.rows("inputs")).max(axis=1)
    dropped = int(np.flatnonzero(guard == GuardMode.OFF)[0])
    assert guard[dropped - 1] == GuardMode.RAMPING
    assert readings[dropped] > 75.0
    assert readings[guard == GuardMode.RAMPING].max() <= 75.0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_in_the_first_sample_is_not_taken_for_travel(seed):
    bench = bench_with({"limits": {"frequency_hz": (0.5, 600.0), "displacement_m": 0.002}}, noise_scale=10.0)
    with rig.run(_plan(frequencies_hz=(25.0,), levels_v=(0.3,)), bench=bench, seed=seed) as run:
        assert run.recording.parts[0].end["reason"] == "completed"


class StopAfterOne(Silent):
    """Asks for a stop as soon as the first point is done."""

    def __init__(self):
        self.done = 0

    def point(self, point, number, total):
        self.done = number

    def advance(self, rows, tick):
        if self.done == 1:
            tick.request_stop()


@pytest.mark.parametrize(
    "plan",
    [
        _plan(frequencies_hz=(22.0, 23.0, 24.0)),
        _sweep(levels_v=(0.1, 0.2), hold_periods=5, rate_hz_per_s=1.0),
        MULTISINE.model_copy(update={"transient_periods": 1}),
    ],
    ids=lambda plan: plan.kind,
)
def test_an_interrupted_open_loop_test_is_ramped_down_and_resumed(plan, tmp_path):
    output = tmp_path / "out.h5"
    with rig.run(plan, output=output, progress=StopAfterOne()) as run:
        assert not run.complete
        assert sum(point["accepted"] for point in run.recording.points) == 1
        part = run.recording.parts[0]
        assert part.rows("output_v")[-1] == 0.0
        assert np.abs(np.diff(np.abs(part.rows("command_v")))).max() < 0.03
    with rig.resume(output) as run:
        assert run.complete
        numbers = {point["number"] for point in run.recording.points if point["accepted"]}
        assert numbers == {target.number for target in plan.targets()}
        assert len(run.recording.parts) == 2
        assert show(run.recording)["complete"]


def _late_drive(samples):
    """The quiet bench with a drive channel that is late by so many samples, and says so."""
    channels = [channel.model_dump() for channel in bench_with().channels]
    sensors = [sensor.model_dump() for sensor in VirtualRig.shipped("magnet-beam").sensors]
    channels[1]["skew_samples"] = sensors[1]["skew_samples"] = samples
    return bench_with({"channels": channels}, sensors=sensors, **QUIET)


def test_the_skew_of_a_channel_is_taken_out_of_spectra_and_sweeps():
    plain, late = bench_with(**QUIET), _late_drive(3.4)
    one = MULTISINE.model_copy(update={"realisations": 1})
    with rig.run(one, bench=plain) as first, rig.run(one, bench=late) as second:
        expected, found = (run.spectra()[0.05].frequency_response("drive").value for run in (first, second))
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    with rig.run(_sweep(), bench=plain) as first, rig.run(_sweep(), bench=late) as second:
        expected, found = (run.sweeps()[0] for run in (first, second))
    ratio = found.fundamental("drive") / expected.fundamental("drive")
    assert np.abs(np.angle(ratio)).max() < 3e-3  # undeclared, 3.4 samples would be 0.12 rad at 27 Hz
    np.testing.assert_allclose(np.abs(ratio), 1.0, rtol=2e-2)  # it is late by its skew in time, too
