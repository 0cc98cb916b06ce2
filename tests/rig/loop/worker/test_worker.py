"""The loop in a process of its own: the same rows, and a safe end whoever is killed, stopped or unplugged."""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rig
from controller import PhaseLockedLoop, preset
from rig.drivers import make_daq
from rig.errors import ConfigurationError, DaqBusy, DaqDisconnected, DaqError
from rig.loop.loop import Loop
from rig.loop.session import LocalSession, open_session
from rig.loop.worker.session import WorkerSession
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.sequencer.layout import SegmentKind
from tests.forking import FORKED, fresh
from tests.named_memory import named_memory
from tests.refused import refused
from tests.rig.loop.worker.rigs import RATE_HZ, VOLTS, slow_bench, tone
from tests.waiting import wait_until

ROOT = Path(__file__).parents[4]


def ran(session, settings, each=None):
    """All rows of a run, and its loop; ``each`` is called after every chunk."""
    loop = session.start(settings)
    rows = []
    for chunk in loop.run():
        rows.append(chunk)
        if each is not None:
            each(loop, len(rows))
    return np.concatenate(rows), loop


def ended_by(loop):
    return EndReason(int(loop.tick.guard["reason"][0]))


def ramped(outputs):
    """Whether a logged output went to 0 V without a step that the tone itself does not have."""
    steps = np.abs(np.diff(outputs))
    settled = steps[200:400].max()
    return bool(np.abs(outputs).max() > 0.9 * VOLTS and outputs[-1] == 0.0 and steps[400:].max() < 1.05 * settled)


def is_there(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_the_start_is_released_across_the_processes():
    bench, held = slow_bench("virtual", block=4), []

    def each(loop, chunks):
        held.append(int(loop.tick.arrays.progress["held_back"][0]))
        if chunks == 3:
            loop.release_start()

    settings = tone(bench, 1.0)
    start = replace(settings.segments[-1], kind=SegmentKind.START)
    with WorkerSession(bench, 3) as session:
        ran(session, replace(settings, segments=(*settings.segments, start), start_judged=True), each)
    assert held[:3] == [1, 1, 1]
    assert held[-1] == 0


def test_rows_and_state_are_those_of_a_loop_in_this_process_bit_for_bit():
    bench = slow_bench("virtual", block=4)
    with make_daq(bench, 3) as daq:
        fused, _ = ran(LocalSession(daq, bench, realtime=False), tone(bench, 0.3))
    with make_daq(bench, 3) as daq:
        daq.start(bench.block)
        local = Loop(daq, tone(bench, 0.3).build(daq.latency_samples), fused=False)
        here = np.concatenate(list(local.run()))
    with WorkerSession(bench, 3) as session:
        there, loop = ran(session, tone(bench, 0.3))
        assert os.getsid(session.pid) != os.getsid(0)  # a terminal's Ctrl-C does not reach it
    assert there.tobytes() == here.tobytes()
    assert there[: fused.size].tobytes() == fused.tobytes()
    assert there.size - fused.size < bench.block  # compiled in one, it ends within a block
    assert ended_by(loop) is EndReason.COMPLETED
    for name in ("loop", "guard", "outcomes", "settling", "progress", "watches"):
        assert getattr(loop.tick.arrays, name).tobytes() == getattr(local.tick.arrays, name).tobytes()
    report = loop.report
    assert report["samples"] == there.size
    for name in ("wake_up", "execution", "response"):
        assert sum(report["histograms"][name]["count"]) == there.size // 4
        assert 0 <= report[f"{name}_us"]["p50"] <= report[f"{name}_us"]["p99"] <= report[f"{name}_us"]["largest"]
    assert report["wall_s"] >= (there.size - bench.block) / RATE_HZ  # later than the clock it may be, never earlier
    assert report["real_time"]["pacing"] == "host"


PARENT = """
import sys
from rig.loop.worker.session import WorkerSession
from tests.rig.loop.worker.rigs import slow_bench, tone
bench = slow_bench(log=sys.argv[1])
with WorkerSession(bench) as session:
    loop = session.start(tone(bench, 60.0))
    for number, rows in enumerate(loop.run()):
        if number == 20:
            print(session.pid, flush=True)
"""


def test_when_the_campaign_is_killed_the_loop_ramps_down_and_leaves_nothing(tmp_path, noting):
    log = tmp_path / "outputs"
    before = named_memory()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(noting), str(ROOT), *filter(None, sys.path)])}
    with subprocess.Popen(
        [sys.executable, "-c", FORKED + PARENT, str(log)], stdout=subprocess.PIPE, text=True, env=environment
    ) as parent:
        pid = int(parent.stdout.readline())
        parent.kill()
    wait_until(lambda: not is_there(pid), "end of the loop's process")
    assert ramped(np.fromfile(log, "<f8"))
    assert named_memory() <= before


def test_when_the_loop_is_killed_the_campaign_says_so_and_keeps_its_rows(tmp_path, noting):
    class Killer:
        pid = 0

        def point(self, point, number, total):
            pass

        def remark(self, text):
            pass

        def advance(self, rows, tick):
            if tick.sample > 500:
                for folder in Path("/proc/self/task").iterdir():
                    for pid in (folder / "children").read_text().split():
                        if b"rig.loop.worker" in Path(f"/proc/{pid}/cmdline").read_bytes():
                            os.kill(int(pid), signal.SIGKILL)

    with (
        fresh(),  # by whose name it is found
        rig.run("magnet-beam/backbone", bench=slow_bench(), output=tmp_path / "run.h5", progress=Killer()) as run,
    ):
        (part,) = run.recording.parts
        assert part.n_rows > 500
        assert "ended (SIGKILL)" in part.end["text"]
        assert part.end["tripped"]
        assert not run.complete
        assert np.isfinite(part.read(0, part.n_rows)["inputs"]).all()


