"""A loop on a device: what comes of it is what comes of the same loop on the computer."""

from dataclasses import replace

import numpy as np
import pytest

from rig.bench import load_bench
from rig.campaigns.running.settings import tick_settings
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqMismatch, DaqRefused
from rig.loop.loop import Loop
from rig.loop.on_device import DeviceLoop, why_on_computer
from rig.tick.layout import ROW, SAMPLE_LOST
from rig.tick.tick import Tick
from rig.wire.messages import ROW_BYTES, Record, State
from tests.recorded import changed
from tests.refused import refused
from tests.rig.loop.device_in_process import LoopingDAQ
from tests.rig.loop.worker.rigs import tone

BENCH = load_bench("magnet-beam").model_copy(update={"block": 1})
BLOCK = 100
TONE = tone(BENCH, 0.4)


@pytest.fixture
def device():
    with LoopingDAQ(BENCH) as daq:
        yield daq


def started(device, settings=TONE):
    tick = Tick(settings, 1.0 + device.loop_latency_samples)
    remote = device.load_loop(tick.arrays, BLOCK)
    remote.begin()
    return DeviceLoop(device, remote, tick), remote


def run(loop):
    blocks = [*loop.run()]
    return loop.tick.joined(np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks]))


def test_a_run_on_the_device_is_the_run_of_the_computer(device):
    plan = changed("magnet-beam/backbone", levels_v=[0.4], record_periods=8)
    settings = tick_settings(plan, BENCH, plan.segments(BENCH.sample_rate_hz, frozenset()), None)
    settings = replace(settings, start_judged=False)
    with VirtualDAQ(BENCH) as daq:
        daq.start(1)
        here = Loop(daq, settings.build(daq.latency_samples))
        ours = np.concatenate([*here.run()])
    loop, _ = started(device, settings)
    theirs = run(loop)
    assert theirs[: ours.size].tobytes() == ours.tobytes()
    assert theirs.size - ours.size < BLOCK  # the last block is whole, at 0 V
    assert not np.any(theirs["output_v"][ours.size :])
    for name in ("outcomes", "guard", "progress"):
        assert getattr(loop.tick.arrays, name).tobytes() == getattr(here.tick.arrays, name).tobytes(), name
    assert np.any(loop.tick.outcomes["outcome"] == 2)  # the point was measured


def test_blocks_that_the_wire_lost_keep_their_place_and_say_so(device):
    device.lost_rows = frozenset({3, 4})
    loop, _ = started(device)
    rows = run(loop)
    lost = (rows["flags"] & SAMPLE_LOST) != 0
    np.testing.assert_array_equal(np.flatnonzero(lost), np.arange(3 * BLOCK, 5 * BLOCK))
    assert np.isnan(rows["inputs"][lost]).all()
    assert np.isfinite(rows["inputs"][~lost]).all()
    around = rows[: 8 * BLOCK]
    steps = np.diff(np.unwrap(around["theta_rad"].astype(float)))  # the oscillator goes on through the gap
    np.testing.assert_allclose(steps, 2.0 * np.pi * around["frequency_hz"][1:] / BENCH.sample_rate_hz, atol=2e-5)
    assert loop.failure is None
    assert loop.tick.sample == rows.size


class AllButOneInFive:
    """Numbers of blocks."""

    def __contains__(self, number):
        return number % 5 != 0


def test_a_run_whose_states_are_lost_now_and_then_ends_with_the_device(device):
    device.lost_states = AllButOneInFive()
    loop, remote = started(device)
    rows = run(loop)
    assert loop.tick.outcomes.tobytes() == remote.arrays.outcomes.tobytes()
    assert loop.tick.sample == rows.size == remote.expected


def test_outcomes_that_are_not_known_at_the_end_are_waited_for(device):
    loop, _ = started(device)
    last = run(loop).size // BLOCK
    device.stop()
    device.outcomes_from = last + 4
    loop, remote = started(device)
    rows = run(loop)
    assert loop.tick.outcomes.tobytes() == remote.arrays.outcomes.tobytes()
    assert loop.tick.sample == rows.size < remote.expected  # what was taken for its state alone has no rows


def test_a_request_to_stop_is_a_ramp_on_the_device(device):
    loop, remote = started(device, tone(BENCH, 6.0))
    blocks = loop.run()
    for _ in range(5):
        next(blocks)
    loop.request_stop()
    last = [*blocks][-1][1]
    assert [*remote.asked] == ["begin", "ramp", "stop"]
    assert last["output_v"][-1] == 0.0
    assert loop.tick.over
    assert loop.tick.sample < 6.0 * BENCH.sample_rate_hz


def test_a_loop_that_is_left_stops_the_device(device):
    loop, remote = started(device)
    next(loop.run())
    loop.stop()
    loop.stop()
    assert [*remote.asked] == ["begin", "stop"]
    assert "left" in str(loop.failure)


def test_a_silent_device_ends_the_run_and_is_told_to_stop(device):
    device.silent_from = 4
    loop, remote = started(device)
    assert run(loop).size == 4 * BLOCK
    assert "silent" in str(loop.failure)
    assert [*remote.asked] == ["begin", "stop"]
    assert loop.ended


def test_pieces_beyond_the_records_are_left_out(device):
    loop, _ = started(device)
    before = [array.tobytes() for array in loop.tick.arrays]
    across_its_end = loop.tick.arrays[9].nbytes - 2
    loop._note(State(0, (Record(200, 0, b"1234"), Record(9, 1 << 30, b"1234"), Record(9, across_its_end, b"1234"))))
    assert [array.tobytes() for array in loop.tick.arrays] == before


@pytest.mark.parametrize(("digest", "named"), [("", "no-loop"), ("f" * 64, "another-loop")])
def test_another_loop_is_refused_or_left_alone(digest, named):
    daq = LoopingDAQ(BENCH)
    daq.loop_digest = digest
    with refused(DaqMismatch, named) as seen:
        why_on_computer(daq, BLOCK)
    daq.loop = "auto"
    assert why_on_computer(daq, BLOCK) in str(seen.value)


def test_a_wire_that_does_not_carry_the_rows_goes_before_another_loop():
    daq = LoopingDAQ(BENCH)
    assert why_on_computer(daq, BLOCK) == ""
    daq.loop_digest, daq.obstacle = "", "this wire is slow"
    with pytest.raises(DaqRefused, match="this wire is slow"):
        why_on_computer(daq, BLOCK)
    daq.loop = "auto"
    assert why_on_computer(daq, BLOCK) == "this wire is slow"


def test_a_row_has_the_size_that_the_wire_gives_it():
    assert ROW.itemsize == ROW_BYTES
