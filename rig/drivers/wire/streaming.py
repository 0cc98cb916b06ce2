"""One run over a wire: the parameters are set, then outputs go out and blocks come in, with pings in between."""

import math
from collections import deque
from collections.abc import Callable

import numpy as np

from rig.continuation import period_steps, ramp_length
from rig.daq import LOST
from rig.drivers.wire.connection import Connection
from rig.drivers.wire.dialogue import ANSWER_S
from rig.drivers.wire.incoming import Incoming
from rig.drivers.wire.options import WireOptions, watchdog_s
from rig.wire.messages import ARM_KEY, LOWEST_VERSION, Answer, Command, DeviceFlag, Output, Parameter, Stream

PINGS_PER_S = 20.0  # pings per second while streaming; chosen: little beside the stream
WAITED = 0.5  # of the time that the queue leaves once the next block has come, for one that this has overtaken
FLAG_NAMES = tuple(str(flag.name).lower() for flag in DeviceFlag)


def set_up(connection: Connection, stream: Stream, wait_s: float, ramp_s: float) -> None:
    """Set what a run needs: rate, block, queue, watchdog and its ramp."""
    put = connection.set
    put(Parameter.RATE_MHZ, round(1e3 * stream.rate_hz), "sample_rate_hz", 1e-3, "Hz")
    put(Parameter.BLOCK, stream.block, "block", 1, "samples")
    put(Parameter.QUEUE, stream.queue, "driver.options.queue_blocks", 1, "blocks")
    put(Parameter.WATCHDOG_US, round(1e6 * wait_s), "driver.options.watchdog_s", 1e-6, "s")
    put(Parameter.RAMP_US, round(1e6 * ramp_s), "driver.options.ramp_s", 1e-6, "s")
    connection.link.configure(stream)


class Streaming:
    """Outputs to the device and samples from it during one run.

    The device begins to sample, and is armed, with the first call of `exchange`.
    """

    def __init__(self, connection: Connection, stream: Stream, options: WireOptions) -> None:
        self._connection, self._dialogue, self._link = connection, connection.dialogue, connection.link
        self._block, self._began = stream.block, False
        facts = connection.facts
        assert facts is not None
        connection.check_capacity(stream)
        block_s = stream.block / stream.rate_hz
        wait_s = watchdog_s(options, facts.watchdog_s[0], block_s, moves=not facts.simulated)
        connection.check_latch()
        self._watchdog_s = wait_s
        set_up(connection, stream, wait_s, options.ramp_s)
        timeout_s = options.timeout_s or max(0.25, 10.0 * block_s)
        self._dialogue.early.clear()
        longest_gap = math.ceil((wait_s + timeout_s) * stream.rate_hz) + stream.block
        shape = stream.block, stream.n_channels
        patience_s = block_s * (1.0 if facts.repeatable else min(1.0, WAITED * (stream.queue - 1)))
        self.incoming = Incoming(self._dialogue, shape, longest_gap, timeout_s, facts.boot, patience_s)
        self.incoming.on_answer = self._take_answer
        self.flag_counts = dict.fromkeys(FLAG_NAMES, 0)
        """Samples by device flag."""
        self._counts_per_v = np.full(stream.block, 1.0 / facts.output_v_per_count)
        self._v_per_count, self._output_v_per_count = facts.v_per_count.copy(), facts.output_v_per_count
        beyond = 2.0 ** (facts.bits - 1)
        self._lowest, self._highest = np.full(stream.block, -beyond), np.full(stream.block, beyond - 1.0)
        self._dtype = np.dtype(f"<i{facts.bits // 8}")
        self._scaled = np.empty(stream.block)
        self._due = stream.queue * stream.block
        self._has_periods = connection.link.version > LOWEST_VERSION
        nothing = np.zeros(stream.block, int)  # before the first outputs are due
        self._sent = deque([nothing] * (stream.queue + 1), stream.queue + 1)
        """Counts of the blocks that are on their way, the one due first in front."""
        self._has_put_out = False
        self._blocks_out = 0
        self._blocks_between_pings = max(1, round(1.0 / block_s / PINGS_PER_S))
        self._ping: tuple[int, float] | None = None

    def _begin(self) -> None:
        self._dialogue.forget()
        self._dialogue.do(Command.START)
        # The watchdog runs from the first ARM on. If its answer is lost, there must be time for a second ARM and an output.
        self._dialogue.do(Command.ARM, value=ARM_KEY, answer_s=min(ANSWER_S, 0.5 * self._watchdog_s))
        self._dialogue.forget_beats()  # those sent before the device was armed
        self._began = True

    def exchange(
        self,
        voltages: np.ndarray,
        continuation: np.ndarray,
        inputs: np.ndarray,
        flags: np.ndarray,
        put_out: np.ndarray,
        meanwhile: Callable[[], None],
    ) -> None:
        """Send a block of outputs [n], and how they go on (`rig.daq.CONTINUATION`); do other work ``meanwhile``.

        Fills ``inputs`` [n, n_channels], ``flags`` [n] and ``put_out`` [n] with the block received.
        """
        if not self._began:
            self._begin()
        link, counts = self._link, self._to_counts(voltages)
        goes_on = (0, 0)
        if self._has_periods:
            period_samples, ramp_samples = continuation[0].item()
            goes_on = period_steps(period_samples), ramp_length(ramp_samples)
        link.send(Output(self._due, counts, self._blocks_out & 0xFFFF, *goes_on))
        self._sent.append(counts)
        self._due += self._block
        self._blocks_out += 1
        if self._blocks_out % self._blocks_between_pings == 0:  # the answer to the last one may have been lost
            request = self._dialogue.next_request(Command.GET, Parameter.PING, self._blocks_out & 0xFF)
            self._ping = request.number, self._connection.clock()
            link.send(request)
        if self._has_put_out:
            put_out.fill(np.nan)
            self._has_put_out = False
        meanwhile()
        samples = self.incoming.take()
        if samples is None:
            inputs.fill(np.nan)
            flags.fill(LOST)
            return
        np.multiply(samples.counts, self._v_per_count, out=inputs)
        flags.fill(samples.flags)
        if self.incoming.put_out is not None:
            np.multiply(self.incoming.put_out, self._output_v_per_count, out=put_out)
            put_out[self.incoming.put_out == self._sent[0]] = np.nan  # only what was put out in place of what was sent
            self._has_put_out = True
        if samples.flags:
            for bit, name in enumerate(FLAG_NAMES):
                if samples.flags & (1 << bit):
                    self.flag_counts[name] += self._block

    def _to_counts(self, voltages: np.ndarray) -> np.ndarray:
        """The nearest counts [n] of the output converter."""
        scaled = self._scaled
        np.multiply(voltages, self._counts_per_v, out=scaled)
        np.rint(scaled, out=scaled)
        np.maximum(scaled, self._lowest, out=scaled)  # both in a third of the time of np.clip
        np.minimum(scaled, self._highest, out=scaled)
        return scaled.astype(self._dtype)

    def _take_answer(self, answer: Answer) -> None:
        if self._ping is not None and answer.number == self._ping[0]:
            self._connection.round_trips.add(self._connection.clock() - self._ping[1])
            self._ping = None
        else:
            self._dialogue.note_stray(answer)

    def stop(self) -> None:
        """Stop the device: 0 V, no more samples."""
        self._dialogue.do(Command.STOP)
        self._dialogue.early.clear()
