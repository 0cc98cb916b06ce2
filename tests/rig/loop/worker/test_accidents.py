"""What else may happen to a loop in a process of its own, and what is said of it."""

import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

import rig.loop.worker.loop
import rig.loop.worker.session
from rig.errors import DaqError, RecordingError
from rig.loop.worker.loop import WallClockLoop
from rig.loop.worker.memory import PUBLISHED, Layout, SharedMemory, anonymous_file, packed
from rig.loop.worker.process import _shared
from rig.loop.worker.queue_choice import presumed_latency, queue_of
from rig.loop.worker.session import WorkerSession
from rig.loop.worker.spawn import Worker
from rig.tick.safety.layout import GuardMode
from tests.forking import FORKED
from tests.refused import refused
from tests.rig.loop.worker.drivers import NotingDAQ
from tests.rig.loop.worker.rigs import slow_bench, tone
from tests.rig.loop.worker.test_worker import ROOT, is_there, ramped, ran
from tests.waiting import LONG_S, wait_until


def loop_here(bench, settings, asked=lambda: ""):
    """A loop in this process, for what cannot be brought about in another."""
    daq = NotingDAQ(bench)
    daq.open()
    daq.start(bench.block)
    return loop_over(daq, bench, settings, asked)


def loop_over(daq, bench, settings, asked=lambda: ""):
    """The same over a driver that is running."""
    tick = settings.build(daq.latency_samples)
    tick.arrays, state = packed(tick.arrays)
    layout = Layout.of(bench, tick.arrays, len(daq.counters), 30.0)
    descriptor = anonymous_file()
    memory = SharedMemory(descriptor, layout, create=True)
    return WallClockLoop(
        daq, tick, state, memory, SimpleNamespace(fileno=lambda: os.open(os.devnull, os.O_WRONLY)), asked
    )


def test_a_computer_that_has_slept_brings_the_output_down_and_says_how_long(tmp_path, noting, monkeypatch):
    loop = loop_here(slow_bench(paced=True, log=str(tmp_path / "outputs")), tone(slow_bench(), 60.0))
    monkeypatch.setattr(rig.loop.worker.loop, "suspended_s", lambda: 3600.0 if loop.daq.blocks > 60 else 0.0)
    loop.run()
    assert loop.cause == "the computer was suspended for 3600.0 s"
    assert ramped(np.fromfile(tmp_path / "outputs", "<f8"))


def test_a_driver_that_hangs_is_noticed_and_its_process_ended(noting, monkeypatch):
    monkeypatch.setattr(rig.loop.worker.session, "LONGEST_SILENCE_S", 1.0)
    with WorkerSession(slow_bench(hangs_after=50)) as session:
        _, loop = ran(session, tone(slow_bench(), 60.0))
        assert not is_there(session.pid)
    assert type(loop.failure) is DaqError
    assert "silent for 1 s" in str(loop.failure)
    assert "only the device's watchdog" in str(loop.failure)
    assert loop.tick.guard["mode"][0] == GuardMode.OFF


def test_a_device_that_waits_for_the_host_is_never_late(noting):
    with WorkerSession(slow_bench(paced=True, lockstep=True)) as session:
        rows, loop = ran(session, tone(slow_bench(), 0.5), lambda loop, number: time.sleep(0.3 if number == 5 else 0.0))
    report = loop.report
    assert report["real_time"]["pacing"] == "lockstep"
    assert report["real_time"]["scheduling"] == "not asked for"
    assert report["overruns"] == 0
    assert report["real_time"]["stalls"] == "0"
    assert sum(report["histograms"]["execution"]["count"]) == rows.size // 10
    assert report["histograms"]["wake_up"] == report["histograms"]["response"] == {"upper_edge_us": [], "count": []}


def test_a_loop_killed_before_it_is_started_or_before_its_rows_are_asked_for_is_reported(noting):
    with WorkerSession(slow_bench()) as session:
        os.kill(session.pid, signal.SIGKILL)
        with refused(DaqError, "has-ended"):
            session.start(tone(slow_bench(), 60.0))
    with WorkerSession(slow_bench()) as session:
        loop = session.start(tone(slow_bench(), 60.0))
        os.kill(session.pid, signal.SIGKILL)
        assert sum(rows.size for rows in loop.run()) == loop.tick.sample
    assert "has ended (SIGKILL)" in str(loop.failure)


def test_a_campaign_interrupted_while_the_loop_starts_leaves_nothing_driven(tmp_path, noting, monkeypatch):
    monkeypatch.setattr(rig.loop.worker.session, "TIMEOUT_S", 2.0 * LONG_S)  # after which it would be told to
    log = tmp_path / "outputs"
    with WorkerSession(slow_bench(log=str(log))) as session:
        session.settle_queue()
        session._worker.send("start", tone(slow_bench(), 60.0), 10.0)
        assert session._worker.facts.poll(LONG_S)  # it runs, and the campaign was interrupted before it knew
        while not log.exists() or log.stat().st_size < 8 * 800:
            assert is_there(session.pid)
            time.sleep(0.02)
        began = time.monotonic()
    assert time.monotonic() - began < LONG_S
    assert not is_there(session.pid)
    assert ramped(np.fromfile(log, "<f8"))