def test_a_campaign_that_takes_no_rows_loses_none_and_the_output_comes_down(tmp_path, noting):
    bench, log = slow_bench(log=str(tmp_path / "outputs")), tmp_path / "outputs"
    with WorkerSession(bench, ring_s=0.8) as session:
        rows, loop = ran(session, tone(bench, 60.0), lambda loop, number: time.sleep(2.5 if number == 5 else 0.0))
    assert "did not take its rows" in loop.cause
    assert ended_by(loop) is EndReason.STOP_REQUESTED
    assert loop.failure is None
    assert rows.size == loop.statistics.samples == np.fromfile(log, "<f8").size
    assert ramped(np.fromfile(log, "<f8"))
    turns = np.diff(np.unwrap(rows["theta_rad"][100:].astype(float)))
    assert np.allclose(turns, 2 * np.pi * 20.0 / RATE_HZ, atol=1e-5)  # not one is missing


def test_a_signal_to_the_loop_itself_is_a_ramp_and_is_said(tmp_path, noting):
    log = tmp_path / "outputs"
    bench = slow_bench(log=str(log))
    with WorkerSession(bench) as session:
        _, loop = ran(
            session,
            tone(bench, 60.0),
            lambda loop, count: os.kill(session.pid, signal.SIGTERM) if count == 25 else None,
        )
    assert "SIGTERM" in loop.cause
    assert ramped(np.fromfile(log, "<f8"))


def test_a_loop_that_stood_still_ramps_down_and_says_how_long(tmp_path, noting):
    log = tmp_path / "outputs"
    bench = slow_bench(log=str(log))

    def halt(loop, count):
        if count == 25:
            os.kill(session.pid, signal.SIGSTOP)
            time.sleep(1.5)
            os.kill(session.pid, signal.SIGCONT)

    with WorkerSession(bench) as session:
        _, loop = ran(session, tone(bench, 60.0), halt)
    stood_s = re.fullmatch(r"the loop stalled for ([0-9.]+) s.*", loop.cause)
    assert stood_s is not None, loop.cause
    assert float(stood_s[1]) > 1.0
    assert loop.statistics.overruns >= 1
    assert ramped(np.fromfile(log, "<f8"))


def test_leaving_the_session_in_mid_run_ramps_down_first(tmp_path, noting):
    log = tmp_path / "outputs"
    bench = slow_bench(log=str(log))
    with pytest.raises(ZeroDivisionError), WorkerSession(bench) as session:
        ran(session, tone(bench, 60.0), lambda loop, count: 1 // (count - 25))
    assert not is_there(session.pid)
    assert ramped(np.fromfile(log, "<f8"))


def test_errors_of_the_driver_arrive_with_their_class_and_message(noting):
    with refused(DaqBusy, "port-is-held"), open_session(slow_bench(busy=True)):
        pass
    with open_session(slow_bench(fails_after=30, paced=True)) as session:
        assert session.identity == {"model": "virtual rig with a log"}
        rows, loop = ran(session, tone(slow_bench(), 60.0))
    assert isinstance(loop.failure, DaqDisconnected)
    assert str(loop.failure) == "port X is gone"
    assert rows.size == 300
    assert ended_by(loop) is EndReason.DRIVER_FAILED
    assert loop.tick.guard["mode"][0] == GuardMode.OFF
    assert loop.report["real_time"]["pacing"] == "device"


@pytest.mark.parametrize("hold_s", [0.30, 0.31])
def test_the_output_comes_down_in_the_rows_whichever_block_of_a_chunk_is_the_last(hold_s):
    bench = slow_bench("virtual")  # chunks are of two blocks
    with WorkerSession(bench) as session:
        rows, loop = ran(session, tone(bench, hold_s))
    assert rows.size == loop.report["samples"]
    assert rows["output_v"][-1] == 0.0


@pytest.mark.filterwarnings("default")
def test_a_driver_with_a_fault_of_its_own_ends_the_run_as_a_failed_driver(noting):
    with open_session(slow_bench(fails_after=30, fails_with="TypeError")) as session:
        _, loop = ran(session, tone(slow_bench(), 60.0))
    assert type(loop.failure) is DaqError
    assert "TypeError: port X is gone" in str(loop.failure)


def test_a_law_of_the_script_s_own_is_refused_in_a_line_that_says_where_to_put_it(noting, monkeypatch):
    class OwnLaw(PhaseLockedLoop):
        """As if it had been written in the script that is run."""

    OwnLaw.__module__, OwnLaw.__qualname__ = "__main__", "OwnLaw"
    monkeypatch.setattr(sys.modules["__main__"], "OwnLaw", OwnLaw, raising=False)
    settings = replace(tone(slow_bench(), 1.0), law=OwnLaw.model_validate(preset("magnet-beam").model_dump()))
    with (
        open_session(slow_bench()) as session,
        refused(ConfigurationError, "own-law-must-be-defined-in"),
    ):
        session.start(settings)


def test_what_the_device_had_latched_is_told_by_the_session_and_cleared_by_its_start(noting):
    with WorkerSession(slow_bench(latched="the watchdog had latched"), privileged=False) as session:
        assert session.latched == "the watchdog had latched"
        rows, loop = ran(session, tone(slow_bench(), 0.1))
    assert loop.failure is None
    assert rows.size > 0
