"""A level is kept: it is not far exceeded under a lock, and takes the output that it took; else the run trips in time."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from controller.kernels import FORCE, PERIOD, VOLTAGE
from rig.arming.checked_scale import CheckedScale
from rig.campaigns.plans import load_plan
from rig.campaigns.running.settings import tick_settings
from rig.drivers.virtual import VirtualDAQ
from rig.loop.loop import Loop
from rig.tick.safety.expected import expected_record
from rig.tick.safety.keeping import (
    CHANGED_PERIODS,
    FAR,
    FAR_PERIODS,
    IN_ORDER_PERIODS,
    KEPT,
    LARGEST_CHANGE,
    SHAKEN_PERIODS,
    begin_level,
    foretold_level,
    gain_has_changed,
    is_far_above,
)
from rig.tick.safety.layout import EndReason
from rig.tick.safety.limits import describe_end
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.tick import TickSettings
from tests.reliability.faults.plans import bench_for, plan_for
from tests.rig.rigs import bench_with
from tests.rig.tick.safety.test_response_plausibility import BLOCK, DRIVE_CHANNEL, FORCE_CHANNEL, Spoilt

LAG = -0.5 * math.pi
ON_BEAM = {"magnet-beam": (0.151, 15.7), "friction-beam": (1.96, 199.0)}
"""Force (N) and motion (m/s^2) per volt at resonance, as `rig check` of these rigs measures them."""


def _carried_out(levels, make, per_volt=None):
    """The device and the tick of a short plan, on a device made from its bench."""
    plan, bench = plan_for(levels), bench_for(levels)
    with make(bench) as daq:
        daq.start(BLOCK)
        settings = TickSettings(
            bench,
            plan.law,
            plan.amplitude_law,
            plan.settle_rule,
            plan.segments(bench.sample_rate_hz),
            per_volt=per_volt,
        )
        loop = Loop(daq, settings.build(daq.latency_samples), fused=daq.run_fused is not None)
        assert all(True for _ in loop.run())
    return daq, loop.tick


@cache
def _onsets(levels):
    """Samples in the ramp to the second point and in its record, on a sound rig."""
    _, tick = _carried_out(levels, lambda bench: VirtualDAQ(bench, 0))
    assert EndReason(int(tick.guard["reason"][0])) is EndReason.COMPLETED
    found = {}
    for name, kind in (("ramp", SegmentKind.RAMP), ("record", SegmentKind.RECORD)):
        index = int(np.flatnonzero((tick.arrays.segments["point"] == 1) & (tick.arrays.segments["kind"] == kind))[0])
        entry = tick.outcomes[index]
        found[name] = int(entry["first_sample"] + entry["end_sample"]) // (2 * BLOCK) * BLOCK
    return found


def _spoilt(levels, onset, per_volt=None, **fault):
    """Reason, seconds from the fault to the trip, largest output and true force from the fault on, sentence."""
    daq, tick = _carried_out(levels, lambda bench: Spoilt(bench, onset, **fault), per_volt)
    bench, at = bench_for(levels), onset // BLOCK
    return (
        EndReason(int(tick.guard["reason"][0])),
        (int(tick.guard["sample"][0]) - onset) / bench.sample_rate_hz,
        max(daq.voltages[at:]),
        max(daq.forces[at:]),
        describe_end(tick.guard, bench),
    )


def _fading(channel, rate_hz, per_s=0.8):
    """A sensor that loses its sensitivity, by this factor a second; with ``channel`` None the amplifier its gain."""
    done = 0

    def spoil(values):
        nonlocal done
        left = per_s ** ((done + np.arange(len(values))) / rate_hz)
        done += len(values)
        if channel is None:
            return values * left
        values[:, channel] *= left
        return values

    return spoil


@pytest.mark.parametrize("where", ["ramp", "record"])
@pytest.mark.parametrize("levels", ["N logarithmic", "N linear", "m", "N, friction"])
def test_an_amplifier_that_becomes_ten_times_too_strong_trips_within_some_periods(levels, where):
    reason, after_s, _, _, said = _spoilt(levels, _onsets(levels)[where], output=lambda volts: 10.0 * volts)
    assert reason is EndReason.OVER_LEVEL
    assert after_s * bench_for(levels).specimen.linear_frequency_hz < 5.0
    assert "far above its level on channel" in said


def test_a_force_signal_that_fades_trips_before_the_force_is_a_multiple_of_what_was_asked_for():
    rate_hz = bench_for("N logarithmic").sample_rate_hz
    reason, _, output_v, force_n, said = _spoilt(
        "N logarithmic", _onsets("N logarithmic")["record"], readings=_fading(FORCE_CHANNEL, rate_hz)
    )
    assert reason is EndReason.GAIN_CHANGED
    assert output_v < 3.5  # without: 4.2 V and 6.5 N, and the plan is carried out
    assert force_n < 3.5
    assert "on channel force (by a factor of 3" in said


def test_a_drive_signal_that_fades_trips_while_the_response_is_held():
    rate_hz = bench_for("m").sample_rate_hz
    reason, _, output_v, force_n, _ = _spoilt("m", _onsets("m")["record"], readings=_fading(DRIVE_CHANNEL, rate_hz))
    assert reason is EndReason.GAIN_CHANGED
    assert output_v < 3.5  # without: 6.1 V and 21 N, to the limit of the displacement
    assert force_n < 3.5


@pytest.mark.parametrize("per_s", [0.8, 1.25])
def test_an_amplifier_whose_gain_drifts_trips_while_the_response_is_held(per_s):
    rate_hz = bench_for("m").sample_rate_hz
    reason, _, output_v, _, _ = _spoilt("m", _onsets("m")["record"], output=_fading(None, rate_hz, per_s))
    assert reason is EndReason.GAIN_CHANGED
    assert output_v < 3.5


@pytest.mark.parametrize("levels", ["V", "V, friction"])
def test_with_levels_in_volts_the_last_check_foretells_what_an_amplifier_ten_times_too_strong_exceeds(levels):
    onset, per_volt = _onsets(levels)["record"], ON_BEAM[bench_for(levels).name]
    reason, after_s, _, _, said = _spoilt(levels, onset, per_volt, output=lambda volts: 10.0 * volts)
    assert reason is EndReason.OVER_LEVEL
    assert after_s * bench_for(levels).specimen.linear_frequency_hz < 10.0
    assert "far above its level on channel drive" in said
    assert _spoilt(levels, onset, output=lambda volts: 10.0 * volts)[0] is not EndReason.OVER_LEVEL


@pytest.mark.parametrize("name", ["friction-beam/backbone", "magnet-beam/backbone", "magnet-beam/decay"])
def test_a_sound_rig_stays_far_from_what_the_last_check_foretells_though_friction_takes_seven_times_the_force(name):
    plan = load_plan(name)
    bench = bench_with(name=name.split("/")[0])
    with VirtualDAQ(bench, 5) as daq:
        daq.start(1)
        settings = tick_settings(plan, bench, plan.segments(bench.sample_rate_hz))
        settings = TickSettings(
            bench,
            plan.law,
            plan.amplitude_law,
            plan.settle_rule,
            settings.segments,
            exciter=plan.known_plant,
            per_volt=ON_BEAM[bench.name],
        )
        loop = Loop(daq, settings.build(daq.latency_samples))
        assert all(True for _ in loop.run())
    assert EndReason(int(loop.tick.guard["reason"][0])) is EndReason.COMPLETED
    assert loop.tick.arrays.plausibility["kept"]["highest"][0] < 0.5 * FAR


def test_a_run_is_built_with_the_scale_of_the_last_check():
    plan, bench = plan_for("V"), bench_for("V")
    checked = CheckedScale(
        at="", frequency_hz=24.4, damping_ratio=0.004, acceleration_per_newton=104.0, acceleration_per_volt=15.6
    )
    settings = tick_settings(plan, bench, plan.segments(bench.sample_rate_hz), checked)
    expected = settings.build(0.0).arrays.expected[0]
    assert expected["checked_n_v"] == pytest.approx(0.15)
    assert expected["checked_m_s2_v"] == pytest.approx(15.6)


def _kept(law=FORCE, level=1.0, lag=LAG):
    kept = np.zeros(1, KEPT)[0]
    begin_level(kept, law, level, lag)
    return kept


def _gain(kept, held, output_v, needed_v=0.0, *, level_held=True, locked=True):
    return gain_has_changed(kept, held, output_v, needed_v, locked, level_held)


def _settled(gain=1.0, level=1.0, lag=LAG, needed_v=0.0):
    kept = _kept(level=level, lag=lag)
    assert not any(_gain(kept, level, gain * level, needed_v) for _ in range(IN_ORDER_PERIODS))
    return kept


@given(steps=st.lists(st.floats(1.01, 3.0), min_size=1, max_size=20), above=st.floats(0.0, FAR))
def test_the_level_that_counts_in_a_ramp_is_that_of_the_ramp(steps, above):
    kept, level = _kept(), 1.0
    for step in steps:
        level *= step
        assert not is_far_above(kept, above * level, level, True)
    found = [is_far_above(kept, 1.01 * FAR * level, level, True) for _ in range(FAR_PERIODS)]
    assert found == [False] * (FAR_PERIODS - 1) + [True]


@given(decay=st.floats(0.9, 0.999), ratio=st.floats(2.0, 100.0))
def test_a_vibration_that_decays_to_a_lower_level_in_its_own_time_is_not_far_above_it(decay, ratio):
    kept, seen = _kept(), 1.0
    assert not is_far_above(kept, seen, 1.0, True)
    for _ in range(200):
        seen = max(decay * seen, 1.0 / ratio)
        assert not is_far_above(kept, seen, 1.0 / ratio, True)


def test_without_a_lock_a_level_counts_for_some_periods_and_never_before_the_first():
    kept = _kept()
    assert not any(is_far_above(kept, 10.0, 1.0, False) for _ in range(100))
    assert not is_far_above(kept, 1.0, 1.0, True)
    assert not any(is_far_above(kept, 1.0, 1.0, False) for _ in range(SHAKEN_PERIODS - FAR_PERIODS - 1))
    assert [is_far_above(kept, 10.0, 1.0, False) for _ in range(FAR_PERIODS)][-1]


@given(factor=st.floats(1.0 / LARGEST_CHANGE, LARGEST_CHANGE))
def test_an_output_that_stays_within_a_factor_of_three_at_a_level_goes_on(factor):
    kept = _settled()
    assert not any(_gain(kept, 1.0, factor) for _ in range(3 * CHANGED_PERIODS))


@pytest.mark.parametrize("factor", [1.01 * LARGEST_CHANGE, 0.99 / LARGEST_CHANGE])
def test_an_output_that_changes_more_within_a_level_is_noticed_after_the_stated_number_of_periods(factor):
    kept = _settled()
    found = [_gain(kept, 1.0, factor) for _ in range(CHANGED_PERIODS)]
    assert found == [False] * (CHANGED_PERIODS - 1) + [True]


@given(
    levels=st.lists(st.floats(0.01, 100.0), min_size=1, max_size=10),
    load=st.floats(0.0, 50.0),
    rising=st.booleans(),
)
def test_friction_whose_damping_goes_with_the_root_of_the_level_is_never_noticed(levels, load, rising):
    """``u/F = alpha + beta Y`` with ``Y`` over the damping; ``load``: beta Y over alpha at the first level, of any exciter."""
    kept = None
    for level in [1.0, *levels]:
        damping = level ** (0.5 if rising else -0.5)
        gain = abs(1.0 + 1j * load / damping)
        if kept is None:
            kept = _settled(gain)
        begin_level(kept, FORCE, level, LAG)
        assert not any(_gain(kept, level, gain * level) for _ in range(2 * CHANGED_PERIODS))


@given(first=st.floats(-170.0, -10.0), lags=st.lists(st.floats(-170.0, -10.0), max_size=10), load=st.floats(0.0, 50.0))
@example(first=-10.0, lags=[-90.0], load=5.85)
@example(first=-90.0, lags=[-10.0], load=5.85)
@example(first=-150.0, lags=[-30.0], load=1.73)
def test_steps_of_the_phase_are_never_noticed(first, lags, load):
    """The accelerance of a mode at a lag goes with its sine; at 10 degrees it may cancel the exciter, as in the examples."""
    kept = None
    for lag_deg in [first, *lags]:
        lag = math.radians(lag_deg)
        gain = abs(1.0 + load * abs(math.sin(lag)) * 1j * np.exp(1j * (lag - LAG)))
        if kept is None:
            kept = _settled(gain, lag=lag)
        begin_level(kept, FORCE, 1.0, lag)
        assert not any(_gain(kept, 1.0, gain) for _ in range(2 * CHANGED_PERIODS))


def test_between_levels_what_the_known_exciter_explains_is_left_out_but_not_without_end():
    for factor, exciter, noticed in ((5.0, 1.0, True), (5.0, 5.0, False), (8.0, 8.0, False), (10.0, 10.0, True)):
        kept = _settled(needed_v=1.0)
        begin_level(kept, FORCE, 1.0001, LAG)
        found = any(_gain(kept, 1.0, factor, exciter) for _ in range(2 * CHANGED_PERIODS))
        assert found == noticed


def test_a_fault_that_grows_over_many_levels_is_noticed_by_the_first_one():
    kept, found, gain = _settled(), [], 1.0
    for number in range(8):
        gain *= 1.25
        begin_level(kept, FORCE, 1.0 + 0.01 * number, LAG)
        found += [_gain(kept, kept["level"], gain * kept["level"]) for _ in range(IN_ORDER_PERIODS)]
    assert any(found)


def test_a_check_foretells_a_motion_at_resonance_alone_and_force_where_the_motion_is_larger_too():
    expected = expected_record(bench_with(), 0.001, 0.01, None, (2.0, 50.0))[0]
    period = np.zeros(1, PERIOD)[0]
    for force_n, drive_m_s2, lag_deg, seen in (
        (2.0, 50.0, -90.0, 1.0),
        (20.0, 50.0, -90.0, 1.0),
        (20.0, 100.0, -90.0, 10.0),
        (20.0, 100.0, -30.0, 0.0),
    ):
        period["output_v"], period["force_n"], period["drive_m_s2"] = 1.0, force_n, drive_m_s2
        kept = _kept(VOLTAGE, lag=math.radians(lag_deg))
        assert foretold_level(expected, kept, period) == pytest.approx(seen)
    nothing = expected_record(bench_with(), 0.001, 0.01)[0]
    assert foretold_level(nothing, _kept(VOLTAGE), period) == 0.0
