"""The buffer thread over a chassis without a clock: what is on the output when loop, thread or device fail."""

import threading

import numpy as np
import pytest
from grpc import StatusCode
from nidaqmx.error_codes import DAQmxErrors
from nidaqmx.errors import DaqError as NiError, DaqNotFoundError, RpcError

from rig.continuation import period_steps
from rig.drivers.nidaqmx.buffer import CONTINUED, HELD, BufferThread, Plan
from rig.drivers.nidaqmx.library import BY_CODE, as_ni_error
from rig.errors import DaqDisconnected, DaqError, DaqOverrun, DaqRefused, DaqTimeout, DaqWatchdog
from tests.refused import refused
from tests.rig.drivers.nidaqmx.chassis import Chassis

RATE_HZ, BLOCK, AHEAD, LOOP = 10_000.0, 20, 3, 2
PERIOD = 97.3  # samples
AMPLITUDE_V = 2.0


def plan(**changes):
    facts = {
        "block": BLOCK,
        "inputs": 2,
        "ahead": AHEAD,
        "queue": AHEAD + LOOP,
        "watchdog": 1000,
        "ramp": 200,
        "longest_period": 5000,
        "output_range_v": 10.0,
        "timeout_s": 5.0,
        "rate_hz": RATE_HZ,
        "lockstep": False,
    }
    return Plan(**{**facts, **changes})


class Loop:
    """A loop that hands over a sine, or a constant, and takes blocks."""

    def __init__(self, periodic=True, **changes):
        self.plan = plan(**changes)
        self.chassis = Chassis(BLOCK, self.plan.queue)
        self.thread = BufferThread(self.chassis, self.plan)
        self.chassis.is_over = lambda: self.thread.is_over
        self.chassis.lockstep = self.plan.lockstep
        self.periodic = periodic
        self.handed = 0
        self.blocks = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        """End the thread while the device goes on to sample."""
        ending = threading.Thread(target=self.thread.end)
        ending.start()
        while ending.is_alive() and not self.thread.is_ending:
            ending.join(0.001)
        while ending.is_alive() and not (self.thread.is_over or self.chassis.faults):
            self.chassis.sample()
        ending.join()

    def volts(self, instants):
        sine = AMPLITUDE_V * np.sin(2.0 * np.pi * np.asarray(instants) / PERIOD)
        return sine if self.periodic else np.full(np.shape(instants), AMPLITUDE_V)

    def hand_over(self):
        first = (self.handed + self.plan.queue) * BLOCK
        period = period_steps(PERIOD) if self.periodic else 0
        self.thread.hand_over(self.volts(first + np.arange(BLOCK)), period, 0)
        self.handed += 1

    def take(self):
        block = self.thread.take()
        self.blocks.append((block.inputs.copy(), block.raised, block.put_out.copy()))

    def exchange(self, blocks):
        for _ in range(blocks):
            self.hand_over()
            self.chassis.sample()
            self.take()


def test_an_output_is_put_out_after_queue_and_buffer_and_comes_back_at_its_instant():
    with Loop() as loop:
        loop.exchange(40)
        put_out = loop.chassis.put_out
        first = (AHEAD + LOOP) * BLOCK
        assert not put_out[:first].any()
        np.testing.assert_array_equal(put_out[first:], loop.volts(np.arange(first, put_out.size)))
        inputs = np.concatenate([block[0] for block in loop.blocks], axis=1)
        np.testing.assert_array_equal(inputs[1], -0.5 * put_out[: inputs.shape[1]])
        assert not any(block[1] for block in loop.blocks)


def test_nothing_is_started_before_the_first_output():
    with Loop() as loop:
        assert not loop.chassis.is_started


@pytest.mark.parametrize("periodic", [True, False])
def test_a_late_loop_does_not_let_the_buffer_run_dry(periodic):
    with Loop(periodic) as loop:
        loop.exchange(30)
        loop.chassis.sample(12)  # the loop sleeps
        for _ in range(12):
            loop.take()
        for _ in range(12):
            loop.hand_over()  # too late, each of them
        loop.exchange(10)
        put_out, first = loop.chassis.put_out, (AHEAD + LOOP) * BLOCK
        late = slice((30 + AHEAD + LOOP) * BLOCK, (42 + AHEAD + LOOP - LOOP + 1) * BLOCK)
        expected = loop.volts(np.arange(put_out.size))
        expected[:first] = 0.0
        assert np.abs(put_out - expected)[: late.start].max() == 0.0
        assert np.abs(put_out - expected)[late].max() < (2e-4 if periodic else 1e-12) * AMPLITUDE_V
        assert np.abs(put_out - expected)[late.stop :].max() < 1e-12
        raised = np.array([block[1] for block in loop.blocks])
        assert set(raised) == {0, CONTINUED if periodic else HELD}
        assert raised.nonzero()[0][0] == 30 + AHEAD + LOOP
        for number, (_, flag, told) in enumerate(loop.blocks):
            if flag:
                np.testing.assert_array_equal(told, put_out[number * BLOCK : (number + 1) * BLOCK])


def test_a_loop_that_is_stuck_is_brought_to_zero_by_its_watchdog_without_a_step():
    with Loop() as loop:
        loop.exchange(30)
        loop.chassis.sample(200)
        with refused(DaqWatchdog, "watchdog-s"):
            for _ in range(200):
                loop.take()
        put_out = loop.chassis.put_out
        handed = (30 + AHEAD + LOOP) * BLOCK
        assert np.abs(put_out[handed : handed + 1000]).max() == pytest.approx(AMPLITUDE_V, rel=1e-3)
        assert not put_out[handed + 1000 + 200 + BLOCK :].any()
        assert np.abs(np.diff(put_out[(AHEAD + LOOP) * BLOCK :])).max() < 1.1 * AMPLITUDE_V * 2.0 * np.pi / PERIOD


