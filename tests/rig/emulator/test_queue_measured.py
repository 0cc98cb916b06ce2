"""Accidents while the queue of a device is measured: the loop ends, the device stands still, and nothing latches."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import rig
from rig.bench import Bench
from rig.campaigns.plans import load_plan
from rig.emulator.emulated import Emulator
from rig.errors import ConfigurationError, DaqDisconnected, DaqError
from rig.loop.worker.session import WorkerSession
from tests.refused import refused
from tests.rig.rigs import bench_with
from tests.waiting import wait_until

BLOCK = 50  # 10 ms


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    with Emulator(bench_with({"block": BLOCK}), lockstep=False) as one:
        yield one


def measuring(session: WorkerSession) -> None:
    """Order a measurement that lasts for a minute if it is left alone, and wait until the device is armed for it."""
    session._worker.send("queue", {"seconds": 60.0}, {}, False)
    wait_until(lambda: handles_signals(session.pid), "the measurement has begun")


def handles_signals(pid: int) -> bool:
    status = Path(f"/proc/{pid}/status").read_text()
    caught = next(int(line.split()[1], 16) for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(caught & (1 << (signal.SIGTERM - 1)))


def finds_it_at_rest(bench: Bench) -> None:
    with WorkerSession(bench) as session:
        assert session.latched == ""
        assert not any("still running" in remark for remark in session.remarks)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP"])
def test_a_signal_ends_a_measurement_and_is_named(emulator: Emulator, name: str) -> None:
    with WorkerSession(emulator.bench) as session:
        measuring(session)
        os.kill(session.pid, getattr(signal, name))
        with refused(DaqError, reason=f"the loop's process was asked to end ({name})"):
            session._worker.receive("queue")
    finds_it_at_rest(emulator.bench)


def test_a_campaign_that_is_gone_ends_a_measurement(emulator: Emulator) -> None:
    with WorkerSession(emulator.bench) as session:
        measuring(session)
    finds_it_at_rest(emulator.bench)


def test_a_device_unplugged_during_a_measurement_is_said(emulator: Emulator) -> None:
    with WorkerSession(emulator.bench) as session:
        measuring(session)
        assert emulator.process is not None
        emulator.process.kill()
        with refused(DaqDisconnected, "the-port-is-gone"):
            session._worker.receive("queue")


def test_signals_are_as_before_after_a_measurement(emulator: Emulator) -> None:
    with WorkerSession(emulator.bench) as session:
        choice = session.settle_queue()
        assert choice is not None
        assert choice.how == "measured"
        assert not handles_signals(session.pid)
        assert "ordinary" in scheduling_of(session.pid)


def scheduling_of(pid: int) -> str:
    return "ordinary" if os.sched_getscheduler(pid) == os.SCHED_OTHER else "real-time"


def run_on(bench: Bench, plan: str, **changes: Any) -> tuple[list[str], dict[str, Any]]:
    """The notes of a run, and what its first part says of itself."""
    with rig.run(load_plan(plan).model_copy(update=changes), bench=bench) as done:
        about = done.recording.parts[0].information["about"]
        return about["remarks"], about["queue"]


@pytest.mark.slow
def test_a_run_says_and_records_its_queue(emulator: Emulator) -> None:
    remarks, queue = run_on(emulator.bench, "magnet-beam/backbone", levels_v=(0.3923,), record_periods=5)
    assert queue["how"] == "measured"
    assert queue["text"].startswith(f"queue_blocks = {queue['blocks']} (auto): lasts ")
    assert remarks[0] == queue["text"]


def test_a_multisine_gets_a_tenth_of_a_second(emulator: Emulator) -> None:
    remarks, queue = run_on(
        emulator.bench, "magnet-beam/multisine-1", levels_rms_v=(0.05,), resolution_hz=1.0, realisations=1
    )
    assert (queue["how"], queue["blocks"]) == ("open loop", 10)
    assert "no output of this plan" in remarks[0]


def test_gains_that_do_not_bear_the_delay_are_refused_before_anything_is_recorded(
    emulator: Emulator, tmp_path: Path
) -> None:
    plan = load_plan("magnet-beam/backbone")
    law = plan.law.model_copy(update={"k1": 1000.0})  # type: ignore[attr-defined]
    plan = plan.model_copy(update={"controller": law})
    with refused(ConfigurationError, "controller-ms-from-output-to-input", field="controller.k1 = 1000, k2 = 6.28319"):
        rig.run(plan, output=tmp_path / "run.h5", bench=emulator.bench)
    assert list(tmp_path.iterdir()) == []
    finds_it_at_rest(emulator.bench)
