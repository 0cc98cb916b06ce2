"""The device's state machine, with time handed in and a plant that writes down what it was given."""

import math

import numpy as np
import pytest

from rig.emulator import Device, Faults
from rig.emulator.parameters import described
from rig.errors import DaqTimeout
from rig.wire.link import Link, Load
from rig.wire.messages import (
    ARM_KEY,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Parameter,
    Request,
    Samples,
    Status,
    Stream,
)

RATE_HZ = 1000.0
BLOCK = 10
QUEUE = 2
WATCHDOG_S = 0.1
RAMP_S = 0.05
COUNT_V = 0.001


class Notebook:
    """A plant of two channels that read 0; ``output_v`` is what it was given."""

    names = ("force", "drive")
    range_v = np.array([10.0, 10.0])
    v_per_count = np.array([COUNT_V, COUNT_V])
    skew_s = np.zeros(2)
    output_range_v = 10.0
    output_v_per_count = COUNT_V
    bits = 16
    rate_hz = RATE_HZ
    filter_delay_s = 0.0

    def __init__(self) -> None:
        self.output_v = np.zeros(0)

    def reset(self) -> None:
        self.output_v = np.zeros(0)

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        self.output_v = np.append(self.output_v, voltages)
        return np.zeros((voltages.size, 2), np.int16), 0


class Outbox(Link):
    """Keeps what was sent; ``full`` takes nothing more."""

    def __init__(self) -> None:
        super().__init__("outbox")
        self.sent: list[Message] = []
        self.full = False

    def send(self, message: Message) -> None:
        if self.full:
            raise DaqTimeout("nobody reads")
        self.sent.append(message)

    def of(self, kind: type) -> list:
        return [message for message in self.sent if isinstance(message, kind)]

    def open(self) -> None: ...

    def close(self) -> None: ...

    def configure(self, stream: Stream) -> None:
        self.stream = stream

    def receive(self, timeout_s: float) -> Message | None:
        return None

    def load(self, stream: Stream) -> Load:
        return Load(0.0, math.inf, "")


class Bench:
    """A device and somebody who asks it."""

    def __init__(self, *, lockstep: bool = False, faults: Faults | None = None) -> None:
        self.plant, self.link = Notebook(), Outbox()
        self.device = Device(self.plant, described(self.plant), self.link, lockstep=lockstep, faults=faults)
        self.now_s = 100.0
        self.number = 0

    def ask(self, command: Command, parameter: int = 0, value: int = 0, item: int = 0) -> Answer:
        self.number += 1
        self.device.handle(Request(self.number, command, parameter, item, value), self.now_s)
        return self.link.of(Answer)[-1]

    def pass_time(self, seconds: float) -> None:
        """Let time go by, deadline by deadline."""
        until = self.now_s + seconds
        while self.device.wake_s < until:
            self.now_s = max(self.now_s, self.device.wake_s)
            self.device.advance(self.now_s)
        self.now_s = until
        self.device.advance(until)

    def set_up(self, watchdog_s: float = WATCHDOG_S, ramp_s: float = RAMP_S) -> None:
        settings = {
            Parameter.BLOCK: BLOCK,
            Parameter.QUEUE: QUEUE,
            Parameter.WATCHDOG_US: round(1e6 * watchdog_s),
            Parameter.RAMP_US: round(1e6 * ramp_s),
        }
        for parameter, value in settings.items():
            assert self.ask(Command.SET, parameter, value).status == Status.DONE

    def armed(self, watchdog_s: float = WATCHDOG_S, ramp_s: float = RAMP_S) -> float:
        """Start and arm; returns the instant of sample 0."""
        self.set_up(watchdog_s, ramp_s)
        assert self.ask(Command.START).status == Status.DONE
        assert self.ask(Command.ARM, value=ARM_KEY).status == Status.DONE
        return self.now_s

    def put(self, first: int, volts: float | np.ndarray) -> None:
        counts = np.rint(np.broadcast_to(np.asarray(volts) / COUNT_V, BLOCK)).astype(np.int16)
        self.device.handle(Output(first, counts), self.now_s)

    def drive(self, blocks: int, volts: float) -> None:
        """Hand over outputs in time for blocks from the first after the queue on."""
        for block in range(blocks):
            self.put((block + QUEUE) * BLOCK, volts)
            self.pass_time(BLOCK / RATE_HZ)


