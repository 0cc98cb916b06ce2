"""`NiDaqmxDAQ`: devices of NI behind the DAQ contract, through NI-DAQmx."""

import math
from contextlib import suppress

import numpy as np

from rig.bench import Bench
from rig.bench.configuration import validated
from rig.continuation import longest_period, period_steps, ramp_length
from rig.daq import CONTINUED as OUTPUT_CONTINUED, DAQ, HELD as OUTPUT_HELD, Adjustable, Capabilities
from rig.drivers.nidaqmx.buffer import HELD, BufferThread, Plan
from rig.drivers.nidaqmx.devices import NiDevice, devices_of
from rig.drivers.nidaqmx.library import Session
from rig.drivers.nidaqmx.options import NiDaqmxOptions
from rig.drivers.nidaqmx.tasks import SAME_RATE, Facts, Setting, Tasks, put_zero
from rig.drivers.nidaqmx.watchdog import DeviceWatchdog
from rig.drivers.wire.options import LARGEST_QUEUE, check_inputs, watchdog_range_s, watchdog_s
from rig.errors import DaqDisconnected, DaqMismatch

LARGEST_BLOCK = 65536
"""Largest block, samples; chosen: more than a bench may have."""
BUFFER_S, BUFFER_BLOCKS = 0.01, 2
"""Default of what lies ahead in the device's buffer, s and blocks, the longer of the two; chosen: twice the 5 ms for which
Python may keep a thread waiting."""
TIMEOUT_S, TIMEOUT_BLOCKS = 0.5, 10
"""Default wait for a block, s and blocks, the longer of the two."""
HOLD_SAMPLES = 0.5
"""A held output is half a sample late on average."""
SMALLEST_SKEW = 0.01
"""Difference of two inputs' delays, samples, from which on the bench has to name it; chosen: 1 degree at 1/4 of the rate."""
NEAR_FULL = 1.0 - 2.0**-15
"""Part of an input's range from which on a reading is an overload: all but the last step of 16 bits."""
FLAGS = {OUTPUT_HELD: 1, OUTPUT_CONTINUED: 2, "overload": 4}
"""Names of the flags, and their bits."""


