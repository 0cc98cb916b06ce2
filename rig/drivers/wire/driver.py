"""`WireDAQ`: the host's half of the wire protocol, whatever the wire."""

import math
import time
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from rig.bench import Bench
from rig.daq import DAQ, Adjustable, Capabilities
from rig.drivers.wire.connection import MOST_LOAD, Connection
from rig.drivers.wire.dialogue import latched_text
from rig.drivers.wire.facts import DeviceFacts, remarks_on
from rig.drivers.wire.options import (
    LARGEST_QUEUE,
    LoopOptions,
    WireOptions,
    raised_remark,
    watchdog_range_s,
    watchdog_s,
)
from rig.drivers.wire.remote_loop import RemoteLoop, why_no_room, why_no_rows
from rig.drivers.wire.streaming import FLAG_NAMES, Streaming
from rig.text.disorder import LATE_BLOCKS, REORDERED_BLOCKS, disorder_text
from rig.tick.layout import TickArrays
from rig.wire.link import Link
from rig.wire.messages import EmergencyStop, Stream

HOLD_SAMPLES = 0.5  # a held output is half a sample late on average
BLOCKS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # of which the load of the wire is told
COUNTED = ("lost_samples", "repeated_blocks", REORDERED_BLOCKS, LATE_BLOCKS, "misplaced_blocks", "missing_readbacks")
"""Counters of `rig.drivers.wire.incoming.Incoming`."""
LARGEST_UNKNOWN_BLOCK = 65536  # before the device has been asked


