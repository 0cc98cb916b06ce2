"""The emulated device goes on with the vibration: every output against the page's rule, by a virtual clock."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.emulator import Faults
from rig.wire.messages import (
    ARM_KEY,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Output,
    Parameter,
    Readback,
    Samples,
    Status,
)
from tests.rig.emulator.test_device import BLOCK, COUNT_V, QUEUE, RAMP_S, RATE_HZ, WATCHDOG_S, Bench
from tests.rig.test_continuation import CUBIC, Page

FREQUENCY_HZ = 37.3
PERIOD = round(RATE_HZ / FREQUENCY_HZ * 65536)
AMPLITUDE = 3000  # counts
HELD, CONTINUED = DeviceFlag.OUTPUT_HELD, DeviceFlag.OUTPUT_CONTINUED
BLOCK_S = BLOCK / RATE_HZ


def sine(first: int, n: int = BLOCK) -> np.ndarray:
    turns = FREQUENCY_HZ / RATE_HZ * np.arange(first, first + n)
    return np.rint(AMPLITUDE * np.sin(2.0 * math.pi * turns)).astype(np.int16)


def block(number: int, period: int = PERIOD, ramp: int = 0) -> Output:
    """The outputs of a block, by its number."""
    return Output(number * BLOCK, sine(number * BLOCK), number & 0xFFFF, period, ramp)


@dataclass
class Arrival:
    """A block of outputs, and the sample at which it arrives."""

    at: float
    output: Output


class Continuing(Bench):
    """A device that speaks version 2 and is armed at instant 0, once outputs are handed over."""

    def __init__(self, version: int = 2, watchdog_s: float = WATCHDOG_S, faults: Faults | None = None) -> None:
        super().__init__(faults=faults)
        assert self.ask(Command.SET, Parameter.VERSION, version).status == Status.DONE
        self.began_s = self.armed(watchdog_s=watchdog_s)

    def until(self, sample: float) -> None:
        """Let time pass until an instant, which is then under way."""
        self.pass_time(max(0.0, self.began_s + sample / RATE_HZ - self.now_s))

    def play(self, arrivals: list[Arrival], end: int) -> None:
        """Hand over outputs as they arrive, until ``end``."""
        for arrival in sorted((one for one in arrivals if one.at < end), key=lambda one: one.at):
            self.until(arrival.at)
            self.device.handle(arrival.output, self.now_s)
        self.until(end + 0.5)

    @property
    def counts(self) -> np.ndarray:
        return np.rint(self.plant.output_v / COUNT_V).astype(int)

    @property
    def flags(self) -> list[int]:
        return [block.flags for block in self.link.of(Samples)]


def expected(arrivals: list[Arrival], end: int) -> tuple[np.ndarray, list[int]]:
    """Output at every instant, and the flags of every block, by the page alone."""
    page, waiting = Page(longest=16384), sorted(arrivals, key=lambda one: one.at)
    in_time: dict[int, int] = {}
    out, flags, held, has_come = [], [0] * -(-end // BLOCK), 0, False
    for instant in range(end):
        while waiting and waiting[0].at <= instant:
            output, has_come = waiting.pop(0).output, True
            counts = output.counts.tolist()
            page.keep(output.first, counts, output.period, output.ramp)
            in_time |= {output.first + i: count for i, count in enumerate(counts) if output.first + i >= instant}
        count = in_time.get(instant)
        if count is None:
            count = page.at(instant)
            missing = HELD if count is None else CONTINUED
            count = held if count is None else count
            if has_come and instant >= QUEUE * BLOCK:
                flags[instant // BLOCK] |= missing
        held = count
        out.append(count)
    return np.array(out), flags


def check(bench: Continuing, arrivals: list[Arrival], end: int) -> None:
    """The device did what the page says, and said so: flags, readbacks before their samples, counters."""
    counts, flags = expected(arrivals, end)
    np.testing.assert_array_equal(bench.counts[:end], counts)
    assert bench.flags[: len(flags)] == flags
    sent = [one for one in bench.link.sent if isinstance(one, Samples | Readback)]
    for number, flag in enumerate(flags):
        at = next(i for i, one in enumerate(sent) if isinstance(one, Samples) and one.first == number * BLOCK)
        before = sent[at - 1] if at else None
        assert isinstance(before, Readback) == bool(flag)
        if isinstance(before, Readback):
            assert (before.first, before.sequence) == (number * BLOCK, sent[at].sequence)
            np.testing.assert_array_equal(before.counts, counts[number * BLOCK : (number + 1) * BLOCK])
    for flag, name in ((HELD, "held_blocks"), (CONTINUED, "continued_blocks")):
        assert bench.device.counts[name] == sum(1 for one in flags if one & flag)


def punctual(blocks: int, period: int = PERIOD) -> list[Arrival]:
    """Each block of outputs when the samples of the block a queue before have come."""
    return [Arrival((j - QUEUE) * BLOCK + 0.5, block(j, period)) for j in range(QUEUE, blocks)]


def stopped(arrivals: list[Arrival], at: float, samples: float) -> list[Arrival]:
    """The host stands still for some samples from an instant on, and then does at once what it has missed."""
    return [
        Arrival(at + samples + 1e-3 * number if at <= one.at < at + samples else one.at, one.output)
        for number, one in enumerate(arrivals)
    ]


@pytest.mark.parametrize("stop_ms", [20, 50, 90])
@pytest.mark.parametrize("at", range(200, 230, 3))
def test_a_host_that_is_stopped_for_less_than_the_watchdog_leaves_the_sine_a_sine(stop_ms: int, at: int) -> None:
    """SIGSTOP in every phase: the output is that of a host that was never late, to the error of the cubic."""
    bench, end = Continuing(), 500
    arrivals = stopped(punctual(end // BLOCK + QUEUE), at, stop_ms * RATE_HZ / 1000.0)
    bench.play(arrivals, end)
    check(bench, arrivals, end)
    assert bench.device.state is DeviceState.ARMED
    missed = [flags for flags in bench.flags if flags]
    assert set(missed) <= {int(CONTINUED)}
    assert len(missed) >= (stop_ms * RATE_HZ / 1000.0 - QUEUE * BLOCK) // BLOCK
    omega = 2.0 * math.pi * FREQUENCY_HZ / RATE_HZ
    error = AMPLITUDE * (CUBIC * omega**4 + omega**2 / 8.0) + 2.0
    ideal = AMPLITUDE * np.sin(omega * np.arange(end))
    assert np.abs(bench.counts[QUEUE * BLOCK : end] - ideal[QUEUE * BLOCK :]).max() <= error
    last = max(np.flatnonzero(bench.flags), default=QUEUE)
    np.testing.assert_array_equal(
        bench.counts[(last + 1) * BLOCK : end], sine((last + 1) * BLOCK, end)[: end - (last + 1) * BLOCK]
    )


def test_a_host_that_is_stopped_for_longer_than_the_watchdog_ends_at_0_v_as_before() -> None:
    bench, stop = Continuing(), 300
    bench.play(stopped(punctual(40), stop, 1000), 600)
    assert bench.device.state is DeviceState.LATCHED
    out, bitten = bench.plant.output_v, 290.5 + WATCHDOG_S * RATE_HZ  # the last block has come at 290.5
    ends = bitten + RAMP_S * RATE_HZ
    ramp = out[math.ceil(bitten) : math.ceil(ends)]
    np.testing.assert_allclose(np.diff(ramp), np.diff(ramp)[0], rtol=1e-9)  # a straight line
    last = out[math.ceil(bitten) - 1]
    np.testing.assert_allclose(ramp[0], last * (ends - math.ceil(bitten)) / (ends - bitten), rtol=1e-5)
    np.testing.assert_array_equal(out[math.ceil(ends) :], 0.0)
    assert abs(last) > 0.1  # it went on until then
    counts, _ = expected(stopped(punctual(40), stop, 1000), math.ceil(bitten))
    np.testing.assert_array_equal(bench.counts[: counts.size], counts)


LATE = st.sampled_from([5, 17, 25, 60, 150, None])
GOES_ON = st.sampled_from([(PERIOD + 7, 0), (0, 0), (4 << 16, 0), (1 << 30, 0), (PERIOD, 1), (PERIOD, 77)])


@settings(max_examples=60, deadline=None)
@given(
    late=st.dictionaries(st.integers(0, 57), st.tuples(LATE, st.integers(1, 2)), max_size=15),
    other=st.dictionaries(st.integers(0, 57), GOES_ON, max_size=4),
)
def test_blocks_that_are_late_lost_doubled_or_swapped_are_continued_as_the_page_says(
    late: dict[int, tuple[int | None, int]], other: dict[int, tuple[int, int]]
) -> None:
    bench, end = Continuing(watchdog_s=1.0), 600
    arrivals: list[Arrival] = []
    for number, one in enumerate(punctual(end // BLOCK)):
        by, times = late.get(number, (0, 1))
        period, ramp = other.get(number, (PERIOD, 0))
        if by is not None:
            output = one.output._replace(period=period, ramp=ramp)
            arrivals += [Arrival(one.at + by, output)] * times
    bench.play(arrivals, end)
    check(bench, arrivals, end)


def test_in_version_1_missing_outputs_are_held_and_nothing_is_read_back() -> None:
    for faults, version in ((None, 1), (Faults(version=1), 1)):
        bench, end = Continuing(version, faults=faults), 400
        bench.play(stopped(punctual(end // BLOCK + QUEUE, period=0), 200, 50), end)
        assert not bench.link.of(Readback)
        assert bench.device.counts["held_blocks"] > 0 == bench.device.counts["continued_blocks"]
        flagged = np.flatnonzero(bench.flags)
        assert {bench.flags[j] for j in flagged} == {int(HELD)}
        first = next(i for i in range(220, 300) if bench.counts[i] == bench.counts[i - 1] == bench.counts[i + 1])
        assert (bench.counts[first : (flagged[-1]) * BLOCK] == bench.counts[first]).all()
        known = bench.ask(Command.GET, Parameter.LONGEST_PERIOD).status
        assert known == (Status.UNKNOWN if faults else Status.DONE)


def test_arm_forgets_what_came_before_it() -> None:
    bench = Continuing()
    for one in punctual(30):
        bench.until(one.at)
        bench.device.handle(one.output, bench.now_s)
    bench.ask(Command.DISARM)
    bench.until(285)
    assert bench.ask(Command.ARM, value=ARM_KEY).status == Status.DONE
    for number in (30, 31):  # 300 ... 319: less than the 26 outputs of a period, and four
        bench.device.handle(block(number), bench.now_s)
    bench.until(345)
    assert [bench.flags[number] for number in (32, 33)] == [HELD, HELD]
    assert (bench.counts[320:340] == bench.counts[319]).all()


@pytest.mark.parametrize("how", ["disarm", "stop", "emergency"])
def test_every_way_out_of_armed_is_at_0_v_while_it_goes_on(how: str) -> None:
    bench = Continuing()
    bench.play(punctual(30), 325)
    assert bench.device.state is DeviceState.ARMED
    assert np.abs(bench.counts[300:320]).max() > AMPLITUDE // 2
    if how == "emergency":
        bench.device.handle(EmergencyStop(1), bench.now_s)
    else:
        bench.ask(Command.DISARM if how == "disarm" else Command.STOP)
    bench.until(420)
    if how == "stop":
        np.testing.assert_array_equal(bench.device.output_v, 0.0)
    else:
        np.testing.assert_array_equal(bench.counts[326:], 0)
        assert not any(flags & (HELD | CONTINUED) for flags in bench.flags[33:])  # nothing is missing any more
        assert max(one.first for one in bench.link.of(Readback)) == 320


def test_a_late_ramp_ends_when_it_would_have_ended() -> None:
    bench, end = Continuing(watchdog_s=1.0), 600
    arrivals = punctual(40)
    for one in arrivals[20:]:
        one.output = one.output._replace(ramp=450 - one.output.first - BLOCK)
    bench.play(arrivals[:24], end)
    check(bench, arrivals[:24], end)
    assert np.abs(bench.counts[260:440]).max() > 0
    np.testing.assert_array_equal(bench.counts[450:end], 0)


def test_once_the_host_has_said_0_v_nothing_goes_on() -> None:
    bench, end = Continuing(watchdog_s=1.0), 500
    arrivals = punctual(30)
    zero = Output(300, np.zeros(BLOCK, np.int16))
    bench.play([*arrivals, Arrival(285, zero)], end)
    np.testing.assert_array_equal(bench.counts[300:end], 0)
    assert bench.flags[31:49] == [int(HELD)] * 18


def test_a_readback_is_cut_to_the_converters_range() -> None:
    bench = Continuing(watchdog_s=1.0)
    loud = [
        Arrival(one.at, one.output._replace(counts=(4 * one.output.counts).astype(np.int16))) for one in punctual(30)
    ]
    bench.play(loud, 400)
    got = np.concatenate([one.counts for one in bench.link.of(Readback)])
    assert (got.min(), got.max()) == (-10000, 10000)


def test_a_block_whose_readback_finds_no_room_is_dropped_whole() -> None:
    bench = Continuing(watchdog_s=1.0)
    bench.play(punctual(30), 305)
    samples, refuse = len(bench.link.of(Samples)), bench.link.send

    def full(message: object) -> None:
        bench.link.full = isinstance(message, Readback)
        refuse(message)  # type: ignore[arg-type]

    bench.link.send = full  # type: ignore[method-assign]
    bench.until(335)
    assert len(bench.link.of(Samples)) == samples
    bench.link.send = refuse  # type: ignore[method-assign]
    bench.link.full = False
    bench.until(345)
    assert bench.link.of(Samples)[-1].dropped == 3 * BLOCK


def test_a_reset_speaks_the_lowest_version_again() -> None:
    bench = Continuing()
    assert bench.link.version == 2
    bench.device.reset(bench.now_s)
    assert bench.link.version == 1
    assert bench.ask(Command.GET, Parameter.VERSION).value == 1
