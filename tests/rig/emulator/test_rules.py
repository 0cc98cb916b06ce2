"""Rules of the protocol's page that only show sample by sample, or where two rules meet."""

import numpy as np
import pytest

from rig.emulator.parameters import LARGEST_BLOCK
from rig.wire.messages import (
    ARM_KEY,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Parameter,
    Request,
    Samples,
    Status,
)
from tests.firmware.events import CAN, CAN_FD, SERIAL, Choice
from tests.firmware.python_device import PythonDevice
from tests.rig.emulator.test_device import BLOCK, QUEUE, RAMP_S, RATE_HZ, WATCHDOG_S, Bench


def test_once_the_watchdog_has_bitten_it_ramps_from_where_it_was_and_lets_no_output_through() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 2.0)
    bench.pass_time(WATCHDOG_S - BLOCK / RATE_HZ)
    assert bench.device.state is DeviceState.LATCHED
    bitten = bench.plant.output_v.size
    for block in range(6):
        bench.put((bitten // BLOCK + block) * BLOCK, -1.0)
        bench.pass_time(BLOCK / RATE_HZ)
    beyond = np.arange(bench.plant.output_v.size - bitten) / (RAMP_S * RATE_HZ)
    np.testing.assert_allclose(bench.plant.output_v[bitten:], 2.0 * np.clip(1.0 - beyond, 0.0, 1.0), atol=1e-6)


def test_disarmed_during_the_watchdogs_ramp_it_is_at_0_v_at_once() -> None:
    bench = Bench()
    bench.armed()
    bench.drive(4, 2.0)
    bench.pass_time(WATCHDOG_S - BLOCK / RATE_HZ + 0.0105)
    assert bench.ask(Command.DISARM).value == DeviceState.LATCHED
    put_out = 141  # samples, with that at the instant before
    bench.pass_time(0.02)
    assert bench.plant.output_v[put_out - 1] > 0.0
    np.testing.assert_array_equal(bench.plant.output_v[put_out:], 0.0)


def test_what_is_held_is_what_the_converter_holds() -> None:
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.drive(4, 1.0)
    bench.ask(Command.DISARM)
    for block in range(4, 6):  # kept, while 0 V is put out
        bench.put((block + QUEUE) * BLOCK, 3.0)
    bench.pass_time(0.06)
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.DONE
    bench.pass_time(0.03)
    np.testing.assert_array_equal(bench.plant.output_v[40:], 0.0)


def test_what_is_held_is_no_more_than_the_converters_range() -> None:
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.put(QUEUE * BLOCK, 12.0)
    bench.pass_time(0.0405)
    np.testing.assert_allclose(bench.plant.output_v[30:40], bench.plant.output_range_v, atol=0.0)


@pytest.mark.parametrize("while_armed", [True, False])
def test_outputs_are_held_once_a_first_one_has_come_since_the_start(while_armed: bool) -> None:
    bench = Bench()
    bench.set_up(watchdog_s=10.0)
    bench.ask(Command.START)
    if not while_armed:
        bench.put(QUEUE * BLOCK, 1.0)
    bench.ask(Command.ARM, value=ARM_KEY)
    bench.pass_time(0.0455)
    if while_armed:
        bench.put(5 * BLOCK, 1.0)
    bench.pass_time(0.03)
    held = [samples.first for samples in bench.link.of(Samples) if samples.flags & DeviceFlag.OUTPUT_HELD]
    assert held == ([40, 60] if while_armed else [30, 40, 50, 60])


def test_a_block_in_which_nothing_was_held_while_armed_is_not_flagged() -> None:
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.put(QUEUE * BLOCK, 1.0)
    bench.pass_time(0.0305)  # one instant of block 3 has passed without an output
    bench.ask(Command.DISARM)
    bench.pass_time(0.02)
    bench.ask(Command.ARM, value=ARM_KEY)
    bench.put(5 * BLOCK, 1.0)
    bench.pass_time(0.02)
    assert [samples.flags for samples in bench.link.of(Samples)] == [0, 0, 0, 4, 0, 0, 4]


def test_disarmed_and_armed_again_within_a_block_it_leaves_what_it_has_put_out() -> None:
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.drive(6, 1.0)
    bench.pass_time(0.0025)
    bench.ask(Command.DISARM)
    bench.pass_time(0.003)
    bench.ask(Command.ARM, value=ARM_KEY)
    bench.pass_time(0.01)
    np.testing.assert_array_equal(bench.plant.output_v[60:70], [1, 1, 1, 0, 0, 0, 1, 1, 1, 1])


def test_disarmed_and_armed_again_between_two_samples_it_holds_0_v() -> None:
    """No sample of 0 V was put out between the two, but the converter was at 0 V."""
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.drive(4, 1.0)
    bench.pass_time(0.05 + 0.2 / RATE_HZ)
    held = bench.plant.output_v.size
    assert bench.plant.output_v[-1] == 1.0
    bench.ask(Command.DISARM)
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.DONE
    bench.pass_time(0.03)
    assert bench.plant.output_v.size > held
    np.testing.assert_array_equal(bench.plant.output_v[held + 1 :], 0.0)


def test_an_output_does_not_take_the_place_of_one_that_is_due_in_the_block_under_way() -> None:
    bench = Bench()
    bench.armed(watchdog_s=10.0)
    bench.drive(4, 1.0)
    bench.pass_time(0.0095)  # the last instant of block 4 has passed, and block 4 is not complete
    bench.put((5 + QUEUE + 4 - 1) * BLOCK, 5.0)
    bench.pass_time(0.001)
    np.testing.assert_array_equal(bench.plant.output_v[40:50], 1.0)


def test_the_state_has_one_item() -> None:
    assert Bench().ask(Command.GET, Parameter.STATE, item=1).status == Status.UNKNOWN


def test_what_latches_besides_is_told_by_a_heartbeat() -> None:
    bench = Bench()
    bench.armed()
    bench.pass_time(2 * WATCHDOG_S)
    assert bench.link.of(Heartbeat)[-1].flags == DeviceFlag.WATCHDOG
    beats = len(bench.link.of(Heartbeat))
    for _ in range(3):
        bench.device.handle(EmergencyStop(1), bench.now_s)
    assert [beat.flags for beat in bench.link.of(Heartbeat)[beats:]] == [8 | 16]


def test_an_emergency_stop_that_is_still_pressed_is_not_cleared() -> None:
    bench = Bench()
    bench.device.set_emergency_stop(True, bench.now_s)
    assert bench.link.of(Heartbeat)[-1].state == DeviceState.LATCHED
    answer = bench.ask(Command.CLEAR)
    assert (answer.status, answer.value) == (Status.LATCHED, DeviceFlag.EMERGENCY_STOP)
    bench.device.set_emergency_stop(False, bench.now_s)
    assert bench.ask(Command.CLEAR).status == Status.DONE


def test_where_two_statuses_apply_one_goes_first() -> None:
    bench = Bench()
    bench.armed()
    assert bench.ask(Command.SET, 250, 1).status == Status.WRONG_STATE
    assert bench.ask(Command.ARM, value=1).status == Status.NOT_ALLOWED
    bench.device.handle(EmergencyStop(1), bench.now_s)
    assert bench.ask(Command.ARM, value=1).status == Status.NOT_ALLOWED
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.LATCHED
    assert bench.ask(Command.START).status == Status.LATCHED
    assert bench.ask(Command.CLEAR).status == Status.WRONG_STATE


def test_a_reset_forgets_what_was_set_and_sends_one_heartbeat() -> None:
    bench = Bench()
    bench.armed()
    bench.pass_time(0.05)
    beats = len(bench.link.of(Heartbeat))
    bench.device.reset(bench.now_s)
    assert [(beat.state, beat.samples) for beat in bench.link.of(Heartbeat)[beats:]] == [(DeviceState.IDLE, 0)]
    assert bench.ask(Command.GET, Parameter.BLOCK).value == 1


LARGEST = [
    (Choice(SERIAL, 4, 16), LARGEST_BLOCK),
    (Choice(SERIAL, 31, 32), (65536 - 28) // (4 * 31)),
    (Choice(CAN, 4), 32),
    (Choice(CAN, 16), 8),
    (Choice(CAN_FD, 4), 896),
]


@pytest.mark.parametrize(("choice", "largest"), LARGEST)
def test_the_largest_block_is_what_the_wire_carries(choice: Choice, largest: int) -> None:
    device = PythonDevice(choice).device
    assert device.words[Parameter.LARGEST_BLOCK, 0] == largest
    sent: list[Answer] = []
    device.link.send = sent.append  # type: ignore[method-assign, assignment]
    for number, (command, parameter, value) in enumerate(
        [(Command.SET, 49, largest + 1), (Command.SET, 49, largest), (Command.START, 0, 0)]
    ):
        device.handle(Request(number, command, parameter, 0, value), 2.0)
    answers = [message.status for message in sent if isinstance(message, Answer)]
    assert answers == [Status.NOT_ALLOWED, Status.DONE, Status.DONE]


def test_a_device_late_with_its_blocks_does_not_mistake_what_was_put_out_before_the_watchdog_bit() -> None:
    bench = Bench()
    bench.set_up(watchdog_s=0.012)
    bench.ask(Command.SET, Parameter.QUEUE, 8)
    bench.ask(Command.START)
    for block in range(8, 12):
        bench.put(block * BLOCK, 1.0)
    bench.pass_time(0.0755)
    bench.ask(Command.ARM, value=ARM_KEY)
    bench.pass_time(0.011)
    bench.now_s += 0.014  # nobody let it run: block 8 was due, and then the watchdog's time was over
    bench.device.advance(bench.now_s)
    np.testing.assert_array_equal(bench.plant.output_v[80:88], 1.0)
    assert np.all(np.diff(bench.plant.output_v[88:100]) <= 0.0)
    assert bench.plant.output_v[89] > 0.9
