"""Every way out of a loop hands over 0 V before the device is told to stop, and leaves a record that has an end."""

import numpy as np
import pytest

import rig
from rig.errors import DaqError, DaqTimeout
from rig.loop.loop import Loop
from rig.loop.session import open_session
from rig.recording.conversion import finalise
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason, GuardMode
from tests.refused import refused
from tests.rig.campaigns.running.test_runs import plan_with
from tests.rig.loop.worker.rigs import VOLTS, slow_bench, tone
from tests.rig.loop.worker.test_accidents import loop_over
from tests.rig.ways_out import FAULT_BLOCK, TelltaleDAQ, beyond_all_limits

PLAN = plan_with(levels_v=(0.4,), record_periods=4)


def in_this_process(daq, hold_s):
    daq.open()
    daq.start(10)
    return Loop(daq, tone(slow_bench(), hold_s).build(daq.latency_samples))


def by_the_wall_clock(daq, hold_s):
    daq.open()
    daq.start(10)
    return loop_over(daq, slow_bench(), tone(slow_bench(), hold_s))


LOOPS = pytest.mark.parametrize("loop_of", [in_this_process, by_the_wall_clock])


def ran(loop):
    for _ in loop.run() or ():
        pass
    return loop


def rig_with(queue=0, **fault):
    return TelltaleDAQ(slow_bench("virtual", queue_blocks=queue), 1, **fault)


def ramped(daq):
    """Whether the output came down without a step that the tone has not."""
    outputs = daq.outputs
    steps = np.abs(np.diff(outputs))
    return np.abs(outputs).max() > 0.9 * VOLTS and steps[300:].max() < 1.05 * steps[150:300].max()


@LOOPS
@pytest.mark.parametrize("queue", [0, 2])
def test_an_output_that_is_dropped_is_handed_over_as_0_v_through_the_queue_before_the_stop(loop_of, queue):
    daq = rig_with(queue, fault=beyond_all_limits)
    loop = ran(loop_of(daq, 60.0))
    assert loop.tick.guard["dropped"][0] == 1
    assert daq.zeros_at_the_end == queue + 1
    assert sum(block is None for block in daq.handed) == 1


@LOOPS
@pytest.mark.parametrize("error", [DaqTimeout("no block came"), RuntimeError("vendor error -200279")])
def test_a_device_that_fails_once_and_still_answers_gets_0_v(loop_of, error):
    daq = rig_with(2, raises=error)
    loop = ran(loop_of(daq, 60.0))
    assert str(error) in str(loop.failure)
    assert isinstance(loop.failure, DaqError)
    assert daq.zeros_at_the_end == 3


@LOOPS
def test_a_device_that_is_gone_is_told_to_stop_after_one_more_try(loop_of):
    daq = rig_with(2, raises=DaqTimeout("no block came"), times=1000)
    ran(loop_of(daq, 60.0))
    assert daq.calls == FAULT_BLOCK + 1
    assert daq.handed[-1] is None


@LOOPS
def test_a_ramp_ends_with_0_v_through_the_queue_and_no_block_more(loop_of):
    daq = rig_with(2)
    loop = ran(loop_of(daq, 0.1))
    assert EndReason(int(loop.tick.guard["reason"][0])) is EndReason.COMPLETED
    assert ramped(daq)
    assert 3 <= daq.zeros_at_the_end <= 4


def test_the_rows_are_those_of_before_the_blocks_of_0_v():
    daq = rig_with(2, fault=beyond_all_limits)
    loop = in_this_process(daq, 60.0)
    rows = np.concatenate(list(loop.run()))
    assert rows.size == loop.statistics.samples == 10 * FAULT_BLOCK
    assert daq.calls == FAULT_BLOCK + 3


@LOOPS
@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit])
def test_an_interruption_inside_the_driver_ramps_and_goes_on_afterwards(loop_of, kind):
    def broken_off(inputs):
        raise kind("window closed")

    daq = rig_with(fault=broken_off)
    loop = loop_of(daq, 60.0)
    if loop_of is in_this_process:
        with pytest.raises(kind, match="window closed"):
            ran(loop)
    else:
        ran(loop)  # its process has nobody to raise it to
    assert EndReason(int(loop.tick.guard["reason"][0])) is EndReason.STOP_REQUESTED
    assert loop.cause == f"{kind.__name__} was raised in the driver: window closed"
    assert ramped(daq)
    assert daq.zeros_at_the_end >= 1
    assert loop.failure is None


