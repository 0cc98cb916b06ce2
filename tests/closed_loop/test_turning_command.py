"""The complex command keeps the slew limit in amplitude and angle together, whatever its law demands."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from controller import AmplitudeLaw
from rig.drivers import make_daq
from rig.loop.loop import Loop
from rig.tick.safety.kernels import permitted_amplitude, permitted_command_phase
from rig.tick.safety.limits import guard_record, limits_record
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings
from tests.closed_loop.laws import law_of
from tests.rig.rigs import bench_with

V, M = AmplitudeLaw.VOLTAGE, AmplitudeLaw.RESPONSE
SLEW_V_PER_S = 2.0


@given(st.floats(0.0, 9.0), st.floats(0.0, 9.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_a_demand_is_followed_no_faster_than_the_limit_and_reached(start_v, end_v, turn, demanded):
    bench = bench_with()
    limits, guard = limits_record(bench)[0], guard_record(True)[0]
    allowed = float(limits["slew_v_per_sample"])
    guard["amplitude_v"] = start_v
    way = math.remainder(demanded - turn, 2 * math.pi)
    longest = abs(end_v - start_v) / allowed + max(start_v, end_v) * math.pi / allowed + 3
    for sample in range(math.ceil(longest)):
        before = guard["amplitude_v"] * np.exp(1j * turn)
        last_v = float(guard["amplitude_v"])
        amplitude = permitted_amplitude(guard, limits, end_v, sample)
        turned = permitted_command_phase(limits, turn, demanded, last_v, amplitude)
        assert abs(amplitude * np.exp(1j * turned) - before) <= allowed * (1 + 1e-9) + 1e-13
        if abs(way) < 3.1 and last_v * amplitude > 0.0 and turned != demanded:
            assert (turned - turn) * way >= 0.0  # the shorter way round
        turn = turned
        if turn == demanded and amplitude == end_v:
            break
    assert turn == demanded
    assert amplitude == pytest.approx(end_v)


def _segments(level_m):
    start = Segment(SegmentKind.RAMP, -1, 0.3, 10.0, amplitude_law=V)
    held = Segment(SegmentKind.RAMP, -1, level_m, 10.0, amplitude_law=M, geometric=True)
    return [
        start,
        Segment(SegmentKind.HOLD, -1, 0.3, 40.0, amplitude_law=V),
        held,
        Segment(SegmentKind.HOLD, -1, level_m, 150.0, amplitude_law=M),
    ]


def _steps(rows):
    """Change of the complex command from sample to sample, V; the ramp-down is not slew-limited."""
    return np.abs(np.diff(rows["command_v"][rows["segment"] >= 0].astype(complex)))


def test_a_vibration_turned_round_while_it_is_held_cannot_throw_the_command_about():
    """The held response's angle is set 170 degrees off at once: the law demands the turn within a few samples."""
    rows, mark = _turned_round(SLEW_V_PER_S)
    allowed = SLEW_V_PER_S / 5000
    assert _steps(rows).max() <= 1.001 * allowed + 2e-7  # recorded in single precision
    busy = _steps(rows[mark + 2 : mark + 400])
    assert np.median(busy) > 0.9 * allowed  # it was the limit that set the pace
    # nothing had wound up: the response is where it is wanted again, at rest
    last = rows[rows["segment"] == 3][-1024:]
    assert np.abs(np.diff(np.unwrap(np.angle(last["command_v"])))).max() < 0.01
    drive = abs(2 * np.mean(last["inputs"][:, 1] * np.exp(-1j * last["theta_rad"].astype(float))))
    assert drive / (2 * math.pi * last["frequency_hz"][-1]) ** 2 == pytest.approx(4e-4, rel=0.05)


def test_without_the_limit_in_its_way_the_same_turn_is_many_times_faster():
    rows, _ = _turned_round(1e4)
    assert _steps(rows).max() > 10 * SLEW_V_PER_S / 5000


def _turned_round(slew_v_per_s):
    """A held response whose wanted angle jumps by 170 degrees in its middle."""
    bench = bench_with({"limits": {"slew_v_per_s": slew_v_per_s}}, noise_scale=0.0)
    chunks, mark = [], 0
    with make_daq(bench, 0) as daq:
        daq.start(bench.block)
        tick = Tick(
            TickSettings(bench, law_of("magnet-beam"), V, SettleRule(), _segments(4e-4)),
            bench.block + daq.latency_samples,
        )
        for rows in Loop(daq, tick).run():
            chunks.append(rows)
            if mark == 0 and tick.arrays.progress["segment"][0] == 3 and tick.sample > 18000:
                tick.arrays.control["amplitude"]["response"]["reference_turn"] += math.radians(170.0)
                mark = tick.sample
    assert mark > 0
    return np.concatenate(chunks), mark
