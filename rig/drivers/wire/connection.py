"""A device at the other end of an open link: found, brought to rest, compared with the bench, and timed."""

import contextlib
import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from rig.bench import Bench
from rig.drivers.wire.dialogue import ANSWER_S, Dialogue, latched_text, stopped, why_not
from rig.drivers.wire.facts import DeviceFacts, compare, negotiate, read_facts
from rig.errors import DaqError, DaqMismatch, DaqProtocol, DaqRefused, DaqTimeout
from rig.wire.link import Link
from rig.wire.messages import (
    LOWEST_VERSION,
    STOPPED,
    VERSION,
    Command,
    DeviceFlag,
    DeviceState,
    Parameter,
    Status,
    Stream,
)

KEPT = 4096  # round trips that are kept; chosen: some minutes of pings


class RoundTrips:
    """The last few thousand round trips; `report` gives their median and 99th percentile in microseconds."""

    def __init__(self) -> None:
        self._kept_s = np.zeros(KEPT)
        self._count = 0

    def add(self, round_trip_s: float) -> None:
        """Add one round trip."""
        self._kept_s[self._count % KEPT] = round_trip_s
        self._count += 1

    def report(self) -> dict[str, float]:
        """Median, 99th percentile and largest, microseconds; empty before the first round trip."""
        if not self._count:
            return {}
        kept_us = 1e6 * self._kept_s[: min(self._count, KEPT)]
        p50, p99, largest = np.percentile(kept_us, (50.0, 99.0, 100.0))
        return {
            "round_trip_p50_us": round(float(p50), 1),
            "round_trip_p99_us": round(float(p99), 1),
            "round_trip_largest_us": round(float(largest), 1),
            "round_trips": float(self._count),
        }


MOST_LOAD = 0.9  # part of the wire's capacity that a stream may use
FIND_TRIES = 20  # requests before a port counts as silent; chosen: 2 s in all
OPENING_PINGS = 50  # pings for the first statistics; chosen
NOTHING = DeviceFlag(0)
HEARTBEAT_S = 0.25  # a device sends one every 0.1 s