class NiDaqmxDAQ(DAQ):
    """An output and inputs of NI devices on one sample clock, through NI-DAQmx or an NI gRPC Device Server.

    Options: `rig.drivers.nidaqmx.options.NiDaqmxOptions`. Sampling begins with the first `exchange`. A thread that does not
    wait for the loop keeps the output's buffer filled (`rig.drivers.nidaqmx.buffer`); what lies in it is part of the queue.
    Not handled: devices that need more than one task of inputs.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self._bench = bench
        self._given = self._options = validated(NiDaqmxOptions, bench.driver.options, "driver.options")
        inputs = self._options.inputs
        check_inputs(inputs, bench)
        self._session: Session | None = None
        self._devices: list[NiDevice] = []
        self._facts: Facts | None = None
        self._tasks: Tasks | None = None
        self._buffer: BufferThread | None = None
        self._watchdog: DeviceWatchdog | None = None
        self._about_watchdog, self._was_expired = "not used", False
        self._version = ""
        self._counted = dict.fromkeys(FLAGS, 0)

    # What the device is

    @property
    def capabilities(self) -> Capabilities:
        """Virtual where NI's driver simulates all devices. What the output does without the host is the device's own."""
        return Capabilities(
            largest_block=LARGEST_BLOCK,
            paced=not self._options.lockstep,
            virtual=bool(self._devices) and all(device.is_simulated for device in self._devices),
            repeatable=self._options.lockstep,
            safe_without_host=False,
        )

    @property
    def latency_samples(self) -> float:
        """Queue, half a sample of hold, and the filters of both converters."""
        return self.queue_samples + HOLD_SAMPLES + self.filter_delay_samples

    @property
    def filter_delay_samples(self) -> float:
        """Delay of the filters of output and first input, as NI's driver tells them."""
        facts = self._facts
        return (facts.output_delay_s + facts.input_delays_s[0]) * self.sample_rate_hz if facts else 0.0

    @property
    def queue_samples(self) -> int:
        """Queue of the loop, and what lies ahead in the device's buffer."""
        block = self.block or self._bench.block
        return (self._options.queue + self._ahead(block)) * block

    def _ahead(self, block: int) -> int:
        """Blocks that lie ahead in the device's buffer: in blocks of another size as much time as in those of the bench."""
        given = self._options.buffer_blocks
        if given:
            return max(BUFFER_BLOCKS, math.ceil(given * self._bench.block / block))
        return max(BUFFER_BLOCKS, math.ceil(BUFFER_S * self.sample_rate_hz / block))

    @property
    def identity(self) -> dict[str, str]:
        """Devices with serial numbers, version of NI's driver, terminals of clock and trigger, delays."""
        facts = self._facts
        if facts is None:
            return {}
        return {
            "port": self._options.server or "NI-DAQmx",
            "model": ", ".join(f"{device.name}: {device.model}" for device in self._devices),
            "serial_number": ", ".join(f"{device.name}: {device.serial_number}" for device in self._devices),
            "simulated": "yes" if self.capabilities.virtual else "no",
            "driver_version": self._version,
            "clock": facts.clock,
            "start_trigger": facts.start,
            "input_delay_s": f"{facts.input_delays_s[0]:.3g}",
            "output_delay_s": f"{facts.output_delay_s:.3g}",
            "buffer_blocks": str(self._ahead(self.block or self._bench.block)),
            "device_watchdog": self._about_watchdog,
        }

    @property
    def remarks(self) -> tuple[str, ...]:
        """Inputs that come later than the first one, where the bench does not say so; a watchdog that had expired."""
        facts = self._facts
        if facts is None:
            return ()
        out = ["the device's watchdog had expired in an earlier run and was cleared"] if self._was_expired else []
        for channel, delay_s in zip(self.channels, facts.input_delays_s, strict=True):
            later = (delay_s - facts.input_delays_s[0]) * self.sample_rate_hz
            if abs(later - channel.skew_samples + self.channels[0].skew_samples) > SMALLEST_SKEW:
                out.append(
                    f"channel {channel.name!r} comes {later:.3g} samples after {self.channels[0].name!r} by its filter; "
                    f"skew_samples says {channel.skew_samples:g}"
                )
        return tuple(out)

    @property
    def adjustable(self) -> Adjustable | None:
        """Queue and watchdog."""
        if self._facts is None:
            return None
        return Adjustable(
            watchdog_s=self._watchdog_s,
            largest_queue=LARGEST_QUEUE,
            watchdog_range_s=watchdog_range_s((0.0, math.inf), self._bench.block / self.sample_rate_hz),
            rate_range_hz=(self.sample_rate_hz, self.sample_rate_hz),
            wire_share={self._bench.block: 0.0},
            largest_wire_share=1.0,
            automatic=self._given.queue_blocks == "auto",
            longest_period=0 if self._options.lockstep else longest_period(self.sample_rate_hz),
            buffered_blocks=self._ahead(self._bench.block),
        )

    def adjust(self, queue_blocks: int, watchdog_s: float | None = None) -> None:
        """Take another queue, and the watchdog given or that of the bench, from the next start on."""
        chosen = {"queue_blocks": queue_blocks, "watchdog_s": watchdog_s or self._given.watchdog_s}
        self._options = self._given.model_copy(update=chosen)

    @property
    def counters(self) -> dict[str, int]:
        """Samples by flag."""
        return dict(self._counted)

    @property
    def _watchdog_s(self) -> float:
        block_s = self._bench.block / self.sample_rate_hz
        return watchdog_s(self._options, 0.0, block_s, moves=not self.capabilities.virtual)

    # What it does

    def _open(self) -> None:
        self._session = session = Session(self._options.server)
        try:
            self._find()
            if self._options.device_watchdog:
                watchdog = DeviceWatchdog(session, self._options.output, self._watchdog_s)
                watchdog.close()
                self._about_watchdog, self._was_expired = watchdog.about, watchdog.was_expired
            put_zero(session, self._options.output, self.output_range_v)
            tasks = self._make_tasks(self._bench.block)
            self._facts = facts = tasks.facts
            tasks.close()
            self._check_rate(facts)
        except BaseException:
            self._close()
            raise

    def _find(self) -> None:
        """Find the devices of the channels, and refuse what they cannot do."""
        options, session = self._options, self._session
        assert session is not None
        self._version, found = devices_of(session)
        by_name = {device.name: device for device in found}
        self._devices = []
        for field, names, ranges_v in (
            ("output", (options.output,), (self.output_range_v,)),
            ("inputs", options.inputs, tuple(channel.range_v for channel in self.channels)),
        ):
            for name, range_v in zip(names, ranges_v, strict=True):
                device = by_name.get(name.partition("/")[0])
                key = f"driver.options.{field}"
                if device is None:
                    has = ", ".join(device.name for device in found if device.inputs or device.outputs)
                    raise DaqDisconnected(
                        "there is no such device",
                        field=key,
                        value=name,
                        allowed=has or "none is connected",
                        hint="is it switched on, and reserved for this computer?",
                    )
                channels = device.outputs if field == "output" else device.inputs
                if name not in channels:
                    raise DaqMismatch(
                        f"{device.model} has no such channel",
                        field=key,
                        value=name,
                        allowed=", ".join(channels) or f"none of the {field} that it has",
                    )
                largest_v = device.output_v if field == "output" else device.input_v
                if largest_v and range_v > largest_v:
                    where = "" if field == "output" else f"channel {self.channels[names.index(name)].name!r}"
                    raise DaqMismatch(
                        where=where,
                        field="output_range_v" if field == "output" else "range_v",
                        value=range_v,
                        allowed=f"up to {largest_v:g} V, the range of {name} ({device.model})",
                    )
                if device not in self._devices:
                    self._devices.append(device)

    def _check_rate(self, facts: Facts) -> None:
        asked_hz = self.sample_rate_hz
        if abs(facts.rate_hz / asked_hz - 1.0) <= SAME_RATE:
            return
        near_hz = {facts.rate_hz} | {self._coerced(asked_hz * (1.0 + share)) for share in (-0.1, -0.02, 0.02, 0.1)}
        raise DaqMismatch(
            f"the device takes {facts.rate_hz:.10g} Hz instead",
            field="sample_rate_hz",
            value=asked_hz,
            allowed=", ".join(f"{rate:.10g}" for rate in sorted(near_hz)) + " Hz, among others",
        )

    def _coerced(self, rate_hz: float) -> float:
        """Return the rate that the device takes where another one is asked for."""
        tasks = self._make_tasks(self._bench.block, rate_hz)
        tasks.close()
        return tasks.facts.rate_hz

    def _make_tasks(self, block: int, rate_hz: float | None = None) -> Tasks:
        options, session = self._options, self._session
        assert session is not None
        setting = Setting(
            options,
            rate_hz or self.sample_rate_hz,
            tuple(channel.range_v for channel in self.channels),
            self.output_range_v,
            block,
            options.queue + self._ahead(block),
        )
        return Tasks(session, setting, self._timeout_s(block))

    def _timeout_s(self, block: int) -> float:
        return self._options.timeout_s or max(TIMEOUT_S, TIMEOUT_BLOCKS * block / self.sample_rate_hz)

    def _start(self) -> None:
        options, rate_hz = self._options, self.sample_rate_hz
        assert self._session is not None
        if options.device_watchdog:
            self._watchdog = DeviceWatchdog(self._session, options.output, self._watchdog_s)
        self._tasks = self._make_tasks(self.block)
        self._facts = self._tasks.facts
        ahead = self._ahead(self.block)
        plan = Plan(
            block=self.block,
            inputs=len(self.channels),
            ahead=ahead,
            queue=options.queue + ahead,
            watchdog=round(self._watchdog_s * rate_hz),
            ramp=round(options.ramp_s * rate_hz),
            longest_period=longest_period(self.sample_rate_hz),
            output_range_v=self.output_range_v,
            timeout_s=self._timeout_s(self.block),
            rate_hz=rate_hz,
            lockstep=options.lockstep,
        )
        self._buffer = BufferThread(self._tasks, plan, self._watchdog.feed if self._watchdog else None)
        self._overload_v = NEAR_FULL * np.array(self._facts.ranges_v)[:, None]
        self._counted = dict.fromkeys(FLAGS, 0)

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        buffer = self._buffer
        assert buffer is not None
        period, ramp = self.continuation[0].item()
        buffer.hand_over(voltages, period_steps(period), ramp_length(ramp))
        self.do_meanwhile()
        block = buffer.take()
        inputs[:] = block.inputs.T
        over = np.abs(block.inputs) >= self._overload_v
        self.flags.fill(block.raised)
        if block.raised:
            self.put_out[:] = block.put_out
            self._counted[OUTPUT_HELD if block.raised == HELD else OUTPUT_CONTINUED] += self.block
        else:
            self.put_out.fill(math.nan)
        if over.any():
            rows = over.any(axis=0)
            self.flags[rows] |= FLAGS["overload"]
            self._counted["overload"] += int(rows.sum())

    def _stop(self) -> None:
        self._end()

    def _close(self) -> None:
        self._end()
        session, self._session = self._session, None
        if session is not None:
            session.close()
        self._facts, self._devices = None, []

    def _end(self) -> None:
        """Bring the output to 0 V, end the tasks, and put 0 V on the output once more without a clock."""
        buffer, self._buffer = self._buffer, None
        tasks, self._tasks = self._tasks, None
        watchdog, self._watchdog = self._watchdog, None
        if buffer is not None:
            buffer.end()
        if tasks is not None:
            tasks.close()
        if watchdog is not None:
            watchdog.close()
        if tasks is not None and self._session is not None:
            with suppress(Exception):
                put_zero(self._session, self._options.output, self.output_range_v)