class WireDAQ(DAQ):
    """A device behind a wire. A driver for a particular wire implements `_make_link` only.

    `start` sets the device's parameters. The device begins to sample and is armed with the first call of `exchange`, so that
    no block is lost and no watchdog trips while the loop is being prepared. Call j of `exchange` hands over the outputs of
    block j + q and waits for the samples of block j.

    Errors: those of `rig.errors`, each in one line that begins with the name of the port.
    """

    clock: Callable[[], float] = staticmethod(time.perf_counter)

    def __init__(self, bench: Bench, seed: int, options: WireOptions) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self._bench = bench
        self._given = self._options = options
        self._connection: Connection | None = None
        self._streaming: Streaming | RemoteLoop | None = None

    @abstractmethod
    def _make_link(self) -> Link:
        """A link to the device, not yet open."""

    def ask(self) -> DeviceFacts:
        """Open the device, return what it says of itself, and close it; its channels need not be those of the bench."""
        connection = Connection(self._make_link(), self.clock)
        try:
            connection.link.open()
            return connection.ask()
        finally:
            connection.close()

    @property
    def _facts(self) -> DeviceFacts | None:
        return self._connection.facts if self._connection else None

    @property
    def capabilities(self) -> Capabilities:
        """Paced by the device; virtual where the device says that nothing physical moves; known once open.

        Safe without the host: a device is armed with the watchdog that it has confirmed (`Connection.set`), or not at all.
        """
        connection, facts = self._connection, self._facts
        return Capabilities(
            largest_block=min(facts.largest_block, connection.link.largest_block)
            if facts and connection
            else LARGEST_UNKNOWN_BLOCK,
            paced=True,
            virtual=facts is not None and facts.simulated,
            repeatable=facts is not None and facts.repeatable,
            safe_without_host=facts is not None,
        )

    @property
    def latency_samples(self) -> float:
        """Queue, half a sample of hold, and the delay of the converters' filters that the device tells."""
        return self._options.queue * self.block + HOLD_SAMPLES + self.filter_delay_samples

    @property
    def filter_delay_samples(self) -> float:
        """Mean delay of the converters' filters at low frequency, as the device tells it."""
        return self._facts.filter_delay_s * self.sample_rate_hz if self._facts else 0.0

    @property
    def identity(self) -> dict[str, str]:
        """Port, model, firmware and serial number."""
        if self._facts is None or self._connection is None:
            return {}
        facts = self._facts
        return {
            "port": self._connection.link.name,
            "model": facts.model,
            "firmware": facts.firmware,
            "serial_number": facts.serial_number,
            "boot": f"{facts.boot:08x}",
            "simulated": "yes" if facts.simulated else "no",
            "protocol": str(facts.version),
            "longest_period": str(facts.longest_period),
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """Where the device differs from the bench, and in what state it was found."""
        connection = self._connection
        if connection is None or connection.facts is None:
            return ()
        out = remarks_on(connection.facts, self._bench)
        raised = raised_remark(self._options, connection.facts, self._bench.block / self._bench.sample_rate_hz)
        out += [raised] if raised else []
        if connection.lacks_room:
            out.append(
                "the wire has no room for version 2 of the protocol: outputs that come too late are held, not continued; "
                "ask for larger blocks"
            )
        if connection.found_running:
            out.append("the device was still running from an earlier run and was stopped first")
        if connection.cleared:
            out.append(f"{latched_text(connection.cleared)} in an earlier run and was cleared")
        disorder = disorder_text(self.counters)
        return (*out, disorder) if disorder else tuple(out)

    @property
    def latched(self) -> str:
        """Watchdog or emergency stop, as found when the device was opened; they stay latched until `clear`."""
        return latched_text(self._connection.latched) if self._connection else ""

    def clear(self) -> None:
        """Clear what was latched when the device was opened; what has latched since is an error."""
        if self._connection is not None:
            self._connection.clear()

    @property
    def adjustable(self) -> Adjustable | None:
        """Queue, watchdog and rates that driver and device allow, and the load of the wire by blocks of several sizes."""
        connection, facts, bench = self._connection, self._facts, self._bench
        if connection is None or facts is None:
            return None
        block_s = bench.block / bench.sample_rate_hz
        largest = self.capabilities.largest_block
        queue = self._options.queue
        shares = {}
        for block in sorted({bench.block, *(size for size in BLOCKS if size <= largest)}):
            stream = Stream(len(bench.channels), block, bench.sample_rate_hz, facts.bits, queue)
            shares[block] = connection.link.load(stream).share
        return Adjustable(
            watchdog_s=watchdog_s(self._options, facts.watchdog_s[0], block_s, moves=not facts.simulated),
            largest_queue=min(LARGEST_QUEUE, facts.largest_queue),
            watchdog_range_s=watchdog_range_s(facts.watchdog_s, block_s),
            rate_range_hz=facts.rate_hz,
            wire_share=shares,
            largest_wire_share=MOST_LOAD,
            automatic=self._given.queue_blocks == "auto",
            longest_period=facts.longest_period,
        )

    def adjust(self, queue_blocks: int, watchdog_s: float | None = None) -> None:
        """Take another queue, and the watchdog given or that of the bench, from the next start on."""
        chosen = {"queue_blocks": queue_blocks, "watchdog_s": watchdog_s or self._given.watchdog_s}
        self._options = self._given.model_copy(update=chosen)

    @property
    def statistics(self) -> dict[str, float]:
        """Round trips of pings, load of the wire, and the highest sample rate that the wire would carry."""
        connection = self._connection
        if connection is None:
            return {}
        out = connection.round_trips.report()
        out |= {"wire_load_share": connection.load_share, "wire_needed_bit_s": connection.needed_bit_s}
        out["sustainable_rate_hz"] = connection.sustainable_hz
        return {name: value for name, value in out.items() if math.isfinite(value)}

    @property
    def counters(self) -> dict[str, int]:
        """Samples by device flag, then what was lost, repeated or damaged on the way."""
        streaming, connection = self._streaming, self._connection
        out = dict(streaming.flag_counts) if streaming else dict.fromkeys(FLAG_NAMES, 0)
        for name in COUNTED:
            out[name] = getattr(streaming.incoming, name) if streaming else 0
        out["dropped_by_device"] = streaming.incoming.dropped if streaming else 0
        if connection is not None:
            out |= {"retries": connection.dialogue.retries, "stray_answers": connection.dialogue.stray_answers}
            out |= connection.link.counters
        return out

    def _open(self) -> None:
        connection = Connection(self._make_link(), self.clock)
        try:
            connection.link.open()
            self._connection, self._streaming = connection, None
            connection.meet(self._bench, self._options.queue, self.loop)
        except BaseException:
            connection.let_go()  # also a port whose adapter did not answer
            raise

    def _start(self) -> None:
        connection, facts = self._connection, self._facts
        assert connection is not None
        assert facts is not None
        queue = self._options.queue
        stream = Stream(len(self.channels), self.block, self.sample_rate_hz, facts.bits, queue)
        self._streaming = Streaming(connection, stream, self._options)

    @property
    def loop(self) -> Literal["computer", "device", "auto"]:
        """Where the bench wants the loop to run."""
        return self._given.loop if isinstance(self._given, LoopOptions) else "computer"

    def why_no_rows(self, block: int) -> str:
        """Why the wire of the open device does not carry the rows of a loop on it in blocks of this size, with the sum."""
        assert self._connection is not None
        return why_no_rows(self._connection, len(self.channels), self.sample_rate_hz, block)

    def why_no_room(self, sizes: Mapping[str, int]) -> str:
        """Why the open device does not hold records of these sizes (bytes, by name), with the sum; empty if it does."""
        assert self._connection is not None
        return why_no_room(self._connection, sizes)

    @property
    def loop_digest(self) -> str:
        """Digest of the loop that the open device was built with; empty if it has none."""
        return self._facts.loop_digest if self._facts else ""

    @property
    def loop_latency_samples(self) -> float:
        """Delay from an output to its effect where the device runs the loop: half a sample of hold, and the filters."""
        return HOLD_SAMPLES + self.filter_delay_samples

    def load_loop(self, arrays: TickArrays, block: int) -> RemoteLoop:
        """Bring the records of a run to the open device; ``block``: most rows that it sends at a time. Raises `DaqError`."""
        assert self._connection is not None
        loop = RemoteLoop(self._connection, self.sample_rate_hz, block, self._options, arrays)
        self._streaming = loop
        return loop

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        assert isinstance(self._streaming, Streaming)
        self._streaming.exchange(voltages, self.continuation, inputs, self.flags, self.put_out, self.do_meanwhile)

    def emergency_stop(self, reason: int = 0) -> None:
        """Make the device drop its output to 0 V and latch. Sent three times, because it is not acknowledged."""
        if self._connection is not None:
            for _ in range(3):
                self._connection.link.send(EmergencyStop(reason))

    def _stop(self) -> None:
        assert self._streaming is not None
        self._streaming.stop()

    def _close(self) -> None:
        if self._connection is not None:
            self._connection.close()
