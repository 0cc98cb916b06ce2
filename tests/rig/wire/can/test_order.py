"""Frames that change places, are lost and come twice: what becomes of their blocks, against an oracle that knows the truth."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import Frame
from rig.wire.messages import Output, Samples
from tests.rig.wire.can.test_codec import block_of, ends

QUEUE = 1
BUSES = [
    (4, True, 1),
    (4, True, 10),
    (4, False, 1),
    (4, False, 5),
    (9, False, 1),
    (9, False, 3),
    (40, True, 1),
    (2, True, 33),
]


class Sent(NamedTuple):
    """A frame on its way."""

    block: int
    """Its block; -1 for a frame of no block, that is an index or a heartbeat."""
    place: int
    """Within the block."""
    frame: Frame


class Way(NamedTuple):
    """One direction of a bus."""

    sender: CanCodec
    receiver: CanCodec
    n: int
    n_channels: int
    samples: bool

    @property
    def wrap_blocks(self) -> int:
        """Blocks after which the sequence numbers begin anew."""
        return self.sender._sent.wrap // self.sender._sent.groups

    def sent(self, blocks: range) -> list[Sent]:
        out = []
        for j in blocks:
            counts = block_of(j, self.n, self.n_channels)
            message = Samples(j * self.n, counts) if self.samples else Output(j * self.n, counts[:, 0])
            place = 0
            for frame in self.sender.encode(message):
                is_part = frame.identifier >= (0x300 if self.samples else 0x100)
                out.append(Sent(j if is_part else -1, place if is_part else 0, frame))
                place += is_part
        return out

    def received(self, sent: Sequence[Sent]) -> list[int]:
        """Numbers of the blocks that were returned, in order; each is the block that it says it is."""
        out = []
        for one in sent:
            message = self.receiver.decode(one.frame)
            if isinstance(message, Samples | Output):
                j, rest = divmod(message.first, self.n)
                counts = block_of(j, self.n, self.n_channels)
                assert rest == 0
                assert np.array_equal(message.counts, counts if self.samples else counts[:, 0])
                out.append(j)
        return out


def way(bus: tuple[int, bool, int], samples: bool, start: int) -> Way:
    n_channels, fd, n = bus
    device, host = ends(n_channels, fd, n, QUEUE)
    sender, receiver = (device, host) if samples else (host, device)
    receiver._incoming.begin(start)
    return Way(sender, receiver, n, n_channels, samples)


def expected(way: Way, sent: Sequence[Sent]) -> list[int]:
    """Blocks that must be returned, in order, by the rule as the page says it: all of its frames have come, before two newer
    blocks were whole, and before a block four after it began."""
    frames = len(way.sender._sent.pieces) * way.sender._sent.parts
    came: dict[int, set[int]] = {}
    out: list[int] = []
    newest = -1
    for one in sent:
        if one.block < 0:
            continue
        newest = max(newest, one.block)
        places = came.setdefault(one.block, set())
        if one.place in places:
            continue
        places.add(one.place)
        if one.block <= newest - 4:
            places.add(-1)  # given up: it never becomes whole any more
        is_too_late = any(other >= one.block + 2 for other in out)
        if len(places) == frames and -1 not in places and not is_too_late:
            out.append(one.block)
    return out


STARTS = {"the beginning": lambda way: 0, "a wrap": lambda way: 3 * way.wrap_blocks - 20}


def starting(bus: tuple[int, bool, int], samples: bool, where: str) -> tuple[Way, int]:
    start = STARTS[where](way(bus, samples, 0)) if where in STARTS else (1 << 32) // bus[2] - 20
    return way(bus, samples, start), start


def disturbed(sent: list[Sent], data: st.DataObject, farthest: int = 1, losses: int = 8) -> list[Sent]:
    """Frames lost, doubled (the second a little later), and in each other's place."""
    places = st.integers(0, len(sent) - 1)
    lost = data.draw(st.sets(places, max_size=losses), label="lost")
    doubled = data.draw(st.dictionaries(places, st.integers(1, 3), max_size=8), label="doubled")
    out = [one for at, one in enumerate(sent) if at not in lost]
    for at, later in sorted(doubled.items(), reverse=True):
        if at < len(out):
            out.insert(min(at + later, len(out)), out[at])
    swapped = data.draw(st.lists(st.tuples(places, st.integers(1, farthest)), max_size=20), label="swapped")
    for at, far in swapped:
        if at + far < len(out):
            out[at], out[at + far] = out[at + far], out[at]
    return out


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(BUSES),
    st.booleans(),
    st.sampled_from([*STARTS, "an index of 32 bits"]),
    st.sampled_from([1, 3]),
    st.data(),
)
def test_blocks_come_as_the_page_says_and_each_is_what_it_says(bus, samples, where, farthest, data) -> None:
    one, start = starting(bus, samples, where)
    sent = disturbed(one.sent(range(start, start + 45)), data, farthest)
    wanted = expected(one, sent)
    assert one.received(sent) == wanted
    assert all(later >= earlier - 1 for earlier, later in pairwise(wanted))


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(BUSES), st.booleans(), st.data())
def test_neighbours_in_each_others_place_cost_nothing(bus, samples, data) -> None:
    one, start = starting(bus, samples, "a wrap")
    sent = one.sent(range(start, start + 45))
    at = data.draw(st.sets(st.integers(0, len(sent) // 2 - 1), min_size=1), label="pairs")
    for pair in at:
        sent[2 * pair], sent[2 * pair + 1] = sent[2 * pair + 1], sent[2 * pair]
    assert sorted(one.received(sent)) == list(range(start, start + 45))
    counters = one.receiver._counters
    pairs = zip(sent[::2], sent[1::2], strict=False)
    assert counters["out_of_order_frames"] == sum(a[:2] > b[:2] for a, b in pairs if a.block >= 0 <= b.block)
    assert counters["repeated_frames"] == counters["incomplete_blocks"] == counters["resynchronised"] == 0
    assert counters["late_frames"] == 0


def after_a_loss(one: Way, start: int, most_blocks: int, data: st.DataObject) -> list[Sent]:
    """Frames of which a stretch of up to so many blocks is missing, the others swapped and doubled."""
    wrap = one.wrap_blocks
    sent = one.sent(range(start, start + 2 * wrap + min(wrap, 40)))
    first = data.draw(st.integers(0, min(len(sent) // 4, 60)), label="loss from")
    lost = data.draw(st.integers(0, most_blocks), label="blocks lost")
    behind = sent[first].block if sent[first].block >= 0 else sent[first + 1].block
    goes_on = next(at for at, each in enumerate(sent) if each.block == behind + lost)
    return disturbed(sent[:first] + sent[goes_on - (sent[goes_on - 1].block < 0) :], data, losses=0)


def moved_indices(one: Way, sent: Sequence[Sent]) -> int:
    """Announcements of an index that do not stand right before the block that they announce."""
    moved = 0
    for each, after in zip(sent, [*sent[1:], None], strict=True):
        if each.block < 0:
            first = int.from_bytes(each.frame.data[4:8] if one.samples else each.frame.data[:4], "little")
            moved += after is None or (after.block, after.place) != (first // one.n, 0)
    return moved


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(BUSES), st.booleans(), st.data())
def test_a_loss_of_less_than_half_the_sequence_numbers_misplaces_nothing_whatever_changes_places(
    bus, samples, data
) -> None:
    one, start = starting(bus, samples, "a wrap")
    left = after_a_loss(one, start, one.wrap_blocks // 2 - 2, data)
    wanted = expected(one, left)
    assert one.received(left) == wanted  # which asserts that every block is what it says
    assert one.receiver._counters["resynchronised"] == 0


@settings(deadline=None, max_examples=50)
@given(st.sampled_from(BUSES), st.booleans(), st.data())
def test_after_a_longer_loss_no_more_are_misplaced_than_the_page_says_and_indices_put_it_right(
    bus, samples, data
) -> None:
    one, start = starting(bus, samples, "a wrap")
    left = after_a_loss(one, start, one.wrap_blocks, data)
    wrong, got = 0, []
    for each in left:
        message = one.receiver.decode(each.frame)
        if isinstance(message, Samples | Output):
            got.append(message.first // one.n)
            wrong += each.block != got[-1]
    assert len(set(got)) == len(got)
    assert all(later >= earlier - 1 for earlier, later in pairwise(got))
    assert wrong <= one.wrap_blocks // 2 * (1 + moved_indices(one, left))
    assert left[-1].block - got[-1] <= one.wrap_blocks + 2


@pytest.mark.parametrize("bus", BUSES)
@pytest.mark.parametrize("samples", [True, False])
def test_frames_that_come_twice_are_not_out_of_order(bus, samples) -> None:
    one = way(bus, samples, 0)
    sent = one.sent(range(30))
    assert one.received([again for each in sent for again in (each, each)]) == list(range(30))
    assert one.receiver._counters["out_of_order_frames"] == 0
    assert one.receiver._counters["repeated_frames"] == len([each for each in sent if each.block >= 0])


def test_a_block_that_comes_two_too_late_is_given_up_and_counted() -> None:
    one = way((4, True, 1), True, 0)
    frames = [each for each in one.sent(range(10)) if each.block >= 0]
    frames[3:6] = frames[4], frames[5], frames[3]
    assert one.received(frames) == [0, 1, 2, 4, 5, 6, 7, 8, 9]
    counters = one.receiver._counters
    assert (counters["out_of_order_frames"], counters["late_frames"], counters["repeated_frames"]) == (1, 1, 1)


@pytest.mark.parametrize(("begun", "returned"), [(3, [0]), (4, [])])
def test_frames_belong_to_the_newest_block_and_the_three_before_it(begun: int, returned: list[int]) -> None:
    one = way((4, True, 10), True, 0)
    frames = [each for each in one.sent(range(6)) if each.block >= 0]
    firsts = [each for each in frames if each.place == 0 and each.block <= begun]
    assert one.received([*firsts, frames[1]]) == returned
    assert one.receiver._counters["incomplete_blocks"] == (not returned)