def test_it_tells_what_it_is() -> None:
    bench = Bench()
    assert bench.ask(Command.GET, Parameter.N_CHANNELS).value == 2
    assert bench.ask(Command.GET, Parameter.STATE).value == DeviceState.IDLE
    assert bench.ask(Command.GET, Parameter.PING, item=7).status == Status.DONE
    assert bench.ask(Command.GET, 250).status == Status.UNKNOWN
    assert bench.ask(99).status == Status.UNKNOWN


def test_a_value_that_is_not_allowed_is_answered_by_the_nearest_that_is() -> None:
    bench = Bench()
    answer = bench.ask(Command.SET, Parameter.RATE_MHZ, 5_000_000)
    assert (answer.status, answer.value) == (Status.NOT_ALLOWED, 1_000_000)
    answer = bench.ask(Command.SET, Parameter.BLOCK, 0)
    assert (answer.status, answer.value) == (Status.NOT_ALLOWED, 1)
    assert bench.ask(Command.SET, Parameter.N_CHANNELS, 3).status == Status.UNKNOWN


def test_a_request_that_comes_again_is_answered_again_and_not_carried_out_again() -> None:
    bench = Bench()
    bench.set_up()
    start = Request(200, Command.START)
    for _ in range(2):
        bench.device.handle(start, bench.now_s)
    assert bench.link.of(Answer)[-2] == bench.link.of(Answer)[-1]
    assert bench.link.of(Answer)[-1].status == Status.DONE
    assert bench.ask(Command.START).status == Status.WRONG_STATE


def test_nothing_is_set_while_it_samples() -> None:
    bench = Bench()
    bench.armed()
    answer = bench.ask(Command.SET, Parameter.BLOCK, 20)
    assert (answer.status, answer.value) == (Status.WRONG_STATE, DeviceState.ARMED)


def test_only_the_key_arms() -> None:
    bench = Bench()
    bench.set_up()
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.WRONG_STATE
    bench.ask(Command.START)
    assert bench.ask(Command.ARM, value=ARM_KEY ^ 1).status == Status.NOT_ALLOWED
    bench.drive(3, 1.0)
    np.testing.assert_array_equal(bench.plant.output_v, 0.0)


def test_blocks_come_once_they_are_measured_and_outputs_are_on_at_their_index() -> None:
    bench = Bench()
    began_s = bench.armed()
    for block in range(5):
        bench.put((block + QUEUE) * BLOCK, 0.1 * (block + 1))
        bench.pass_time(BLOCK / RATE_HZ)
    blocks = bench.link.of(Samples)
    assert [samples.first for samples in blocks] == [0, 10, 20, 30, 40]
    assert [samples.clock_us for samples in blocks] == [
        pytest.approx(1e6 * (began_s + (samples.first + BLOCK) / RATE_HZ), abs=1) for samples in blocks
    ]
    np.testing.assert_allclose(bench.plant.output_v, np.repeat([0.0, 0.0, 0.1, 0.2, 0.3], BLOCK), atol=1e-12)
    assert all(samples.flags == 0 for samples in blocks)


def test_of_a_late_output_the_rest_is_used_and_the_last_value_held_before() -> None:
    bench = Bench()
    bench.armed()
    bench.put(20, 0.5)
    bench.pass_time(0.0341)  # samples 30 to 34 have begun, and the last output was for 29
    bench.put(30, np.arange(BLOCK) * 0.1)
    bench.pass_time(0.01)
    np.testing.assert_allclose(bench.plant.output_v[30:40], [0.5] * 5 + [0.5, 0.6, 0.7, 0.8, 0.9], atol=1e-12)
    assert [samples.flags for samples in bench.link.of(Samples)] == [0, 0, 0, DeviceFlag.OUTPUT_HELD]


