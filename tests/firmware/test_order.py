"""Outputs whose frames change places, are lost or come twice: emulator and firmware take them alike, and swaps cost nothing."""

from pathlib import Path
from random import Random

import numpy as np
import pytest

from rig.wire.messages import ARM_KEY, Command, DeviceFlag, Parameter
from tests.firmware.building import built
from tests.firmware.differential import compare, replayed
from tests.firmware.events import CAN, CAN_FD, Choice, Event, Kind, frame_of
from tests.firmware.host import Host

QUEUE = 3
BLOCKS = {CAN: (1, 5, 20), CAN_FD: (1, 40)}


@pytest.fixture(scope="module")
def program() -> Path:
    return built("script")


def steady_host(choice: Choice, block: int, blocks: int = 150) -> Host:
    """A host that sends one block of outputs after the other in time."""
    host = Host(choice, Random(block))
    for parameter, value in (
        (Parameter.BLOCK, block),
        (Parameter.QUEUE, QUEUE),
        (Parameter.WATCHDOG_US, 4_000_000_000),
    ):
        host.request(Command.SET, parameter, 0, value)
    host.request(Command.START)
    host.request(Command.ARM, value=ARM_KEY)
    began_us = host._now_us
    for number in range(QUEUE, QUEUE + blocks):
        host.output(number)
        host.wait(began_us + (number - QUEUE + 1) * host._block_us - host._now_us)
    host.request(Command.STOP)
    return host


def outputs(events: list[Event]) -> list[int]:
    """Places of the frames of outputs among the events."""
    return [at for at, one in enumerate(events) if one.kind == Kind.FRAME and frame_of(one.data).identifier >= 0x100]


def swapped(events: list[Event], at: int, other: int) -> None:
    """Exchange two frames, not their times."""
    first, second = events[at], events[other]
    events[at], events[other] = first._replace(data=second.data), second._replace(data=first.data)


@pytest.mark.parametrize(("wire", "block"), [(wire, block) for wire, blocks in BLOCKS.items() for block in blocks])
def test_outputs_whose_neighbouring_frames_change_places_are_put_out_in_order(wire, block, program) -> None:
    host = steady_host(Choice(wire, 4), block)
    events = list(host.events)
    places = outputs(events)
    for at, other in zip(places[::2], places[1::2], strict=False):
        swapped(events, at, other)
    python = replayed(host.choice, events)
    np.testing.assert_array_equal(np.concatenate(python.plant.blocks), np.concatenate(host.python.plant.blocks))
    assert not any(flags & DeviceFlag.OUTPUT_HELD for flags in python.link.flags)
    assert python.link.counters["out_of_order_frames"] == len(places) // 2
    assert python.link.counters["incomplete_blocks"] == python.link.counters["repeated_frames"] == 0
    assert compare(program, host.choice, events) == []


@pytest.mark.parametrize("seed", range(12))
def test_frames_swapped_lost_and_doubled_are_the_same_to_both(seed: int, program: Path) -> None:
    random = Random(seed)
    wire = random.choice((CAN, CAN_FD))
    host = steady_host(Choice(wire, 4), random.choice(BLOCKS[wire]), 400)
    events = list(host.events)
    places = outputs(events)
    lost: set[int] = set()
    for number, at in enumerate(places[:-1]):
        chance = random.random()
        if chance < 0.1:
            swapped(events, at, places[min(number + random.choice((1, 1, 2, 5)), len(places) - 1)])
        elif chance < 0.15:
            lost.add(at)
        elif chance < 0.2:
            events[at] = events[at]._replace(data=events[places[max(0, number - random.choice((1, 2, 5)))]].data)
    events = [one for at, one in enumerate(events) if at not in lost]
    python = replayed(host.choice, events)
    assert python.link.counters["out_of_order_frames"] > 0
    assert compare(program, host.choice, events) == []