class Connection:
    """A link, and the device at its other end.

    Errors: those of `rig.errors`, each in one line that begins with the name of the port.
    """

    def __init__(self, link: Link, clock: Callable[[], float]) -> None:
        self.link, self.clock = link, clock
        self.dialogue = Dialogue(link, clock)
        self.facts: DeviceFacts | None = None
        """The device's description of itself; None before `meet`."""
        self.round_trips = RoundTrips()
        self.load_share = 0.0
        """Part of the wire's capacity that the stream checked last uses."""
        self.needed_bit_s = 0.0
        """Bits per second of that stream; also known for a wire without a limit."""
        self.sustainable_hz = math.inf
        """Highest sample rate that wire and device carry with blocks of this size, Hz."""
        self.lacks_room = False
        """Whether version 1 is spoken because the wire has no room for version 2."""
        self.found_running = False
        """Whether the device was still sampling when it was found."""
        self.latched = self.cleared = NOTHING
        """``latched``: what had latched when the device was met and is not cleared yet; ``cleared``: what was cleared."""

    def meet(self, bench: Bench, queue: int, loop: Literal["computer", "device", "auto"] = "computer") -> None:
        """Find the device. Refuse it if it is not the one the bench describes, or if the wire cannot carry its stream.

        Where the device is to run the ``loop``, the stream is another one, which is checked with its plan.
        """
        self._find()
        facts = self._agree(bench, VERSION)
        stream = Stream(len(bench.channels), bench.block, bench.sample_rate_hz, facts.bits, queue)
        try:
            if loop != "device":
                self.check_capacity(stream)
        except DaqRefused as refused:
            if loop == "computer" or not facts.loop_digest:
                self._do_without_readbacks(bench, stream, refused)
        for number in range(OPENING_PINGS):
            began = self.clock()
            self.dialogue.ask(Command.GET, Parameter.PING, number)
            self.round_trips.add(self.clock() - began)
        self.latched = self._what_has_latched()

    def ask(self) -> DeviceFacts:
        """Find the device, and return what it says of itself, whatever a bench says."""
        self._find()
        negotiate(self.dialogue)
        return read_facts(self.dialogue)

    def _agree(self, bench: Bench, latest: int) -> DeviceFacts:
        negotiate(self.dialogue, latest)
        self.facts = facts = read_facts(self.dialogue)
        compare(facts, bench, self.link.name, self.link.layout_crc)
        return facts

    def _do_without_readbacks(self, bench: Bench, stream: Stream, refused: DaqRefused) -> None:
        """Speak version 1 if the wire has room for that alone; raise what was refused if the device does not speak it."""
        if self.link.version == LOWEST_VERSION or self.dialogue.get(Parameter.LOWEST_VERSION) > LOWEST_VERSION:
            raise refused
        self._agree(bench, LOWEST_VERSION)
        self.check_capacity(stream)
        self.lacks_room = True

    def _find(self) -> None:
        """Ask until a device answers, and stop it in case an earlier host has left it running."""
        dialogue, name = self.dialogue, self.link.name
        for attempt in range(FIND_TRIES):
            with contextlib.suppress(DaqTimeout):
                state = dialogue.ask(Command.GET, Parameter.STATE, tries=1).value
                break
            if attempt == FIND_TRIES - 1:
                if dialogue.stray_answers:
                    raise DaqTimeout(
                        f"{name}: the device answers later than {ANSWER_S:g} s after it was asked: too slow for a test; "
                        "is the line, or what is in between, overloaded?"
                    )
                raise DaqProtocol(
                    f"{name}: nothing answers that speaks this protocol{dialogue.damage()}; "
                    "is it the right port, and the device switched on?"
                )
        self.found_running = state in (DeviceState.RUNNING, DeviceState.ARMED)
        dialogue.do(Command.STOP)
        dialogue.forget()

    def check_capacity(self, stream: Stream) -> None:
        """Raise `DaqRefused`, with the sum of the bits, if the wire cannot carry a stream."""
        if why := self.why_not_carried(stream):
            raise DaqRefused(why)

    def why_not_carried(self, stream: Stream) -> str:
        """Why the wire cannot carry a stream, with the sum of the bits; empty if it can."""
        assert self.facts is not None
        load = self.link.load(stream)
        self.load_share, self.needed_bit_s = load.share, load.needed_bit_s
        highest_hz = self.facts.rate_hz[1]
        self.sustainable_hz = min(highest_hz, MOST_LOAD * stream.rate_hz / load.share if load.share else math.inf)
        if load.share < MOST_LOAD:
            return ""
        return (
            f"{self.link.name}: {stream.rate_hz:g} Hz in blocks of {stream.block} would take "
            f"{100.0 * load.share:.0f} % of the wire, allowed is below {100.0 * MOST_LOAD:.0f} %: {load.sum_text}"
        )

    def check_latch(self, forgiven: DeviceFlag = NOTHING) -> None:
        """Raise `DaqEmergencyStop` or `DaqWatchdog` if anything other than ``forgiven`` has latched."""
        latched = self._what_has_latched()
        if latched & ~forgiven:
            raise stopped(
                self.link.name,
                latched,
                f"{latched_text(latched)}: a run that is armed clears what it finds latched when it opens the device",
            )

    def clear(self) -> None:
        """Clear what had latched when the device was met; raise for what has latched since."""
        if self.latched:
            self.check_latch(self.latched)
            self.dialogue.do(Command.CLEAR)
            self.latched, self.cleared = NOTHING, self.latched

    def _what_has_latched(self) -> DeviceFlag:
        """Flags that have latched, from the next heartbeat; without a heartbeat all flags that can latch."""
        if self.dialogue.get(Parameter.STATE) != DeviceState.LATCHED:
            return NOTHING
        return DeviceFlag(self.dialogue.beat_with(STOPPED, HEARTBEAT_S) or STOPPED)

    def set(self, parameter: Parameter, value: int, key: str, scale: float, unit: str) -> None:
        """Set a parameter; ``key``, ``scale`` and ``unit`` say in an error what the bench calls it."""
        answer = self.dialogue.ask(Command.SET, parameter, value=value)
        if answer.status == Status.DONE and answer.value == value:
            return
        why = f"not what the device can do, the nearest is {answer.value * scale:g} {unit}"
        if answer.status == Status.DONE:
            why = f"the device has set {answer.value * scale:g} {unit} instead"
        elif answer.status != Status.NOT_ALLOWED:
            why = f"not set: {why_not(answer)}"
        raise DaqMismatch(f"{self.link.name}: {key} = {value * scale:g} {unit}: {why}")

    def close(self) -> None:
        """Send STOP without waiting for an answer, and close the port."""
        with contextlib.suppress(DaqError):
            self.link.send(self.dialogue.next_request(Command.STOP))
        self.let_go()

    def let_go(self) -> None:
        """Close the port."""
        with contextlib.suppress(DaqError):
            self.link.close()