@pytest.mark.parametrize(("late_samples", "state"), [(10, DeviceState.LATCHED), (9, DeviceState.ARMED)])
def test_a_host_that_is_late_with_every_sample_for_ever_ends_by_the_watchdog(
    late_samples: int, state: DeviceState
) -> None:
    bench = Bench()
    bench.armed()
    bench.pass_time((late_samples - 0.5) / RATE_HZ)  # so many instants have passed
    for block in range(20):
        bench.put(block * BLOCK, 1.0)
        bench.pass_time(BLOCK / RATE_HZ)
    assert bench.device.state is state
    late = sum(samples.flags & DeviceFlag.OUTPUT_HELD > 0 for samples in bench.link.of(Samples))
    assert late > 5


@pytest.mark.parametrize("ramp_s", [0.0, 0.0333, 0.05])
def test_the_watchdog_ramps_the_output_down_from_its_very_instant_and_latches(ramp_s: float) -> None:
    bench = Bench()
    began_s = bench.armed(ramp_s=ramp_s)
    bench.drive(5, 2.0)
    fed_s = bench.now_s - BLOCK / RATE_HZ
    bench.pass_time(0.4)
    beyond_s = began_s + np.arange(bench.plant.output_v.size) / RATE_HZ - (fed_s + WATCHDOG_S)
    share = np.where(beyond_s < -1e-9, 1.0, 0.0) if ramp_s == 0.0 else np.clip(1.0 - beyond_s / ramp_s, 0.0, 1.0)
    share[: QUEUE * BLOCK] = 0.0
    np.testing.assert_allclose(bench.plant.output_v, 2.0 * share, atol=1e-6)
    assert bench.device.state is DeviceState.LATCHED
    flagged = [samples.first for samples in bench.link.of(Samples) if samples.flags & DeviceFlag.WATCHDOG]
    first_bitten = int(np.flatnonzero(beyond_s >= -1e-9)[0])
    assert flagged[0] <= first_bitten < flagged[0] + BLOCK
    assert bench.link.of(Heartbeat)[-1].flags == DeviceFlag.WATCHDOG


def test_nothing_gets_through_after_the_watchdog_until_it_is_stopped_and_cleared() -> None:
    bench = Bench()
    bench.armed()
    bench.pass_time(0.2)
    for block in range(30):
        bench.put((22 + block) * BLOCK, 1.0)
        bench.pass_time(BLOCK / RATE_HZ)
    assert np.abs(bench.plant.output_v).max() == 0.0
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.LATCHED
    assert bench.ask(Command.CLEAR).status == Status.WRONG_STATE
    bench.ask(Command.STOP)
    assert bench.ask(Command.START).status == Status.LATCHED
    assert bench.ask(Command.CLEAR).status == Status.DONE
    bench.armed()
    bench.drive(4, 1.0)
    assert bench.plant.output_v[-1] == 1.0


def test_outputs_keep_the_watchdog_quiet_and_bad_ones_do_not() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(30, 1.0)
    assert bench.device.state is DeviceState.ARMED
    for _ in range(11):
        bench.device.handle(Output(bench.device.measured + 3, np.zeros(BLOCK, np.int16)), bench.now_s)  # between blocks
        bench.pass_time(0.01)
    assert bench.device.state is DeviceState.LATCHED


def test_the_emergency_stop_drops_the_output_at_the_next_sample_and_latches() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 1.0)
    bench.put(60, 1.0)
    bench.pass_time(0.0035)
    bench.device.handle(EmergencyStop(1), bench.now_s)
    bench.pass_time(0.02)
    np.testing.assert_array_equal(np.flatnonzero(bench.plant.output_v), np.arange(20, 44))
    assert bench.link.of(Samples)[-1].flags == DeviceFlag.EMERGENCY_STOP
    assert bench.ask(Command.STOP).value == DeviceState.LATCHED


