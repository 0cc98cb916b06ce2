"""The work of a chunk stands between no block and the sending of its answer."""

import itertools

import numpy as np
import pytest

from rig.errors import DaqDisconnected
from tests.rig.loop.worker.drivers import NotingDAQ
from tests.rig.loop.worker.rigs import slow_bench, tone
from tests.rig.loop.worker.test_accidents import loop_over
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ

BLOCK = 5  # of four in a chunk of 20 ms


class FollowedDAQ(NotingDAQ):
    """Notes when outputs are sent and a block is there; ``helpful``: does the caller's work in between."""

    helpful = False

    def __init__(self, bench):
        super().__init__(bench)
        self.events = []

    def _exchange(self, voltages, inputs):
        self.events.append("sent")
        if self.helpful:
            self.do_meanwhile()
        super()._exchange(voltages, inputs)
        self.events.append("there")


class HelpfulDAQ(FollowedDAQ):
    helpful = True


def followed(kind, seconds=0.3, **options):
    """A loop in this process, and what happened in it in order."""
    bench = slow_bench(block=BLOCK, **options)
    daq = kind(bench)
    daq.open()
    daq.start(BLOCK)
    loop = loop_over(daq, bench, tone(bench, seconds))

    def noted(chore):
        def work():
            daq.events.append(chore.__name__)
            chore()

        return work

    loop._chores = {number: noted(chore) for number, chore in loop._chores.items()}
    return loop, daq.events


def places(events):
    """Of every chore the event before it."""
    chores = {"_hand_over", "_look_round", "_announce"}
    return {(before, event) for before, event in itertools.pairwise(events) if event in chores}


CHORES = ("_hand_over", "_look_round", "_announce")


@pytest.mark.parametrize(
    ("kind", "options", "before"),
    [
        (HelpfulDAQ, {"paced": True}, "sent"),  # while the block is awaited
        (FollowedDAQ, {"paced": True}, "there"),  # after it: before, the outputs would be late
        (FollowedDAQ, {}, "there"),  # paced by the host: before the next block is due
        (HelpfulDAQ, {"paced": True, "lockstep": True}, "sent"),
    ],
)
def test_chores_are_done_where_no_output_waits_for_them(kind, options, before):
    loop, events = followed(kind, **options)
    loop.run()
    assert loop.failure is None
    first = events.index("sent")
    assert places(events[first:]) >= {(before, chore) for chore in CHORES}
    if options:  # the device paces
        assert places(events) == {(before, chore) for chore in CHORES}


def test_each_chore_has_a_block_of_its_own_and_comes_once_a_chunk():
    loop, events = followed(HelpfulDAQ, paced=True)
    loop.run()
    per_block = " ".join(event for event in events if event != "there").split("sent")
    counts = [len(block.split()) for block in per_block]
    assert max(counts) == 1
    done = [event for event in events if event in CHORES]
    assert done[:6] == [*CHORES, *CHORES]


def test_a_chunk_of_few_blocks_has_all_chores_in_its_first():
    bench = slow_bench(block=10, paced=True)  # two blocks
    daq = HelpfulDAQ(bench)
    daq.open()
    daq.start(10)
    loop = loop_over(daq, bench, tone(bench, 0.1))
    assert [chore.__name__ for chore in loop._chores.values()] == ["_all_chores"]
    loop.run()
    memory = loop._memory
    rows = sum(int(memory._slots[index].head[0]) for index in range(memory.published))
    assert rows == int(loop.tick.sample) > 100


@pytest.mark.parametrize("options", [{"paced": True}, {}, {"paced": True, "lockstep": True}])
def test_every_row_is_handed_over_once_and_each_state_is_that_of_its_last_row(options):
    loop, _ = followed(HelpfulDAQ, **options)
    ends, publish_it = [], loop._memory.publish

    def publish():
        ends.append(loop.tick.sample)
        publish_it()

    loop._memory.publish = publish
    loop.run()
    memory = loop._memory
    rows = [int(memory._slots[index].head[0]) for index in range(memory.published)]
    assert np.cumsum(rows).tolist() == ends
    assert ends[-1] == loop.tick.sample


def test_a_driver_that_fails_leaves_no_work_undone_and_the_chunk_before_is_handed_over():
    loop, events = followed(FollowedDAQ, paced=True, fails_after=8)  # the first block of the third chunk
    loop.run()
    assert isinstance(loop.failure, DaqDisconnected)
    assert loop.daq.meanwhile is None
    memory = loop._memory
    assert [int(memory._slots[index].head[0]) for index in range(memory.published)] == [20, 20, 0]
    assert events.count("there") == 8


def test_a_wire_does_it_once_the_outputs_are_sent_and_before_the_block_is_there():
    bench = bench_with({"block": 10})
    with MemoryDAQ(bench, lockstep=True) as daq:
        daq.start(10)
        seen = []
        daq.meanwhile = lambda: seen.append((len(daq.wire.to_device), daq._streaming.incoming.blocks))
        daq.exchange(np.zeros(10))
        assert seen == [(1, 0)]
        daq.exchange(np.zeros(10))
        assert len(seen) == 1