@LOOPS
def test_an_interruption_that_comes_again_drops_the_output(loop_of):
    daq = rig_with(raises=SystemExit(3), times=2)
    loop = loop_of(daq, 60.0)
    if loop_of is in_this_process:
        with pytest.raises(SystemExit):
            ran(loop)
    else:
        ran(loop)
    assert "SystemExit" in str(loop.failure)
    assert loop.tick.guard["mode"][0] == GuardMode.OFF
    assert daq.zeros_at_the_end == 1


def telltale(monkeypatch, **fault):
    """Have campaigns open a telltale in this process; returns the list that it will stand in."""
    made = []

    def make(bench, seed):
        made.append(TelltaleDAQ(bench, seed, **fault))
        return made[-1]

    monkeypatch.setattr("rig.loop.session.make_daq", make)
    monkeypatch.setattr("rig.loop.worker.spawn.supported", lambda: False)
    return made


def ending(output):
    """How a part ended whose campaign was left by an exception: its journal is complete."""
    finalise(journal_path(output), output)
    with Recording(output) as recording:
        return recording.parts[-1].end


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit])
def test_an_interruption_in_the_driver_leaves_a_finished_journal_and_is_raised(kind, monkeypatch, tmp_path):
    (made, output) = telltale(monkeypatch, raises=kind("closed")), tmp_path / "run.h5"
    with pytest.raises(kind):
        rig.run(PLAN, bench=slow_bench("virtual"), output=output)
    end = ending(output)
    assert (end["reason"], end["completed"]) == ("stop_requested", False)
    assert end["text"] == f"{kind.__name__} was raised in the driver: closed"
    assert made[0].zeros_at_the_end >= 1


def test_any_exception_in_a_driver_of_this_process_is_a_recorded_failure(monkeypatch):
    telltale(monkeypatch, raises=ZeroDivisionError("in the vendor's code"))
    with rig.run(PLAN, bench=slow_bench("virtual")) as run:
        end = run.recording.parts[-1].end
    assert end["reason"] == "driver_failed"
    assert end["text"] == "the driver has failed: ZeroDivisionError: in the vendor's code"


class Impatient:
    """Somebody who watches, and leaves."""

    def point(self, point, number, total):
        pass

    def remark(self, text):
        pass

    def advance(self, rows, tick):
        if tick.sample > 400:
            raise SystemExit("enough seen")


def test_whoever_watches_may_leave_the_rig_comes_down_first(monkeypatch, tmp_path):
    (made, output) = telltale(monkeypatch), tmp_path / "run.h5"
    with refused(SystemExit, "enough-seen"):
        rig.run(PLAN, bench=slow_bench("virtual"), output=output, progress=Impatient())
    assert ending(output)["text"] == "stopped by an error outside the loop: SystemExit: enough seen"
    assert made[0].outputs[-1] == 0.0
    assert made[0].zeros_at_the_end >= 1


def test_leaving_a_session_of_this_process_in_mid_run_ramps_down_first(monkeypatch):
    made = telltale(monkeypatch)
    with pytest.raises(ZeroDivisionError), open_session(slow_bench("virtual")) as session:
        [1 // (30 - number) for number, _ in enumerate(session.start(tone(slow_bench(), 60.0)).run())]
    assert ramped(made[0])
    assert made[0].zeros_at_the_end >= 1


def test_a_driver_that_fails_when_it_is_closed_costs_no_recording(monkeypatch):
    monkeypatch.setattr(TelltaleDAQ, "_close", lambda self: 1 // 0)
    telltale(monkeypatch)
    with (
        pytest.warns(RuntimeWarning, match="failed when it was closed: .*ZeroDivisionError"),
        rig.run(PLAN, bench=slow_bench("virtual")) as run,
    ):
        assert run.recording.parts[-1].end["reason"] == "completed"


@pytest.mark.parametrize("step", ["_open", "_start", "_stop", "_close"])
def test_what_a_driver_raises_of_its_own_is_a_daq_error_at_every_step(step):
    daq = rig_with()
    setattr(daq, step, lambda: {}["handle"])

    def life():
        daq.open()
        daq.start(1)
        daq.stop()
        daq.close()

    with refused(DaqError, "the-driver-has-failed-key-error"):
        life()