def test_its_own_emergency_stop_acts_without_a_host() -> None:
    bench = Bench()
    bench.device.press_emergency_stop()
    bench.pass_time(0.2)
    assert bench.device.state is DeviceState.LATCHED
    assert bench.link.of(Heartbeat)[-1].flags == DeviceFlag.EMERGENCY_STOP


def test_disarmed_it_goes_on_sampling_at_0_v() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 1.0)
    bench.ask(Command.DISARM)
    bench.pass_time(0.3)
    assert bench.device.state is DeviceState.RUNNING
    assert np.flatnonzero(bench.plant.output_v)[-1] == 39
    assert bench.device.measured == 340


def test_stop_ends_sampling() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 1.0)
    bench.ask(Command.STOP)
    bench.pass_time(0.5)
    assert bench.device.measured == 40
    assert bench.device.state is DeviceState.IDLE


def test_heartbeats_come_ten_times_a_second_and_at_every_change_of_state() -> None:
    bench = Bench()
    bench.pass_time(1.04)
    assert len(bench.link.of(Heartbeat)) == pytest.approx(10, abs=1)
    bench.link.sent.clear()
    bench.armed()
    assert [beat.state for beat in bench.link.of(Heartbeat)] == [DeviceState.RUNNING, DeviceState.ARMED]


def test_after_a_reset_it_is_idle_with_another_boot_number() -> None:
    bench = Bench(faults=Faults(reset_after_s=0.05))
    bench.armed()
    before = bench.link.of(Heartbeat)[-1].boot
    bench.drive(6, 1.0)
    assert bench.device.state is DeviceState.IDLE
    assert bench.link.of(Heartbeat)[-1].boot != before


def test_what_nobody_takes_is_counted_as_dropped_and_does_not_stop_it() -> None:
    bench = Bench()
    bench.armed()
    bench.link.full = True
    bench.drive(3, 0.0)
    bench.link.full = False
    bench.pass_time(0.01)
    assert bench.link.of(Samples)[-1].dropped == 3 * BLOCK


def test_in_lockstep_it_waits_for_outputs_and_for_nothing_else() -> None:
    bench = Bench(lockstep=True)
    bench.armed(watchdog_s=1.0)
    bench.pass_time(0.5)
    assert bench.device.measured == QUEUE * BLOCK
    for block in range(3):
        bench.put((block + QUEUE) * BLOCK, 1.0)
    bench.pass_time(0.0)
    assert bench.device.measured == (QUEUE + 3) * BLOCK


def test_in_lockstep_the_watchdog_brings_the_output_down_without_a_host() -> None:
    bench = Bench(lockstep=True)
    bench.armed()
    for block in range(3):
        bench.put((block + QUEUE) * BLOCK, 1.0)
    bench.pass_time(0.0)
    bench.pass_time(1.0)
    ramp = np.clip(1.0 - np.arange(60) / (RAMP_S * RATE_HZ), 0.0, 1.0)
    np.testing.assert_allclose(bench.plant.output_v[50:110], ramp, atol=1e-9)
    assert bench.device.state is DeviceState.LATCHED


def test_a_stall_of_its_own_stops_its_clock_and_holds_no_output_against_the_host() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 1.0)
    bench.now_s += 1.0  # nobody let it run
    bench.device.advance(bench.now_s)
    assert bench.device.counts["stalls"] == 1
    assert bench.device.measured == 50
    assert bench.device.counts["stalled_us"] == pytest.approx(0.99e6, rel=1e-6)
    assert bench.device.state is DeviceState.ARMED
    bench.put(60, 1.0)
    bench.pass_time(0.02)
    np.testing.assert_array_equal(bench.plant.output_v[20:60], 1.0)
