"""Options that all wires share, and the watchdog time that follows from them."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from rig.bench import Bench
from rig.bench.configuration import Configured
from rig.drivers.wire.facts import DeviceFacts
from rig.errors import DaqRefused
from vibrolock.described import one_fault

LARGEST_QUEUE = 64  # blocks; of the protocol (docs/reference/wire-protocol.md)
MOST_S = 4000.0  # microseconds in an unsigned word of four bytes


class WireOptions(Configured):
    """Options that all wires share; each driver adds those that locate the device."""

    queue_blocks: Annotated[
        Annotated[int, Field(ge=1, le=LARGEST_QUEUE)] | Literal["auto"],
        one_fault(f"1 to {LARGEST_QUEUE} blocks, or 'auto'"),
    ] = "auto"
    """q: blocks between handing over an output and its conversion. A longer one tolerates a later host and delays the loop.
    ``"auto"``: before a run, at 0 V, lateness is measured for a second and a half, and the shortest queue taken that covers it;
    without a closed loop one of up to 0.1 s; 1 where the device waits for the host."""
    watchdog_s: float | None = Field(None, gt=0, le=MOST_S)
    """Time without an output after which the device brings its own to 0 V, s; by default 0.1 s or 4 blocks, or the shortest
    that the device can do, whichever is longest. Where something moves, at most 1 s, or 10 blocks if longer."""
    ramp_s: float = Field(0.05, ge=0, le=MOST_S)
    """Duration of the ramp to 0 V after the watchdog has tripped, s; 0 drops the output at once."""
    timeout_s: float | None = Field(None, gt=0, le=MOST_S)
    """Longest wait for a block before the device counts as silent, s; by default 0.25 s, or 10 blocks if longer."""

    @property
    def queue(self) -> int:
        """Number of blocks; 1 until ``"auto"`` was replaced by a number (`rig.daq.DAQ.adjust`)."""
        return 1 if self.queue_blocks == "auto" else self.queue_blocks


class LoopOptions(WireOptions):
    """Options of wires that carry the rows of a loop on the device."""

    loop: Literal["computer", "device", "auto"] = "computer"
    """Where the loop runs. ``"device"``: in a device that was built with the same loop (`rig firmware tick`); it then needs no
    computer between one sample and the next. ``"auto"``: there if the device has the same loop, the wire carries its rows and
    the plan fits into the device's memory, else on the computer."""


def check_inputs(inputs: Sequence[int | str], bench: Bench) -> None:
    """Raise `DaqRefused` unless there is one input of the device for each channel of a bench."""
    if len(inputs) != len(bench.channels):
        raise DaqRefused(
            f"{len(inputs)} channels of the device for {len(bench.channels)} of the bench",
            field="driver.options.inputs",
            value=list(inputs),
            allowed="one for each channel of the bench, in their order",
        )


DEFAULT_S, DEFAULT_BLOCKS = 0.1, 4  # default watchdog, s and blocks, the longer of the two; chosen
SHORTEST_BLOCKS = 2  # blocks of the shortest watchdog: one block may be under way
LONGEST_S, LONGEST_BLOCKS = 1.0, 10  # where something moves: so long an output may be held


LOOP_S = 20.0
"""Default watchdog where the device runs the loop, s; chosen: limits and trips act there, without the computer."""
SHORTEST_LOOP_S, LONGEST_LOOP_S = 1.0, 600.0
"""The shortest one, s: ten pings; and the longest where something moves, for so long a vibration may go on unwatched."""


def _default_s(block_s: float) -> float:
    return max(DEFAULT_S, DEFAULT_BLOCKS * block_s)


def _longest_s(block_s: float) -> float:
    return max(LONGEST_S, LONGEST_BLOCKS * block_s)


def watchdog_range_s(device_s: tuple[float, float], block_s: float) -> tuple[float, float]:
    """Shortest and longest watchdog time that driver and device allow, s; `LONGEST_S` also for a device that moves nothing."""
    shortest_s, longest_s = device_s
    return max(shortest_s, SHORTEST_BLOCKS * block_s), min(longest_s, _longest_s(block_s))


def watchdog_s(options: WireOptions, device_s: float, block_s: float, *, moves: bool) -> float:
    """Watchdog time to set, s; ``device_s``: the shortest that the device can do; ``moves``: whether it may move something.

    Raises `DaqRefused` if it is shorter than two blocks, or too long for a device that moves something.
    """
    chosen_s = options.watchdog_s or max(_default_s(block_s), device_s)
    shortest_s, longest_s = SHORTEST_BLOCKS * block_s, _longest_s(block_s)
    if chosen_s < shortest_s:
        raise DaqRefused(
            field="driver.options.watchdog_s",
            value=chosen_s,
            allowed=f"from {shortest_s:g} s on, {SHORTEST_BLOCKS} blocks",
        )
    if chosen_s > longest_s and moves:
        raise DaqRefused(
            "" if options.watchdog_s else "is the shortest that the device can do",
            field="driver.options.watchdog_s",
            value=chosen_s,
            allowed=f"up to {longest_s:g} s for a device that may move something: it holds its last output for as long",
        )
    return chosen_s


def loop_watchdog_s(options: WireOptions, device_s: tuple[float, float], *, moves: bool) -> float:
    """Watchdog time for a loop on the device, s; ``device_s``: shortest and longest that it can do.

    Raises `DaqRefused` if it is too short for the pings that feed it, or too long for a device that moves something.
    """
    chosen_s = options.watchdog_s or min(max(LOOP_S, device_s[0]), device_s[1])
    if chosen_s < SHORTEST_LOOP_S or (moves and chosen_s > LONGEST_LOOP_S):
        raise DaqRefused(
            field="driver.options.watchdog_s",
            value=chosen_s,
            allowed=f"{SHORTEST_LOOP_S:g} to {LONGEST_LOOP_S:g} s where the device runs the loop",
        )
    return chosen_s


def raised_remark(options: WireOptions, facts: DeviceFacts, block_s: float) -> str:
    """Remark that the device's shortest watchdog time is above the default; empty if the default applies or was not wanted."""
    if options.watchdog_s or facts.watchdog_s[0] <= _default_s(block_s):
        return ""
    return (
        f"the device's watchdog waits {facts.watchdog_s[0]:g} s, the shortest that it can do, "
        f"instead of the usual {_default_s(block_s):g} s"
    )