CAMPAIGN = """
import sys
import rig
from tests.rig.loop.worker.rigs import slow_bench
print("imported", flush=True)
rig.run("magnet-beam/backbone", bench=slow_bench(log=sys.argv[1]), output=sys.argv[2])
"""


def _rows_in(output):
    """Rows that the campaign has taken from the loop and written."""
    try:
        with rig.Recording(output) as recording:
            return recording.n_rows
    except RecordingError:
        return 0


def _text_of_a_run_that_got_sigterm(folder, noting):
    log, output = folder / "outputs", folder / "run.h5"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(noting), str(ROOT), *filter(None, sys.path)])}
    command = [sys.executable, "-c", FORKED + CAMPAIGN, str(log), str(output)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as campaign:
        wait_until(lambda: campaign.poll() is not None or _rows_in(output) > 1000, "rows of a run")
        campaign.send_signal(signal.SIGTERM)
        assert campaign.wait(LONG_S) == 0
    with rig.Recording(output) as recording:
        return recording.parts[-1].end["text"]


def test_a_stop_by_a_signal_is_recorded_with_its_name(tmp_path, noting):
    for attempt in range(20):  # a busy machine may hold the loop up for so long that it ends by itself
        folder = tmp_path / str(attempt)
        folder.mkdir()
        text = _text_of_a_run_that_got_sigterm(folder, noting)
        if "stalled" not in text:
            break
    assert text == "stopped by request (SIGTERM)"


def test_after_a_drop_the_device_is_told_before_the_campaign(noting, monkeypatch):
    loop = loop_here(slow_bench(fails_after=30), tone(slow_bench(), 60.0))
    order = []
    monkeypatch.setattr(loop._memory, "publish", lambda: order.append("rows"))
    monkeypatch.setattr(loop.daq, "_stop", lambda: order.append("stop"))
    loop.run()
    assert order[-2:] == ["stop", "rows"]
    assert order.count("stop") == 1


def test_an_error_of_the_last_stop_is_the_failure_of_a_loop_without_another():
    loop = loop_here(slow_bench(), tone(slow_bench(), 0.1))

    def stop():
        raise DaqError("no answer to STOP")

    loop.daq._stop = stop
    loop.run()
    assert str(loop.failure) == "no answer to STOP"


def reserve_s(layout):
    return layout.reserve * layout.chunk / 1000.0


def test_the_ring_has_room_for_the_ramp_and_what_is_under_way_in_the_device():
    bench = slow_bench(queue_blocks=8)
    daq = NotingDAQ(bench)
    daq.open()
    presumed = presumed_latency(daq, bench, queue_of(bench))
    layout, _ = _shared(daq, tone(bench, 1.0), presumed, 1.0, anonymous_file())
    daq.start(bench.block)
    assert presumed >= daq.latency_samples > 80
    assert reserve_s(layout) >= 0.3 + 0.09 + 0.04  # ramp, queue and block, two chunks under way


def test_a_latency_known_only_once_the_device_runs_is_made_room_for(noting):
    with WorkerSession(slow_bench(late_blocks=40)) as session:
        rows, loop = ran(session, tone(slow_bench(), 0.1))
        assert reserve_s(loop._memory.layout) >= 0.3 + 0.4
    assert loop.failure is None
    assert rows.size == loop.statistics.samples > 400


def test_a_full_ring_ends_the_loop_and_nothing_is_written_where_the_campaign_may_read(noting):
    loop = loop_here(slow_bench(), tone(slow_bench(), 60.0))
    memory = loop._memory
    slots = memory.words[PUBLISHED] = memory.layout.slots
    for slot in memory._slots:
        slot.head[:] = -7
    loop.run()
    assert "no room for more" in str(loop.failure)
    assert memory.published == slots
    assert all((slot.head == -7).all() and not slot.rows["guard"].any() for slot in memory._slots)
    assert loop.daq.blocks == 0
    assert loop.daq.state.value == "open"  # stopped


class Stubborn:
    """A process that ends for no signal, or for the second one only."""

    pid = 4711

    def __init__(self, ends_when_killed):
        self.ends_when_killed, self.killed, self.waited = ends_when_killed, False, []

    def terminate(self):
        pass

    def kill(self):
        self.killed = True

    def wait(self, timeout):
        self.waited.append(timeout)
        if not (self.killed and self.ends_when_killed):
            raise subprocess.TimeoutExpired("loop", timeout)


@pytest.mark.parametrize(("killable", "said"), [(True, "has acted$"), (False, "still exists as process 4711")])
def test_a_process_that_had_to_be_killed_is_said_at_the_end_of_the_session(monkeypatch, killable, said):
    process, bench = Stubborn(killable), slow_bench()
    worker = object.__new__(Worker)
    worker._process, worker.memory = process, anonymous_file()
    worker._commands = worker.facts = SimpleNamespace(close=lambda: None)
    session = object.__new__(WorkerSession)
    session._bench, session._loop, session._worker = bench, None, worker
    with pytest.warns(RuntimeWarning, match="was killed; only the device's watchdog.*" + said):
        session.__exit__(None, None, None)
    assert min(process.waited) >= rig.loop.worker.session.TIMEOUT_S + bench.limits.ramp_down_s  # it may run unheard of
