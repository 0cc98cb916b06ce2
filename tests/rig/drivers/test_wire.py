"""The host's half of the wire protocol over a wire in memory: what it returns, and what it says of devices that misbehave."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.conformance import with_loopback
from rig.daq import LOST, State
from rig.drivers import make_daq
from rig.drivers.wire import WireOptions
from rig.drivers.wire.connection import RoundTrips
from rig.emulator import Device, Faults, VirtualPlant
from rig.emulator.parameters import described
from rig.errors import (
    DaqDisconnected,
    DaqEmergencyStop,
    DaqError,
    DaqMismatch,
    DaqProtocol,
    DaqRefused,
    DaqReset,
    DaqTimeout,
    DaqWatchdog,
)
from rig.loop.session import LocalSession
from rig.loop.worker.probe import round_trips
from rig.wire.messages import (
    ARM_KEY,
    Answer,
    Command,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Parameter,
    Request,
    Samples,
    Status,
)
from rig.wire.parameter_words import float_word
from tests.refused import refused
from tests.rig.loop.worker.rigs import tone
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ, MemoryLink

BLOCKS = 60
LATCHES = [(False, DaqWatchdog, "watchdog"), (True, DaqEmergencyStop, "emergency stop")]


def drive(daq: MemoryDAQ, blocks: int, block: int = 5, volts: float = 0.1) -> None:
    for _ in range(blocks):
        daq.exchange(np.full(block, volts))


def voltages(block: int, blocks: int = BLOCKS) -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.5, 0.5, (blocks, block))


def answers(daq: Any, block: int, blocks: int = BLOCKS) -> tuple[np.ndarray, np.ndarray]:
    """Inputs and flags of an open-loop run."""
    with daq:
        daq.start(block)
        rows, flags = [], []
        for volts in voltages(block, blocks):
            rows.append(daq.exchange(volts))
            flags.append(daq.flags.copy())
    return np.vstack(rows), np.concatenate(flags)


def virtual(block: int, queue_blocks: int = 1, seed: int = 3) -> np.ndarray:
    return answers(make_daq(bench_with(queue_blocks=queue_blocks), seed), block)[0]


def device_with(**changes: Any) -> MemoryDAQ:
    """A driver whose device says something else of itself, by parameter name and item."""
    daq = MemoryDAQ(bench_with())
    for name, word in changes.items():
        parameter, _, item = name.partition("__")
        daq.device.words[Parameter[parameter], int(item or 0)] = word
    return daq


def message_of(kind: type[DaqError], daq: MemoryDAQ) -> str:
    with pytest.raises(DaqError) as caught:
        daq.open()
    assert type(caught.value) is kind
    assert daq.state is State.CLOSED
    return str(caught.value)


@pytest.mark.parametrize("lockstep", [True, False])
@pytest.mark.parametrize(("block", "queue"), [(1, 1), (1, 4), (5, 1), (5, 2), (10, 3), (64, 1)])
def test_it_returns_bit_for_bit_what_the_virtual_driver_with_that_queue_does(
    block: int, queue: int, lockstep: bool
) -> None:
    daq = MemoryDAQ(bench_with(), 3, WireOptions(queue_blocks=queue), lockstep=lockstep)
    inputs, flags = answers(daq, block)
    np.testing.assert_array_equal(inputs, virtual(block, queue))
    assert not flags.any()
    assert np.abs(inputs).max() > 0.05


def test_its_latency_is_the_queue_and_half_a_sample() -> None:
    with MemoryDAQ(bench_with(), 0, WireOptions(queue_blocks=3)) as daq:
        daq.start(5)
        assert daq.latency_samples - daq.filter_delay_samples == pytest.approx(15.5)


def test_filter_delay_that_the_device_tells_is_part_of_the_latency() -> None:
    converter = {"oversampling": 2, "anti_alias_hz": 800.0}
    bench = bench_with(converter=converter)
    with make_daq(bench) as reference, MemoryDAQ(bench) as daq:
        daq.start(1)
        assert daq.filter_delay_samples == pytest.approx(reference.filter_delay_samples, abs=1e-5)
        assert daq.latency_samples == pytest.approx(1.5 + reference.filter_delay_samples, abs=1e-5)


@pytest.mark.parametrize(("index", "remarks"), [(-2, 1), (-1, 0)], ids=["sensor", "loopback"])
def test_a_skew_that_the_bench_gives_a_loopback_is_no_difference_from_the_device(index: int, remarks: int) -> None:
    bench = with_loopback(bench_with())
    assert bench is not None
    channels = list(bench.channels)
    channels[index] = channels[index].model_copy(update={"skew_samples": -0.5})
    with MemoryDAQ(bench.model_copy(update={"channels": tuple(channels)})) as daq:
        assert len([remark for remark in daq.remarks if "skew_samples = -0.5" in remark]) == remarks


def test_lost_blocks_are_gaps_in_their_place() -> None:
    faults = Faults(drop_every=10, drop_burst=2)
    daq = MemoryDAQ(bench_with(), 3, WireOptions(queue_blocks=4), lockstep=False, faults=faults)
    inputs, flags = answers(daq, 5)
    lost = np.isnan(inputs).any(axis=1)
    blocks = np.arange(1, BLOCKS + 1)
    expected = np.repeat((blocks >= 10) & (blocks % 10 < 2), 5)
    np.testing.assert_array_equal(lost, expected)
    np.testing.assert_array_equal(flags[lost], LOST)
    assert not flags[~lost].any()
    np.testing.assert_array_equal(inputs[~lost], virtual(5, 4)[~lost])
    assert daq.counters["lost_samples"] == lost.sum()


def test_repeated_blocks_are_counted_and_change_nothing() -> None:
    daq = MemoryDAQ(bench_with(), 3, faults=Faults(repeat_every=7))
    inputs, _ = answers(daq, 5)
    np.testing.assert_array_equal(inputs, virtual(5))
    assert daq.counters["repeated_blocks"] == BLOCKS // 7


@pytest.mark.parametrize("queue", [1, 3])
@pytest.mark.parametrize("lockstep", [True, False])
def test_a_block_that_comes_after_its_successor_is_put_in_its_place(queue: int, lockstep: bool) -> None:
    options = WireOptions(queue_blocks=queue)
    daq = MemoryDAQ(bench_with(), 3, options, lockstep=lockstep, faults=Faults(reorder_every=9))
    inputs, _ = answers(daq, 5)
    if lockstep or queue > 1:
        np.testing.assert_array_equal(inputs, virtual(5, queue))
    assert np.isfinite(inputs).all()
    assert daq.counters["reordered_blocks"] == BLOCKS // 9
    assert daq.counters["late_blocks"] == daq.counters["repeated_blocks"] == daq.counters["lost_samples"] == 0
    assert any(remark.startswith("frames arrive out of order: 6 blocks put in") for remark in daq.remarks)


def test_a_late_block_holds_outputs_and_says_so() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False, faults=Faults(late_every=20, late_s=0.02))
    inputs, flags = answers(daq, 5)
    assert np.isfinite(inputs).all()
    assert daq.counters["output_held"] > 0
    assert np.count_nonzero(flags & 4) == daq.counters["output_held"]


def test_a_device_that_calls_its_channels_otherwise_is_refused() -> None:
    names = ("force", "drive", "acc_drive", "nose")
    assert "nose" in message_of(DaqMismatch, MemoryDAQ(bench_with(), faults=Faults(channel_names=names)))


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"N_CHANNELS": 3}, DaqMismatch, ("acc_magnet", "not these")),
        ({"CHANNEL_NAME__0": 0x41414141}, DaqMismatch, ("AAAA", "force")),
        ({"CHANNEL_RANGE_V__1": float_word(2.0)}, DaqMismatch, ("drive", "range_v = 5", "2 V")),
        ({"CHANNEL_UNIT__8": 0x41}, DaqMismatch, ("drive", "'A'")),
        ({"OUTPUT_RANGE_V": float_word(5.0)}, DaqMismatch, ("output_range_v = 10", "5 V")),
        ({"HIGHEST_RATE_MHZ": 1_000_000, "LOWEST_RATE_MHZ": 1000}, DaqMismatch, ("sample_rate_hz = 5000", "1000 Hz")),
        ({"LAYOUT_CRC": 7}, DaqMismatch, ("00000007",)),
        ({"N_CHANNELS": 0}, DaqProtocol, ("0 channels",)),
        ({"BITS": 12}, DaqProtocol, ("12 bits",)),
        ({"SIMULATED": 3}, DaqProtocol, ("SIMULATED = 3", "0, 1 or 2")),
        ({"SIMULATED": 2**32 - 1}, DaqProtocol, ("SIMULATED = 4294967295",)),
        ({"CHANNEL_V_PER_COUNT__0": float_word(math.nan)}, DaqProtocol, ("not positive",)),
        ({"LOWEST_VERSION": 3, "HIGHEST_VERSION": 4}, DaqProtocol, ("versions 3 to 4", "speaks 1 to 2")),
        ({"LOWEST_VERSION": 0, "HIGHEST_VERSION": 0}, DaqProtocol, ("versions 0 to 0", "speaks 1 to 2")),
    ],
)
def test_a_device_that_is_not_the_benchs_is_refused_with_what_differs(
    changes: dict[str, int], kind: type[DaqError], words: tuple[str, ...]
) -> None:
    message = message_of(kind, device_with(**changes))
    assert message.startswith("memory: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_channels_in_another_order_are_said_to_be_so() -> None:
    bench = bench_with()
    order = [bench.channels[i] for i in (0, 2, 1, 3)]
    daq = MemoryDAQ(bench)
    daq._bench = bench.model_copy(update={"channels": tuple(order)})
    assert "in another order" in message_of(DaqMismatch, daq)


def test_a_silent_port_is_said_to_be_no_device() -> None:
    daq = MemoryDAQ(bench_with())
    daq.device.handle = lambda *_: None  # type: ignore[method-assign]
    assert "nothing answers" in message_of(DaqProtocol, daq)


def test_answers_that_get_lost_are_asked_for_again() -> None:
    daq = MemoryDAQ(bench_with(), 3)
    heard = daq.device.handle
    seen = [0]

    def hard_of_hearing(message: Any, now_s: float) -> None:
        seen[0] += 1
        if seen[0] % 3:
            heard(message, now_s)

    daq.device.handle = hard_of_hearing  # type: ignore[method-assign]
    daq.open()
    assert daq.counters["retries"] > 10
    daq.close()


def test_two_devices_that_answer_as_one_are_noticed() -> None:
    daq = MemoryDAQ(bench_with())
    twin = Device(
        VirtualPlant(bench_with()), described(daq.device.plant, serial_number="0002"), MemoryLink(daq.wire, host=False)
    )
    heard = daq.device.handle

    def both(message: Any, now_s: float) -> None:
        heard(message, now_s)
        twin.handle(message, now_s)

    daq.device.handle = both  # type: ignore[method-assign]
    assert "two devices" in message_of(DaqProtocol, daq)


def test_a_rate_beyond_the_wire_is_refused_with_the_sum() -> None:
    message = message_of(DaqRefused, MemoryDAQ(bench_with(), available_bit_s=850_000.0))
    assert "94 %" in message  # 5000 Hz x 8 bit x (12 + 2 x 4) byte = 800 000 bit/s
    assert "800000 of 850000 bit/s" in message


def test_a_device_that_still_runs_for_a_dead_host_is_stopped_first() -> None:
    daq = MemoryDAQ(bench_with(), lockstep=False)
    for request in (
        Request(1, Command.SET, Parameter.BLOCK, 0, 5),
        Request(2, Command.START),
        Request(3, Command.ARM, value=ARM_KEY),
    ):
        daq.device.handle(request, 0.0)
    daq.wire.pass_time(0.05)
    assert len(daq.wire.to_host) > 20
    with daq:
        assert daq.device.state is DeviceState.IDLE
        assert any("still running" in remark for remark in daq.remarks)
        daq.start(5)
        np.testing.assert_array_equal(daq.exchange(np.zeros(5)).shape, (5, 4))


def latched_by(*, emergency: bool) -> MemoryDAQ:
    """A driver, closed, whose device has latched its watchdog, or an emergency stop."""
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        daq.exchange(np.zeros(5))
        if emergency:
            daq.emergency_stop()
        else:
            daq.wire.pass_time(1.0)
        with pytest.raises(DaqEmergencyStop if emergency else DaqWatchdog):
            drive(daq, 1000)
    assert daq.device.state is DeviceState.LATCHED
    return daq


@pytest.mark.parametrize(("emergency", "kind", "word"), LATCHES)
def test_what_has_latched_is_told_when_it_is_opened_and_not_cleared_by_a_start(
    emergency: bool, kind: type[DaqError], word: str
) -> None:
    daq = latched_by(emergency=emergency)
    for _ in range(2):
        with daq:
            assert daq.latched == f"the device's {word} had latched"
            with refused(kind, reason=lambda text: f"{word} had latched: a run that is armed clears" in text):
                daq.start(5)
    assert daq.device.state is DeviceState.LATCHED


@pytest.mark.parametrize(("emergency", "kind", "word"), LATCHES)
def test_what_had_latched_can_be_cleared_and_is_remarked(emergency: bool, kind: type[DaqError], word: str) -> None:
    daq = latched_by(emergency=emergency)
    with daq:
        daq.clear()
        assert daq.latched == ""
        daq.start(5)
        assert np.isfinite(daq.exchange(np.zeros(5))).all()
        assert any(f"{word} had latched in an earlier run" in remark for remark in daq.remarks)
        daq.clear()
        assert daq.device.state is DeviceState.ARMED


def test_an_emergency_stop_after_the_opening_is_not_cleared_with_the_watchdog_that_was_found() -> None:
    daq = latched_by(emergency=False)
    with daq:
        daq.emergency_stop()
        with refused(DaqEmergencyStop, "emergency-stop-and-watchdog-had-latched"):
            daq.clear()
    assert daq.device.state is DeviceState.LATCHED


def test_an_emergency_stop_between_opening_and_start_is_not_cleared() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        assert daq.latched == ""
        daq.emergency_stop()
        daq.clear()
        with pytest.raises(DaqEmergencyStop):
            daq.start(5)


def test_an_emergency_stop_between_start_and_the_first_block_is_not_cleared() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        daq.emergency_stop()
        with pytest.raises(DaqEmergencyStop):
            daq.exchange(np.zeros(5))
    assert daq.device.state is DeviceState.LATCHED


def test_a_session_clears_what_its_device_had_latched_and_a_probe_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    daq = latched_by(emergency=True)
    bench = bench_with()
    monkeypatch.setattr("rig.loop.worker.probe.make_daq", lambda *_: daq)
    facts = round_trips(bench, 0, 0.1)
    assert facts["latched"] == "the device's emergency stop had latched"
    assert "block_us" not in facts
    assert daq.device.state is DeviceState.LATCHED
    with daq:
        session = LocalSession(daq, bench, realtime=False)
        assert session.latched == "the device's emergency stop had latched"
        assert daq.device.state is DeviceState.LATCHED
        session.start(tone(bench, 1.0))
        assert daq.device.state is DeviceState.IDLE


def test_start_itself_starts_no_clock() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        daq.wire.pass_time(30.0)
        inputs = np.vstack([daq.exchange(volts) for volts in voltages(5)])
    np.testing.assert_array_equal(inputs, virtual(5))


def run_until_error(faults: Faults, lockstep: bool = False) -> tuple[MemoryDAQ, DaqError]:
    daq = MemoryDAQ(bench_with(), 3, lockstep=lockstep, faults=faults)
    with daq:
        daq.start(5)
        with pytest.raises(DaqError) as caught:
            drive(daq, 1000)
    daq.wire.pass_time(1.0)
    assert not daq.device.output_v.any()
    assert daq.state is State.CLOSED
    return daq, caught.value


@pytest.mark.parametrize(
    ("faults", "kind", "word"),
    [
        (Faults(silent_after_s=0.1), DaqTimeout, "has not come within 0.25 s"),
        (Faults(deaf_after_s=0.1), DaqWatchdog, "watchdog"),
        (Faults(reset_after_s=0.1), DaqReset, "restarted during"),
        (Faults(late_every=100, late_s=1.0), DaqTimeout, "has not come"),
    ],
)
def test_what_goes_wrong_on_the_way_has_its_error_and_ends_at_0_v(
    faults: Faults, kind: type[DaqError], word: str
) -> None:
    _, error = run_until_error(faults)
    assert type(error) is kind
    assert word in str(error)


def test_an_emergency_stop_at_the_device_is_told() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        drive(daq, 20)
        daq.device.press_emergency_stop()
        with refused(DaqEmergencyStop, "emergency-stop"):
            drive(daq, 20)
    assert not daq.device.output_v.any()


def test_the_host_can_press_the_emergency_stop() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        daq.exchange(np.full(5, 0.1))
        daq.emergency_stop()
        with pytest.raises(DaqEmergencyStop):
            daq.exchange(np.full(5, 0.1))


def test_an_unplugged_cable_is_told_and_the_device_comes_to_0_v_by_itself() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        drive(daq, 20)
        daq.wire.cut = True
        with pytest.raises(DaqDisconnected):
            drive(daq, 1)
    assert daq.device.output_v.any()
    daq.wire.pass_time(0.2)
    assert not daq.device.output_v.any()
    assert daq.device.state is DeviceState.LATCHED


def test_another_who_starts_the_device_is_noticed() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        drive(daq, 50)
        for number, command in enumerate((Command.STOP, Command.START)):
            daq.device.handle(Request(240 + number, command), daq.wire.now_s)
        with pytest.raises(DaqReset):
            drive(daq, 50)


def test_the_numbers_of_requests_follow_the_clock_of_the_driver_alone() -> None:
    daqs, heard = [MemoryDAQ(bench_with(), 3) for _ in range(2)], ([], [])
    for daq, numbers in zip(daqs, heard, strict=True):
        handle = daq.device.handle

        def noting(message: Message, now_s: float, handle: Any = handle, numbers: list[int] = numbers) -> None:
            numbers.append(message[0])
            handle(message, now_s)

        daq.device.handle = noting  # type: ignore[method-assign]
        with daq:
            pass
    assert heard[0] == heard[1] != []


def test_another_who_disarms_the_device_is_noticed() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        daq.start(5)
        drive(daq, 50)
        daq.device.handle(Request(240, Command.DISARM), daq.wire.now_s)
        with refused(DaqReset, "was-disarmed-by-another-its-output"):
            drive(daq, 500)  # half a second
    assert not daq.device.output_v.any()


def test_heartbeats_of_before_the_arming_and_a_single_stale_one_end_nothing() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    boot = daq.device.words[Parameter.BOOT, 0] & 0xFF
    stale = Heartbeat(DeviceState.RUNNING, 0, boot, 0)
    heard = daq.device.handle

    def beating(message: Message, now_s: float) -> None:
        if isinstance(message, Request) and message.command == Command.ARM:
            daq.wire.to_host.extend([stale] * 3)
        heard(message, now_s)

    daq.device.handle = beating  # type: ignore[method-assign]
    with daq:
        daq.start(5)
        drive(daq, 10)
        daq.wire.to_host.append(stale)
        drive(daq, 500)
        assert daq.device.state is DeviceState.ARMED


@pytest.mark.parametrize("watchdog_s", [None, 0.02])
def test_an_answer_to_the_arming_that_gets_lost_is_asked_for_before_the_watchdog_bites(
    watchdog_s: float | None,
) -> None:
    daq = MemoryDAQ(bench_with(), 3, WireOptions(watchdog_s=watchdog_s), lockstep=False)
    heard, lost = daq.device.handle, [1]

    def losing(message: Message, now_s: float) -> None:
        heard(message, now_s)
        if isinstance(message, Request) and message.command == Command.ARM and lost[0]:
            lost[0] -= 1
            kept = [told for told in daq.wire.to_host if not isinstance(told, Answer)]
            daq.wire.to_host.clear()
            daq.wire.to_host.extend(kept)

    daq.device.handle = losing  # type: ignore[method-assign]
    with daq:
        daq.start(5)
        drive(daq, 200)
        assert not lost[0]
        assert daq.counters["retries"] == 1
        assert daq.device.state is DeviceState.ARMED


@pytest.mark.parametrize(
    ("status", "value", "words"),
    [
        (Status.NOT_ALLOWED, 20_000, "the nearest is 0.02 s"),
        (Status.WRONG_STATE, DeviceState.RUNNING, "the device is running"),
        (Status.UNKNOWN, 0, "the device does not know it"),
        (Status.DONE, 20_000, "the device has set 0.02 s instead"),
        (9, 20_000, "status 9"),
    ],
)
def test_a_setting_that_is_refused_is_told_with_the_devices_reason_and_a_nearest_only_where_there_is_one(
    status: int, value: int, words: str
) -> None:
    daq = MemoryDAQ(bench_with(), 3)
    heard = daq.device.handle

    def refusing(message: Message, now_s: float) -> None:
        if isinstance(message, Request) and message[1:3] == (Command.SET, Parameter.RAMP_US):
            daq.wire.to_host.append(Answer(message.number, status, message.parameter, message.item, value))
        else:
            heard(message, now_s)

    daq.device.handle = refusing  # type: ignore[method-assign]
    with daq, pytest.raises(DaqMismatch) as caught:
        daq.start(5)
    said = str(caught.value)
    assert said.startswith("memory: driver.options.ramp_s = 0.05 s: ")
    assert words in said
    assert ("nearest" in said) == (status == Status.NOT_ALLOWED)


@pytest.mark.parametrize(
    ("parameter", "told", "set_instead"),
    [
        (Parameter.RATE_MHZ, "sample_rate_hz = 5000 Hz", "2500 Hz"),
        (Parameter.BLOCK, "block = 10 samples", "5 samples"),
        (Parameter.QUEUE, "driver.options.queue_blocks = 4 blocks", "2 blocks"),
        (Parameter.WATCHDOG_US, "driver.options.watchdog_s = 0.3 s", "0.15 s"),
        (Parameter.RAMP_US, "driver.options.ramp_s = 0.08 s", "0.04 s"),
    ],
)
def test_a_setting_that_a_device_halves_is_told_by_its_key_in_the_benchs_units(
    parameter: Parameter, told: str, set_instead: str
) -> None:
    daq = MemoryDAQ(bench_with(), 3, WireOptions(queue_blocks=4, watchdog_s=0.3, ramp_s=0.08))
    heard = daq.device.handle

    def halving(message: Message, now_s: float) -> None:
        if isinstance(message, Request) and message[1:3] == (Command.SET, parameter):
            half = message.value // 2
            daq.wire.to_host.append(Answer(message.number, Status.DONE, message.parameter, message.item, half))
        else:
            heard(message, now_s)

    daq.device.handle = halving  # type: ignore[method-assign]
    with daq, pytest.raises(DaqMismatch) as caught:
        daq.start(10)
    assert str(caught.value) == f"memory: {told}: the device has set {set_instead} instead"


def test_a_watchdog_shorter_than_two_blocks_is_refused() -> None:
    with (
        MemoryDAQ(bench_with(), 0, WireOptions(watchdog_s=0.01)) as daq,
        refused(DaqRefused, field="driver.options.watchdog_s", value=0.01),
    ):
        daq.start(50)


@pytest.mark.parametrize(("wanted_s", "block"), [(1.0001, 5), (4000.0, 5), (1.61, 800)])
def test_a_watchdog_that_would_hold_an_output_for_long_is_refused_where_something_moves(
    wanted_s: float, block: int
) -> None:
    longest_s = 1 if block == 5 else 1.6  # 10 blocks of 0.16 s
    options = WireOptions(watchdog_s=wanted_s)
    with (
        MemoryDAQ(bench_with(), 0, options, simulated=0) as daq,
        refused(
            DaqRefused,
            field="driver.options.watchdog_s",
            value=wanted_s,
            allowed=lambda text: text.startswith(f"up to {longest_s} s "),
        ),
    ):
        daq.start(block)
    with MemoryDAQ(bench_with(), 0, options) as daq:
        daq.start(block)
    with MemoryDAQ(bench_with(), 0, WireOptions(watchdog_s=1.0), simulated=0) as daq:
        daq.start(block)


@pytest.mark.parametrize(("shortest_s", "starts"), [(0.5, True), (30.0, False)])
def test_a_device_that_cannot_wait_as_short_as_usual_is_remarked_and_refused_where_it_is_too_long(
    shortest_s: float, starts: bool
) -> None:
    daq = MemoryDAQ(bench_with(), 0, simulated=0)
    daq.device.words[Parameter.SHORTEST_WATCHDOG_US, 0] = round(1e6 * shortest_s)
    with daq:
        assert any(f"waits {shortest_s:g} s" in remark and "usual 0.1 s" in remark for remark in daq.remarks)
        if starts:
            daq.start(5)
        else:
            with refused(DaqRefused, "watchdog-the-shortest-that-the-device"):
                daq.start(5)
    with MemoryDAQ(bench_with(), 0, simulated=0) as daq:
        assert not any("watchdog" in remark for remark in daq.remarks)


def test_round_trips_are_measured_before_and_during_the_run() -> None:
    daq = MemoryDAQ(bench_with(), 3, lockstep=False)
    with daq:
        before = daq.statistics
        assert before["round_trips"] >= 20
        assert before["round_trip_p50_us"] == pytest.approx(20.0)  # the flight of the wire in memory
        daq.start(5)
        for volts in voltages(5, 1000):
            daq.exchange(volts)
        assert daq.statistics["round_trips"] == pytest.approx(before["round_trips"] + 20, abs=2)
        assert daq.statistics["sustainable_rate_hz"] == 5000.0


def test_round_trips_are_told_in_microseconds_by_their_percentiles_and_only_the_last_are_kept() -> None:
    trips = RoundTrips()
    assert trips.report() == {}
    for number in range(101):
        trips.add(1e-6 * (100.0 - number))
    assert trips.report() == {
        "round_trip_p50_us": 50.0,
        "round_trip_p99_us": 99.0,
        "round_trip_largest_us": 100.0,
        "round_trips": 101.0,
    }
    for _ in range(4096):
        trips.add(7e-6)
    assert trips.report() == {
        "round_trip_p50_us": 7.0,
        "round_trip_p99_us": 7.0,
        "round_trip_largest_us": 7.0,
        "round_trips": 4197.0,
    }


def test_it_says_who_the_device_is() -> None:
    with MemoryDAQ(bench_with(), serial_number="A-17", firmware="2.3") as daq:
        assert daq.identity["serial_number"] == "A-17"
        assert daq.identity["firmware"] == "2.3"
        assert daq.capabilities.virtual


def test_a_device_that_does_not_say_it_is_simulated_is_not_virtual() -> None:
    daq = MemoryDAQ(bench_with(), simulated=0)
    assert not daq.capabilities.virtual
    with daq:
        assert not daq.capabilities.virtual


def test_sensors_wired_wrongly_read_so_and_leave_the_plant_as_it_is() -> None:
    right = virtual(5)
    daq = MemoryDAQ(
        bench_with(), 3, wiring={"flip": ("drive",), "dead": ("acc_magnet",), "swap": (("force", "acc_drive"),)}
    )
    inputs, _ = answers(daq, 5)
    np.testing.assert_array_equal(inputs[:, 1], -right[:, 1])
    np.testing.assert_array_equal(inputs[:, [2, 0]], right[:, [0, 2]])
    assert np.abs(inputs[:, 3]).max() < 1e-3


def test_counts_of_32_bits_carry_a_converter_of_24() -> None:
    bench = bench_with(converter={"adc_bits": 24, "dac_bits": 20}, queue_blocks=1)
    reference, _ = answers(make_daq(bench, 3), 5)
    inputs, _ = answers(MemoryDAQ(bench, 3), 5)
    np.testing.assert_array_equal(inputs, reference)


BLOCK_OF_5 = np.zeros((5, 4), np.int16)
NOISE = st.one_of(
    st.builds(
        Samples,
        st.integers(0, 60) | st.integers(0, 2**64 - 1),
        st.sampled_from([BLOCK_OF_5, BLOCK_OF_5[:3], BLOCK_OF_5[:, :2]]),
        st.sampled_from([0, 0, 0, 1, 2, 4, 8, 16]),
        st.integers(0, 2**32 - 1),
    ),
    st.builds(Answer, *(st.integers(0, 255),) * 4, st.integers(0, 2**32 - 1)),
    st.builds(Heartbeat, st.integers(0, 7), st.integers(0, 31), st.integers(0, 3), st.integers(0, 100)),
    st.builds(Output, st.integers(0, 60), st.just(np.zeros(5, np.int16))),
    st.builds(EmergencyStop),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(NOISE, max_size=40))
def test_whatever_a_mad_device_sends_ends_in_rows_or_in_one_of_our_errors(noise: list[Message]) -> None:
    daq = MemoryDAQ(bench_with(), 3, WireOptions(queue_blocks=2))
    with daq:
        daq.start(5)
        drive(daq, 3)
        daq.wire.to_host.extend(noise)
        said = said_of(daq)
    assert said == "" or (said.startswith("memory: ") and "\n" not in said)


def said_of(daq: MemoryDAQ) -> str:
    """What ends a few more blocks, if anything; rows that were lost are NaN and no others."""
    try:
        for _ in range(20):
            rows = daq.exchange(np.zeros(5))
            np.testing.assert_array_equal(np.isnan(rows).all(axis=1), (daq.flags & LOST).astype(bool))
    except DaqError as error:
        return str(error)
    return ""


def test_a_driver_that_replaces_its_flags_is_told_so() -> None:
    class Replaces(MemoryDAQ):
        def _exchange(self, voltages, inputs):
            super()._exchange(voltages, inputs)
            self.flags = self.flags.copy()

    with Replaces(bench_with()) as daq:
        daq.start()
        with refused(DaqError, "replaced-flags"):
            daq.exchange(np.zeros(1))


def test_a_port_whose_adapter_does_not_answer_is_closed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    daq = MemoryDAQ(bench_with())
    opened = []

    def open_halfway(link: MemoryLink) -> None:
        link.is_open = True
        opened.append(link)
        raise DaqDisconnected("the adapter is gone")

    monkeypatch.setattr(MemoryLink, "open", open_halfway)
    with pytest.raises(DaqDisconnected):
        daq.open()
    assert [link.is_open for link in opened] == [False]
    assert daq.state is State.CLOSED


def test_what_can_be_set_against_late_outputs_is_told_once_open() -> None:
    """The device's own bounds, the driver's, and the load of the wire: 8 (12 + 2 n c) bits a block of n samples, c channels."""
    bench = bench_with({"block": 4})
    daq = MemoryDAQ(bench, 0, WireOptions(watchdog_s=0.3), available_bit_s=2e6)
    assert daq.adjustable is None
    daq.device.words[Parameter.LARGEST_QUEUE, 0] = 32
    daq.device.words[Parameter.LONGEST_WATCHDOG_US, 0] = 800_000
    with daq:
        told = daq.adjustable
    assert told is not None
    assert told.watchdog_s == 0.3
    assert told.largest_queue == 32
    assert told.watchdog_range_s[1] == pytest.approx(0.8)
    assert told.rate_range_hz[1] == pytest.approx(5000.0)
    n_channels = len(bench.channels)
    for block in (1, 4, 100):
        bits_s = 5000.0 / block * 8.0 * (12 + 2 * block * n_channels)
        assert told.wire_share[block] == pytest.approx(bits_s / 2e6)
