"""A loop on a device: what a campaign sees of it is what it sees of the same loop on the computer."""

import numpy as np
import pytest

import rig.loop.session
from rig.bench import load_bench
from rig.campaigns.running.runner import run_plan
from rig.errors import DaqMismatch
from rig.loop.on_device import DeviceLoop, runs_on_device
from rig.loop.session import open_session
from rig.recording.reader import Recording
from rig.tick.layout import ROW, SAMPLE_LOST
from rig.wire.messages import ROW_BYTES, Record, State
from tests.recorded import changed, recorded
from tests.refused import refused
from tests.rig.loop.device_in_process import LoopingDAQ
from tests.rig.loop.worker.rigs import tone

PLAN = changed("magnet-beam/backbone", levels_v=[0.4], record_periods=8)
BENCH = load_bench("magnet-beam").model_copy(update={"block": 1})


@pytest.fixture
def device(monkeypatch):
    """Let benches have a device that runs the loop; gives its class, to be told what goes wrong."""
    device = type("Device", (LoopingDAQ,), {})
    monkeypatch.setattr(rig.loop.session, "make_daq", lambda bench, seed: device(bench, seed))
    return device


def run(path):
    run_plan(PLAN, BENCH, path).close()
    return Recording(path)


def test_a_run_on_the_device_is_the_run_of_the_computer(device, tmp_path):
    with Recording(recorded(PLAN, BENCH)) as here, run(tmp_path / "there.h5") as there:
        n = here.n_rows
        ours, theirs = here.parts[0].read(0, n), there.parts[0].read(0, there.n_rows)
        assert theirs[:n].tobytes() == ours.tobytes()
        assert there.n_rows - n < 0.02 * BENCH.sample_rate_hz  # the last block is whole, at 0 V
        assert not np.any(theirs["output_v"][n:])
        assert str(there.points) == str(here.points)
        assert there.parts[0].information["about"]["device"]["loop"] == "device"


def loop_of(device, hold_s=0.4, **of_device):
    for name, value in of_device.items():
        setattr(device, name, value)
    return open_session(BENCH), tone(BENCH, hold_s)


def test_blocks_that_the_wire_lost_keep_their_place_and_say_so(device):
    opened, settings = loop_of(device, lost_rows=frozenset({3, 4}))
    with opened as session:
        loop = session.start(settings)
        rows = np.concatenate([*loop.run()])
    n = loop._block
    lost = (rows["flags"] & SAMPLE_LOST) != 0
    np.testing.assert_array_equal(np.flatnonzero(lost), np.arange(3 * n, 5 * n))
    assert np.isnan(rows["inputs"][lost]).all()
    assert np.isfinite(rows["inputs"][~lost]).all()
    around = rows[: 8 * n]
    steps = np.diff(np.unwrap(around["theta_rad"].astype(float)))  # the oscillator goes on through the gap
    np.testing.assert_allclose(steps, 2.0 * np.pi * around["frequency_hz"][1:] / BENCH.sample_rate_hz, atol=2e-5)
    assert loop.failure is None
    assert loop.tick.sample == rows.size


def test_outcomes_whose_state_was_lost_are_known_at_the_end(device):
    opened, settings = loop_of(device, lost_states=Lost())
    with opened as session:
        loop = session.start(settings)
        for _ in loop.run():
            pass
        np.testing.assert_array_equal(loop.tick.outcomes, session._daq.remote.arrays.outcomes)


class Lost:
    """Every state but one in five."""

    def __contains__(self, number):
        return number % 5 != 0


@pytest.mark.parametrize("how", ["asked", "left"])
def test_a_stop_is_a_ramp_on_the_device(device, how):
    opened, settings = loop_of(device, hold_s=2.0)
    with opened as session:
        loop = session.start(settings)
        chunks = loop.run()
        for _ in range(5):
            last = next(chunks)
        if how == "asked":
            loop.request_stop("enough")
            last = [*chunks][-1]
        remote = session._daq.remote
    assert [*remote.asked] == ["begin", "ramp", "stop"]
    assert loop.tick.over
    if how == "asked":
        assert last["output_v"][-1] == 0.0
        assert loop.cause == "enough"


def test_a_silent_device_ends_the_run_and_is_told_to_stop(device):
    opened, settings = loop_of(device, silent_from=4)
    with opened as session:
        loop = session.start(settings)
        rows = np.concatenate([*loop.run()])
        assert "silent" in str(loop.failure)
        assert [*session._daq.remote.asked] == ["begin", "stop"]
    assert rows.size == 4 * loop._block
    assert loop.ended


def test_pieces_beyond_the_records_are_left_out(device):
    with open_session(BENCH) as session:
        loop = session.start(tone(BENCH, 0.1))
        assert isinstance(loop, DeviceLoop)
        before = [array.tobytes() for array in loop.tick.arrays]
        loop._note(State(0, (Record(200, 0, b"1234"), Record(9, 1 << 30, b"1234"), Record(9, 94, b"1234"))))
        assert [array.tobytes() for array in loop.tick.arrays] == before


@pytest.mark.parametrize(("digest", "named"), [("", "no-loop"), ("f" * 64, "another-loop")])
def test_another_loop_is_refused_or_left_alone(digest, named):
    daq = LoopingDAQ(BENCH)
    daq.loop_digest = digest
    with refused(DaqMismatch, named):
        runs_on_device(daq)
    daq.loop = "auto"
    assert not runs_on_device(daq)


def test_a_row_has_the_size_that_the_wire_gives_it():
    assert ROW.itemsize == ROW_BYTES
