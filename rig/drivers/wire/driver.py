"""`WireDAQ`: the host's half of the wire protocol, whatever the wire."""

import contextlib
import math
import time
from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ, LOST, Capabilities
from rig.drivers.wire.dialogue import Dialogue
from rig.drivers.wire.facts import DeviceFacts, compare, negotiate, read_facts, remarks_on
from rig.drivers.wire.incoming import Incoming
from rig.drivers.wire.options import WireOptions
from rig.drivers.wire.round_trips import RoundTrips
from rig.errors import DaqError, DaqMismatch, DaqProtocol, DaqRefused, DaqTimeout
from rig.wire.link import Link
from rig.wire.messages import (
    ARM_KEY,
    Answer,
    Command,
    DeviceFlag,
    DeviceState,
    EmergencyStop,
    Output,
    Parameter,
    Stream,
)

__all__ = ["WireDAQ"]

HOLD_SAMPLES = 0.5  # a held output is half a sample late on average
MOST_LOAD = 0.9  # of what the wire carries
FIND_TRIES = 20
OPENING_PINGS = 50
PINGS_PER_S = 20.0
SHORTEST_WATCHDOG_BLOCKS = 2
LARGEST_UNKNOWN_BLOCK = 65536  # until the device has told its own


class WireDAQ(DAQ):
    """A device behind a wire. A driver says which by `_make_link`; everything else is the protocol's.

    `start` sets the device's parameters; it begins to sample, and is armed, with the first call of `exchange`: so nothing is
    lost and no watchdog bites while the loop is being prepared. From then on call j of `exchange` hands over the
    outputs of block j + q and waits for the samples of block j.

    Errors: those of `rig.errors`, each in one line that begins with the name of the port.
    """

    clock: Callable[[], float] = staticmethod(time.perf_counter)

    def __init__(self, bench: Bench, seed: int, options: WireOptions) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self._bench = bench
        self._options = options
        self._link: Link | None = None
        self._facts: DeviceFacts | None = None
        self._incoming: Incoming | None = None
        self._round_trips = RoundTrips()
        self._flag_counts = dict.fromkeys((str(flag.name).lower() for flag in DeviceFlag), 0)
        self._found_running = 0
        self._cleared = 0
        self._load_share = 0.0
        self._sustainable_hz = math.inf

    @abstractmethod
    def _make_link(self) -> Link:
        """A link to the device, not yet open."""

    @property
    def capabilities(self) -> Capabilities:
        """Paced by the device; virtual where the device says that nothing physical moves; known once open."""
        facts, link = self._facts, self._link
        return Capabilities(
            largest_block=min(facts.largest_block, link.largest_block) if facts and link else LARGEST_UNKNOWN_BLOCK,
            paced=True,
            virtual=facts is not None and facts.simulated,
            repeatable=facts is not None and facts.repeatable,
        )

    @property
    def latency_samples(self) -> float:
        """Queue, half a sample of hold, and the delay of the converters' filters that the device tells."""
        return self._options.queue_blocks * self.block + HOLD_SAMPLES + self.filter_delay_samples

    @property
    def filter_delay_samples(self) -> float:
        """Mean delay of the converters' filters at low frequency, as the device tells it."""
        return self._facts.filter_delay_s * self.sample_rate_hz if self._facts else 0.0

    @property
    def identity(self) -> dict[str, str]:
        """Port, model, firmware and serial number."""
        if self._facts is None or self._link is None:
            return {}
        facts = self._facts
        return {
            "port": self._link.name,
            "model": facts.model,
            "firmware": facts.firmware,
            "serial_number": facts.serial_number,
            "boot": f"{facts.boot:08x}",
            "simulated": "yes" if facts.simulated else "no",
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """Where the device differs from the bench, and in what state it was found."""
        out = remarks_on(self._facts, self._bench) if self._facts else []
        if self._found_running:
            out.append("the device was still running from an earlier run and was stopped first")
        if self._cleared:
            out.append("the device's watchdog or emergency stop had latched in an earlier run and was cleared")
        return tuple(out)

    @property
    def statistics(self) -> dict[str, float]:
        """Round trips of pings in between the blocks, share of the wire in use, and what rate it would carry."""
        out = self._round_trips.report()
        if self._link is not None:
            out |= {"wire_load_share": self._load_share, "sustainable_rate_hz": self._sustainable_hz}
        return {name: value for name, value in out.items() if math.isfinite(value)}

    @property
    def counters(self) -> dict[str, int]:
        """Samples by device flag, then what was lost, repeated or damaged on the way."""
        out = dict(self._flag_counts)
        incoming = self._incoming
        for name in ("lost_samples", "repeated_blocks", "misplaced_blocks"):
            out[name] = getattr(incoming, name) if incoming else 0
        out["dropped_by_device"] = incoming.dropped if incoming else 0
        if self._link is not None:
            out |= {"retries": self._dialogue.retries, "stray_answers": self._dialogue.stray_answers}
            out |= self._link.counters
        return out

    def _open(self) -> None:
        link = self._make_link()
        link.open()
        try:
            self._dialogue = Dialogue(link, self.clock)
            self._link = link
            self._found_running = self._cleared = 0
            self._find()
            negotiate(self._dialogue)
            facts = read_facts(self._dialogue)
            compare(facts, self._bench, link.name, link.layout_crc)
            self._facts = facts
            self._check_capacity(self._bench.block)
            self._round_trips = RoundTrips()
            self._ping_some()
        except BaseException:
            self._let_go()
            raise

    def _find(self) -> None:
        """Ask until something answers, and bring what a dead host has left running to rest."""
        dialogue, name = self._dialogue, self._dialogue.link.name
        for attempt in range(FIND_TRIES):
            with contextlib.suppress(DaqTimeout):
                state = dialogue.ask(Command.GET, Parameter.STATE, tries=1).value
                break
            if attempt == FIND_TRIES - 1:
                raise DaqProtocol(
                    f"{name}: nothing answers that speaks this protocol{dialogue.damage()}; "
                    "is it the right port, and the device switched on?"
                )
        if state in (DeviceState.RUNNING, DeviceState.ARMED):
            self._found_running = 1
        dialogue.do(Command.STOP)
        dialogue.forget()

    def _check_capacity(self, block: int) -> None:
        link, facts = self._link, self._facts
        assert link is not None
        assert facts is not None
        load = link.load(self._stream(block))
        self._load_share = load.share
        highest_hz = facts.rate_hz[1]
        self._sustainable_hz = min(highest_hz, MOST_LOAD * self.sample_rate_hz / load.share if load.share else math.inf)
        if load.share >= MOST_LOAD:
            raise DaqRefused(
                f"{link.name}: {self.sample_rate_hz:g} Hz in blocks of {block} would take {100.0 * load.share:.0f} % "
                f"of the wire, allowed is below {100.0 * MOST_LOAD:.0f} %: {load.sum_text}"
            )

    def _stream(self, block: int) -> Stream:
        assert self._facts is not None
        return Stream(len(self.channels), block, self.sample_rate_hz, self._facts.bits, self._options.queue_blocks)

    def _ping_some(self) -> None:
        for number in range(OPENING_PINGS):
            began = self.clock()
            self._dialogue.ask(Command.GET, Parameter.PING, number)
            self._round_trips.add(self.clock() - began)

    def _start(self) -> None:
        dialogue, facts = self._dialogue, self._facts
        assert facts is not None
        self._check_capacity(self.block)
        block_s = self.block / self.sample_rate_hz
        options = self._options
        watchdog_s = options.watchdog_s or max(0.1, 4.0 * block_s, facts.watchdog_s[0])
        if watchdog_s < SHORTEST_WATCHDOG_BLOCKS * block_s:
            raise DaqRefused(
                f"driver.options.watchdog_s = {watchdog_s:g}: allowed is from {SHORTEST_WATCHDOG_BLOCKS * block_s:g} s on, "
                f"{SHORTEST_WATCHDOG_BLOCKS} blocks of {self.block} samples"
            )
        if dialogue.get(Parameter.STATE) == DeviceState.LATCHED:
            dialogue.do(Command.CLEAR)
            self._cleared = 1
        self._set(Parameter.RATE_MHZ, round(1e3 * self.sample_rate_hz), "sample_rate_hz", 1e-3, "Hz")
        self._set(Parameter.BLOCK, self.block, "block", 1, "samples")
        self._set(Parameter.QUEUE, options.queue_blocks, "driver.options.queue_blocks", 1, "blocks")
        self._set(Parameter.WATCHDOG_US, round(1e6 * watchdog_s), "driver.options.watchdog_s", 1e-6, "s")
        self._set(Parameter.RAMP_US, round(1e6 * options.ramp_s), "driver.options.ramp_s", 1e-6, "s")
        dialogue.link.configure(self._stream(self.block))
        timeout_s = options.timeout_s or max(0.25, 10.0 * block_s)
        dialogue.early.clear()
        longest_gap = math.ceil((watchdog_s + timeout_s) * self.sample_rate_hz) + self.block
        self._incoming = Incoming(dialogue, (self.block, len(self.channels)), longest_gap, timeout_s, facts.boot)
        self._incoming.on_answer = self._take_answer
        self._flag_counts = dict.fromkeys(self._flag_counts, 0)
        self._counts_per_v = 1.0 / facts.output_v_per_count
        largest = 2.0 ** (facts.bits - 1)
        self._lowest_count, self._highest_count = -largest, largest - 1.0
        self._dtype = np.dtype(f"<i{facts.bits // 8}")
        self._scaled = np.empty(self.block)
        self._v_per_count = facts.v_per_count.copy()
        self._due = options.queue_blocks * self.block
        self._blocks_out = 0
        self._blocks_between_pings = max(1, round(self.sample_rate_hz / self.block / PINGS_PER_S))
        self._ping: tuple[int, float] | None = None
        self._sampling = False

    def _set(self, parameter: Parameter, value: int, key: str, scale: float, unit: str) -> None:
        answer = self._dialogue.ask(Command.SET, parameter, value=value)
        if answer.status != 0 or answer.value != value:
            raise DaqMismatch(
                f"{self._dialogue.link.name}: {key} = {value * scale:g} {unit}: not what the device can do, "
                f"the nearest is {answer.value * scale:g} {unit}"
            )

    def _begin(self) -> None:
        self._dialogue.forget()
        self._dialogue.do(Command.START)
        self._dialogue.do(Command.ARM, value=ARM_KEY)
        self._sampling = True

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        if not self._sampling:
            self._begin()
        incoming = self._incoming
        assert incoming is not None
        scaled = self._scaled
        np.multiply(voltages, self._counts_per_v, out=scaled)
        np.rint(scaled, out=scaled)
        np.clip(scaled, self._lowest_count, self._highest_count, out=scaled)
        link = self._dialogue.link
        link.send(Output(self._due, scaled.astype(self._dtype), self._blocks_out & 0xFFFF))
        self._due += self.block
        self._blocks_out += 1
        if self._blocks_out % self._blocks_between_pings == 0 and self._ping is None:
            request = self._dialogue.next_request(Command.GET, Parameter.PING, self._blocks_out & 0xFF)
            self._ping = request.number, self.clock()
            link.send(request)
        samples = incoming.take()
        if samples is None:
            inputs.fill(np.nan)
            self.flags.fill(LOST)
            return
        np.multiply(samples.counts, self._v_per_count, out=inputs)
        self.flags.fill(samples.flags)
        if samples.flags:
            for flag in DeviceFlag:
                if samples.flags & flag:
                    self._flag_counts[str(flag.name).lower()] += self.block

    def _take_answer(self, answer: Answer) -> None:
        if self._ping is not None and answer.number == self._ping[0]:
            self._round_trips.add(self.clock() - self._ping[1])
            self._ping = None
        else:
            self._dialogue.note_stray(answer)

    def emergency_stop(self, reason: int = 0) -> None:
        """Have the device drop its output to 0 V and latch; said three times, for nobody acknowledges it."""
        if self._link is not None:
            for _ in range(3):
                self._link.send(EmergencyStop(reason))

    def _stop(self) -> None:
        self._sampling = False
        self._dialogue.do(Command.STOP)
        self._dialogue.early.clear()

    def _close(self) -> None:
        if self._link is not None:
            with contextlib.suppress(DaqError):
                self._link.send(self._dialogue.next_request(Command.STOP))
        self._let_go()

    def _let_go(self) -> None:
        if self._link is not None:
            with contextlib.suppress(DaqError):
                self._link.close()