def test_in_lockstep_the_device_waits_for_the_loop():
    with Loop(lockstep=True, queue=AHEAD + 1) as loop:
        loop.exchange(10)
        loop.chassis.allowed += 1  # more could be measured
        assert loop.chassis.measured == 10
        loop.hand_over()
        loop.take()
        assert loop.chassis.measured == 11
        loop.exchange(5)
        assert not any(block[1] for block in loop.blocks)


def test_what_is_handed_over_in_time_lies_in_the_device_for_the_whole_queue():
    with Loop() as loop:
        loop.exchange(10)
        lying = loop.handed + loop.plan.queue
        assert len(loop.chassis.written) == lying
        loop.chassis.sample(LOOP - 1)  # the loop is late, but nothing of it is due yet
        assert len(loop.chassis.written) == lying
        loop.chassis.sample()
        assert len(loop.chassis.written) == lying + 1


@pytest.mark.parametrize("periodic", [True, False])
def test_the_end_is_a_ramp_to_zero_and_then_nothing(periodic):
    with Loop(periodic) as loop:
        loop.exchange(30)
        loop.end()
        put_out = loop.chassis.put_out
        last = put_out.nonzero()[0][-1]
        handed = len(loop.chassis.written)
        assert not put_out[-(AHEAD + 1) * BLOCK :].any()
        assert last < (30 + AHEAD + LOOP) * BLOCK + 200 + BLOCK
        steepest = AMPLITUDE_V * 2.0 * np.pi / PERIOD if periodic else AMPLITUDE_V * 0.5 * np.pi / 200
        after = put_out[(AHEAD + LOOP + 1) * BLOCK :]
        assert np.abs(np.diff(after)).max() < 1.1 * steepest
        loop.chassis.sample(5)
        assert len(loop.chassis.written) == handed  # the thread has ended


def test_after_zeros_nothing_but_zeros_follows():
    with Loop() as loop:
        loop.exchange(30)
        for _ in range(AHEAD + LOOP + 2):
            loop.thread.hand_over(np.zeros(BLOCK), 0, 0)
            loop.handed += 1
            loop.chassis.sample()
            loop.take()
        before = len(loop.chassis.written)
        loop.end()
        assert loop.thread.is_over
        assert not loop.chassis.put_out[before * BLOCK :].any()


def test_a_thread_that_is_late_itself_is_told_that_the_device_has_stopped():
    with Loop() as loop:
        loop.exchange(30)
        loop.chassis.run_dry()
        with refused(DaqOverrun, "ran-empty-buffer-blocks"):
            loop.exchange(3)


def test_inputs_that_were_lost_end_with_zero_on_the_output():
    with Loop() as loop:
        loop.exchange(30)
        loop.chassis.break_("read", DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE)
        loop.hand_over()
        with refused(DaqOverrun, "inputs-were-not-fetched"):
            loop.take()
        loop.end()
        put_out = loop.chassis.put_out
        assert not put_out[-(AHEAD + 1) * BLOCK :].any()
        assert np.abs(np.diff(put_out[(AHEAD + LOOP + 1) * BLOCK :])).max() < 1.1 * AMPLITUDE_V * 2.0 * np.pi / PERIOD


@pytest.mark.parametrize("code", sorted(BY_CODE))
def test_each_error_of_ni_ends_the_run_with_its_code_and_what_to_do(code):
    kind, what = BY_CODE[code]
    with Loop() as loop:
        loop.exchange(10)
        loop.chassis.break_("read", code, "First line.\n\nSecond.")
        loop.hand_over()
        with pytest.raises(DaqError) as caught:
            loop.take()
        assert type(caught.value) is kind
        assert what[:40] in str(caught.value)
        assert f"NI-DAQmx {code}: First line." in str(caught.value)
        assert "\n" not in str(caught.value)
        loop.end()
        assert not loop.chassis.put_out[-BLOCK:].any()


def test_codes_are_those_of_ni():
    assert {DAQmxErrors(code).value for code in BY_CODE} == set(BY_CODE)


def test_other_errors_are_told_too():
    unknown = as_ni_error(NiError("Something.", -12345), "Dev1")
    assert type(unknown) is DaqError
    assert "-12345: Something." in str(unknown)
    assert isinstance(as_ni_error(DaqNotFoundError("none"), ""), DaqRefused)
    assert isinstance(as_ni_error(RpcError(StatusCode.UNAVAILABLE, "no server"), "host:1"), DaqDisconnected)
    assert type(as_ni_error(RpcError(StatusCode.UNKNOWN, "it broke"), "host:1")) is DaqError


def test_a_device_that_is_unplugged_is_told_from_one_that_is_silent():
    with Loop(timeout_s=0.1) as loop:
        loop.exchange(10)
        loop.hand_over()
        with refused(DaqTimeout, "has-not-answered"):
            loop.take()
        loop.chassis.break_("read", DAQmxErrors.DEV_ABSENT_OR_UNAVAILABLE)
        loop.chassis.break_("write", DAQmxErrors.DEV_ABSENT_OR_UNAVAILABLE)
        with refused(DaqDisconnected, "device-is-gone"):
            loop.take()
