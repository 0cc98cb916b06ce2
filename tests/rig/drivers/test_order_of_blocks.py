"""How long the host waits for a block that the next one has overtaken, and what becomes of one that comes too late."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.drivers.wire import WireOptions
from rig.drivers.wire.dialogue import Dialogue
from rig.drivers.wire.incoming import Incoming
from rig.emulator import Faults
from rig.errors import DaqReset, DaqTimeout
from rig.wire.link import Link, Load
from rig.wire.messages import Answer, DeviceFlag, DeviceState, Heartbeat, Message, Readback, Samples, Stream
from tests.refused import refused
from tests.rig.drivers.test_wire import answers, virtual
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ

N = 4
PATIENCE_S = 0.5


class TimedLink(Link):
    """Messages with the times at which they come, s; waiting takes the time that it says."""

    def __init__(self, coming: list[tuple[float, Message]]) -> None:
        super().__init__("timed")
        self.coming, self.now_s = deque(coming), 0.0

    def receive(self, timeout_s: float) -> Message | None:
        if self.coming and self.coming[0][0] <= self.now_s + timeout_s:
            at_s, message = self.coming.popleft()
            self.now_s = max(self.now_s, at_s)
            return message
        self.now_s += timeout_s
        return None

    def open(self) -> None: ...
    def close(self) -> None: ...
    def configure(self, stream: Stream) -> None: ...
    def send(self, message: Message) -> None: ...
    def load(self, stream: Stream) -> Load:
        return Load(0.0, 1.0, "")


def block(number: int) -> Samples:
    return Samples(number * N, np.full((N, 1), number))


def incoming(
    coming: list[tuple[float, Message]], patience_s: float = PATIENCE_S, version: int = 1
) -> tuple[Incoming, TimedLink]:
    link = TimedLink(coming)
    link.speak(version)
    dialogue = Dialogue(link, lambda: link.now_s)
    return Incoming(dialogue, (N, 1), 100 * N, 10.0, 7, patience_s), link


def taken(found: Incoming, blocks: int) -> list[int | None]:
    """Numbers of the blocks as they were returned; None for a gap."""
    out = [found.take() for _ in range(blocks)]
    return [None if one is None else int(one.counts[0, 0]) for one in out]


@pytest.mark.parametrize(("comes_s", "returned"), [(2.0, 1), (2.49, 1), (2.51, None)])
def test_the_block_before_is_waited_for_so_long_and_no_longer(comes_s: float, returned: int | None) -> None:
    found, link = incoming([(1.0, block(0)), (2.0, block(2)), (comes_s, block(1)), (3.0, block(3))])
    assert taken(found, 2) == [0, returned]
    assert link.now_s == (comes_s if returned else 2.5)
    assert taken(found, 2) == [2, 3]
    assert found.reordered_blocks == (returned is not None)
    assert found.late_blocks == (returned is None)
    assert found.lost_samples == (0 if returned else N)
    assert found.repeated_blocks == 0


def test_without_patience_what_is_there_is_put_in_order_and_time_does_not_pass() -> None:
    found, link = incoming(
        [(1.0, block(1)), (1.0, Answer(1, 0)), (1.0, block(0)), (2.0, block(3)), (2.1, block(2))], 0.0
    )
    assert taken(found, 2) == [0, 1]
    assert link.now_s == 1.0
    assert taken(found, 2) == [None, 3]
    assert link.now_s == 2.0


def test_a_further_block_ends_the_wait() -> None:
    found, link = incoming([(1.0, block(1)), (1.1, block(1)), (1.2, block(2)), (1.3, block(0)), (1.4, block(3))])
    assert taken(found, 1) == [None]
    assert link.now_s == 1.2
    assert taken(found, 3) == [1, 2, 3]
    assert (found.repeated_blocks, found.late_blocks) == (1, 1)


def test_a_gap_of_two_blocks_is_waited_for_once() -> None:
    found, link = incoming([(1.0, block(2)), (1.0, block(1)), (2.0, block(3))])
    assert taken(found, 1) == [None]
    assert link.now_s == 1.0
    assert taken(found, 3) == [1, 2, 3]


def test_heartbeats_during_the_wait_are_heard() -> None:
    beat = Heartbeat(DeviceState.ARMED, 0, 8, 0)
    found, _ = incoming([(1.0, block(1)), (1.1, beat), (1.2, block(0))])
    with pytest.raises(DaqReset):
        found.take()


def test_other_messages_do_not_make_the_wait_longer() -> None:
    beat = Heartbeat(DeviceState.ARMED, 0, 7, 0)
    found, link = incoming(
        [(1.0, block(1)), (1.3, beat), (1.4, beat), (1.6, block(0)), (1.7, block(0)), (2.0, block(2))]
    )
    assert taken(found, 2) == [None, 1]
    assert link.now_s == pytest.approx(1.5)
    assert taken(found, 1) == [2]
    assert (found.late_blocks, found.repeated_blocks) == (1, 1)


def test_a_stream_of_other_messages_does_not_hold_the_loop_up() -> None:
    beats = [(1.0, Heartbeat(DeviceState.ARMED, 0, 7, 0))] * 1000
    found, link = incoming([(1.0, block(1)), *beats, (1.0, block(0))], 0.0)
    assert taken(found, 2) == [None, 1]
    assert len(link.coming) > 900


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_whatever_is_swapped_lost_or_doubled_blocks_are_in_their_places(data: st.DataObject) -> None:
    sent = list(range(30))
    for at in data.draw(st.lists(st.integers(0, 28), max_size=12), label="swapped"):
        sent[at], sent[at + 1] = sent[at + 1], sent[at]
    lost = data.draw(st.sets(st.integers(0, 28), max_size=8), label="lost")
    doubled = data.draw(st.sets(st.integers(0, 29), max_size=8), label="doubled")
    came = [number for number in sent if number not in lost for _ in range(1 + (number in doubled))]
    found, _ = incoming([(0.01 * at, block(number)) for at, number in enumerate(came)] + [(9.0, block(30))])
    got = taken(found, 31)
    assert all(number in (None, place) for place, number in enumerate(got))
    assert found.lost_samples == N * got.count(None)
    first = {number: came.index(number) for number in set(came)}
    for number, at in first.items():
        later = [other for other in first if other > number and first[other] < at]
        assert (got[number] is not None) == (later in ([], [number + 1])) or _was_ended(number, came, at)


def _was_ended(number: int, came: list[int], at: int) -> bool:
    """Whether a third block, or the block twice before, came in between, after which the window is over."""
    return any(other != number + 1 for other in came[came.index(number + 1) : at])


@pytest.mark.parametrize(("queue", "blocks"), [(1, 0.0), (2, 0.5), (3, 1.0), (8, 1.0)])
def test_the_wait_is_half_of_what_the_queue_leaves_and_at_most_a_block(queue: int, blocks: float) -> None:
    daq = MemoryDAQ(bench_with(), 3, WireOptions(queue_blocks=queue), lockstep=False, simulated=1)
    with daq:
        daq.start(5)
        assert daq._streaming is not None
        assert daq._streaming.incoming._patience_s == pytest.approx(blocks * 5 / daq.sample_rate_hz)


def test_a_device_that_waits_for_the_host_has_time() -> None:
    daq = MemoryDAQ(bench_with(), 3, faults=Faults(reorder_every=2))
    inputs, flags = answers(daq, 5)
    np.testing.assert_array_equal(inputs, virtual(5))
    assert not flags.any()


def test_silence_after_a_gap_is_a_time_out_as_ever() -> None:
    found, link = incoming([(1.0, block(0)), (2.0, block(2))])
    assert taken(found, 3) == [0, None, 2]
    with refused(DaqTimeout, "sample-has-not-come"):
        found.take()
    assert link.now_s == pytest.approx(12.5)


def missed(number: int) -> Samples:
    return block(number)._replace(flags=int(DeviceFlag.OUTPUT_HELD))


def told(number: int) -> Readback:
    return Readback(number * N, np.full(N, -number))


def test_a_readback_may_come_after_its_block_and_beside_that_of_another() -> None:
    coming: list[Message] = [
        told(0),
        missed(0),
        missed(1),
        told(1),
        told(3),
        missed(3),
        told(2),
        missed(2),
        block(4),
        missed(5),
        block(6),
    ]
    found, _ = incoming([(1.0 + 0.1 * at, message) for at, message in enumerate(coming)], version=2)
    put_out = []
    for number in range(7):
        samples = found.take()
        assert (samples is None) == (number == 5)
        put_out.append(None if samples is None or found.put_out is None else int(found.put_out[0]))
    assert put_out == [0, -1, -2, -3, None, None, None]
    assert (found.missing_readbacks, found.reordered_blocks, found.lost_samples) == (1, 1, N)


def test_readbacks_without_blocks_take_no_memory() -> None:
    coming: list[Message] = [told(number) for number in range(10, 50)] + [
        missed(number) for number in range(50, 90) if number % 2
    ]
    found, _ = incoming([(1.0, message) for message in [*coming, told(0), missed(0), block(1)]], version=2)
    assert taken(found, 2) == [0, 1]
    assert len(found._readbacks) + len(found._untold) <= 8
