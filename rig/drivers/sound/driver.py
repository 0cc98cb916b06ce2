"""`SoundDAQ`: any two-way sound device behind the DAQ contract."""

import math

import numpy as np

from rig.bench import Bench
from rig.bench.configuration import validated
from rig.continuation import longest_period, period_steps, ramp_length
from rig.daq import CONTINUED as OUTPUT_CONTINUED, DAQ, HELD as OUTPUT_HELD, LOST, Adjustable, Capabilities
from rig.drivers.sound.callback import CONTINUED, FULL_SCALE, HELD, LOST_FRAME, OVERLOAD
from rig.drivers.sound.devices import SoundDevice, found, supported_rates
from rig.drivers.sound.loopback import FRAMES, measured_delay
from rig.drivers.sound.options import SoundOptions
from rig.drivers.sound.rates import PASS_BAND, Decimator, Interpolator, chosen_rate, factor_of, low_pass
from rig.drivers.sound.stream import DuplexStream, Setting, counts_of
from rig.drivers.wire.options import LARGEST_QUEUE, check_inputs, watchdog_range_s, watchdog_s
from rig.errors import DaqMismatch, DaqRefused
from vibrolock.arrays import Float

LARGEST_BLOCK = 65536
"""Largest block, samples; chosen: more than a bench may have."""
TIMEOUT_S, TIMEOUT_BLOCKS = 0.5, 10
"""Default wait for frames, s and blocks, the longer of the two."""
TEST_SIGNAL = 0.01
"""Amplitude of the loopback's test signal, of the bench's largest output."""
FLAGS = {OUTPUT_HELD: HELD, OUTPUT_CONTINUED: CONTINUED, "overload": OVERLOAD}
"""Names of the flags, and their bits."""


class SoundDAQ(DAQ):
    """A sound device with one output and several inputs, through PortAudio.

    Options: `rig.drivers.sound.options.SoundOptions`. The device runs at its own rate. Where that is a multiple of the bench's,
    outputs are interpolated and inputs decimated by linear-phase filters. Outputs that come too late are continued by period
    (`rig.continuation`); where the audio system itself was late, inputs are lost rows, and outputs what it has put out.

    The delay of a stream changes at every start. It is measured at each start through a channel with ``loopback = true``, and
    otherwise taken from the stream's own time stamps. Not modelled: the high-pass of the output.
    """

    def __init__(self, bench: Bench, seed: int = 0) -> None:
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        self._bench = bench
        self._given = self._options = validated(SoundOptions, bench.driver.options, "driver.options")
        inputs = self._options.inputs or tuple(range(1, len(bench.channels) + 1))
        check_inputs(inputs, bench)
        self._inputs = inputs
        self._device: SoundDevice | None = None
        self._rate_hz, self._factor = bench.sample_rate_hz, 1
        self._stream: DuplexStream | None = None
        self._delay_frames = 0.0
        self._loopback = next((at for at, channel in enumerate(bench.channels) if channel.loopback), None)
        self._interpolate, self._decimate = Interpolator(1), Decimator(1, 1)
        self._due = 0
        self._counted = dict.fromkeys((*FLAGS, "lost_samples"), 0)

    # What the device is

    @property
    def capabilities(self) -> Capabilities:
        """Paced, and not safe without the host: the audio system decides what it puts out when that is killed."""
        return Capabilities(
            largest_block=LARGEST_BLOCK, paced=True, virtual=False, repeatable=False, safe_without_host=False
        )

    @property
    def latency_samples(self) -> float:
        """Queue, both filters, and the delay of the stream: before the start two periods, or what the device promises."""
        return self._queue * self.block + self._filters + self._delay_frames / self._factor

    @property
    def filter_delay_samples(self) -> float:
        """Delay of the decimation, and of the stream behind the output."""
        return self._filters / 2 + self._delay_frames / self._factor

    @property
    def queue_samples(self) -> int:
        """Queue and interpolation."""
        return self._queue * self.block + self._filters // 2

    @property
    def _queue(self) -> int:
        """Blocks of the queue: those set; with ``"auto"`` outputs are there at least a period before they are due."""
        if self._given.queue_blocks != "auto":
            return self._options.queue
        return max(self._options.queue, 2 * self._blocks_of_a_period - 1)

    @property
    def _blocks_of_a_period(self) -> int:
        """Blocks that the audio system exchanges at once."""
        return math.ceil(self._options.period_frames / ((self.block or self._bench.block) * self._factor))

    @property
    def _filters(self) -> int:
        """Delay of both filters, samples."""
        return 2 * low_pass(self._factor).delay

    @property
    def identity(self) -> dict[str, str]:
        """Device, host interface, rates, where the latency comes from, and the longest period that is continued, samples."""
        if self._device is None:
            return {}
        return {
            "port": self._device.text,
            "model": self._device.name,
            "host_api": self._device.host_api,
            "device_rate_hz": f"{self._rate_hz:g}",
            "latency_from": "time stamps"
            if self._loopback is None
            else f"loopback channel {self.channels[self._loopback].name}",
            "longest_period": f"{longest_period(self._rate_hz) // self._factor}",
        }

    @property
    def statistics(self) -> dict[str, float]:
        """Delay of the stream from output to input at this start."""
        return {"stream_delay_frames": self._delay_frames}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know of the latency."""
        if self._loopback is not None:
            return ()
        return (
            "the latency comes from the device's time stamps, which many drivers get wrong by a period: connect the output to "
            "a free input and give the bench a channel with loopback = true",
        )

    @property
    def adjustable(self) -> Adjustable | None:
        """Queue and watchdog."""
        if self._device is None:
            return None
        block_s = self._bench.block / self.sample_rate_hz
        return Adjustable(
            watchdog_s=self._watchdog_s,
            largest_queue=LARGEST_QUEUE,
            watchdog_range_s=watchdog_range_s((0.0, math.inf), block_s),
            rate_range_hz=(self.sample_rate_hz, self.sample_rate_hz),
            wire_share={self._bench.block: 0.0},
            largest_wire_share=1.0,
            automatic=self._given.queue_blocks == "auto",
            longest_period=longest_period(self._rate_hz) // self._factor,
        )

    def adjust(self, queue_blocks: int, watchdog_s: float | None = None) -> None:
        """Take another queue, and the watchdog given or that of the bench, from the next start on."""
        chosen = {"queue_blocks": queue_blocks, "watchdog_s": watchdog_s or self._given.watchdog_s}
        self._options = self._given.model_copy(update=chosen)

    @property
    def counters(self) -> dict[str, int]:
        """Samples by flag, lost samples, and interruptions by the audio system."""
        return {**self._counted, "interruptions": self._stream.interruptions if self._stream else 0}

    @property
    def _watchdog_s(self) -> float:
        return watchdog_s(self._options, 0.0, self._bench.block / self.sample_rate_hz, moves=True)

    # What it does

    def _open(self) -> None:
        options, bench = self._options, self._bench
        device = found(options.device, options.host_api)
        for kind, needed, has in (
            ("output", options.output, device.outputs),
            ("input", max(self._inputs), device.inputs),
        ):
            if needed > has:
                raise DaqMismatch(
                    f"{device.text} has {has} {kind}{'' if has == 1 else 's'}",
                    field="driver.options.output" if kind == "output" else "driver.options.inputs",
                    value=needed,
                    allowed=f"1 to {has}" if has > 1 else "1" if has else "another device",
                )
        rates = supported_rates(device, max(self._inputs), options.output)
        self._rate_hz = chosen_rate(bench.sample_rate_hz, rates, options.device_rate_hz, device.text)
        self._factor = factor_of(self._rate_hz, bench.sample_rate_hz)
        highest_hz = bench.limits.frequency_hz[1]
        if self._factor > 1 and highest_hz > PASS_BAND * bench.sample_rate_hz:
            raise DaqRefused(
                "the filters between the device's rate and the bench's pass no more",
                field="limits.frequency_hz",
                value=highest_hz,
                allowed=f"up to {PASS_BAND * bench.sample_rate_hz:g} Hz, or sample_rate_hz = {self._rate_hz:g}",
            )
        self._check_scales(device)
        self._delay_frames = max(2.0 * options.period_frames, device.delay_s * self._rate_hz)
        self._device = device

    def _check_scales(self, device: SoundDevice) -> None:
        """Refuse a bench whose volts are not known, or are beyond what the device can do."""
        options = self._options
        for field in ("output_full_scale_v", "input_full_scale_v"):
            if getattr(options, field) is None:
                raise DaqRefused(
                    f"is missing, and without it nothing is armed: {device.text} does not know its own volts",
                    field=f"driver.options.{field}",
                    allowed="the peak voltage at full scale, V, measured with a multimeter",
                )
        output_v, inputs_v = options.output_full_scale_v or 0.0, self._input_full_scales_v
        if self.output_range_v > output_v:
            raise DaqMismatch(
                field="output_range_v",
                value=self.output_range_v,
                allowed=f"up to {output_v:g} V, the device's full scale",
            )
        for channel, full_scale_v in zip(self.channels, inputs_v, strict=True):
            if channel.range_v > full_scale_v:
                raise DaqMismatch(
                    where=f"channel {channel.name!r}",
                    field="range_v",
                    value=channel.range_v,
                    allowed=f"up to {full_scale_v:g} V, the input's full scale",
                )

    @property
    def _input_full_scales_v(self) -> Float:
        given = self._options.input_full_scale_v
        if isinstance(given, tuple) and len(given) != len(self.channels):
            raise DaqRefused(
                field="driver.options.input_full_scale_v",
                value=list(given),
                allowed=f"one number, or {len(self.channels)} of them",
            )
        return np.broadcast_to(np.asarray(given, float), len(self.channels))

    def _start(self) -> None:
        self._device = found(self._options.device, self._options.host_api)  # PortAudio was let go with the last stream
        options, factor = self._options, self._factor
        block, block_s = self.block * factor, self.block / self.sample_rate_hz
        needed = self._blocks_of_a_period - 1
        if self._queue < needed:
            raise DaqRefused(
                f"a period of the audio system, {options.period_frames} frames, lasts longer than the queue",
                field="driver.options.queue_blocks",
                value=options.queue,
                allowed='"auto"' + (f", or from {needed} on" if needed <= LARGEST_QUEUE else ""),
            )
        setting = Setting(
            self._device,
            self._rate_hz,
            options.period_frames,
            self._inputs,
            options.output,
            options.timeout_s or max(TIMEOUT_S, TIMEOUT_BLOCKS * block_s),
        )
        self._interpolate, self._decimate = Interpolator(factor), Decimator(factor, len(self.channels))
        self._decimate(self._interpolate(np.zeros(self.block))[:, None].repeat(len(self.channels), axis=1))  # compiles
        self._stream = stream = DuplexStream(
            setting,
            block=block,
            ahead=max(self._queue + 8, math.ceil((FRAMES + 8 * options.period_frames) / block) + 1),
            longest_period=longest_period(self._rate_hz),
            watchdog=round(self._watchdog_s * self._rate_hz),
            fade=round(options.ramp_s * self._rate_hz),
        )
        self._counted = dict.fromkeys(self._counted, 0)
        self._measure_latency(stream)
        self._due = -1

    def _measure_latency(self, stream: DuplexStream) -> None:
        column = self._loopback
        if column is None:
            self._delay_frames = stream.latency_s * self._rate_hz
            return
        largest_v = TEST_SIGNAL * self._bench.limits.voltage_v
        amplitude = max(16, round(FULL_SCALE * largest_v / (self._options.output_full_scale_v or 1.0)))
        self._delay_frames = measured_delay(stream, column, amplitude, self.channels[column].name)

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        stream, factor = self._stream, self._factor
        assert stream is not None
        if self._due < 0:
            stream.begin()
            self._due = self._queue * self.block * factor
        volts = np.clip(self._interpolate(voltages), -self.output_range_v, self.output_range_v)  # also between samples
        counts = counts_of(volts, self._options.output_full_scale_v or 1.0)
        period, ramp = self.continuation[0].item()
        stream.put(self._due, counts, period_steps(period * factor), ramp_length(ramp * factor))
        self._due += counts.size
        self.do_meanwhile()
        frames = stream.take()
        np.multiply(self._decimate(frames.inputs), self._input_full_scales_v, out=inputs)
        self._take_flags(frames.flags, frames.put_out, inputs)

    def _take_flags(self, of_frames: np.ndarray, put_out: np.ndarray, inputs: np.ndarray) -> None:
        """Fill ``flags`` and ``put_out`` from those of the frames, and count."""
        self.flags.fill(0)
        self.put_out.fill(math.nan)
        lost = ~np.isfinite(inputs).all(axis=1)
        if not of_frames.any() and not lost.any():
            return
        raised = np.bitwise_or.reduce(of_frames.reshape(-1, self._factor), axis=1)
        for bit, (name, frame_bit) in enumerate(FLAGS.items()):
            here = (raised & frame_bit) > 0
            self.flags[here] |= 1 << bit
            self._counted[name] += int(here.sum())
        lost |= (raised & LOST_FRAME) > 0
        self.flags[lost] = LOST
        inputs[lost] = math.nan
        self._counted["lost_samples"] += int(lost.sum())
        instead = (raised & (HELD | CONTINUED)) > 0
        volts_per_count = (self._options.output_full_scale_v or 1.0) / FULL_SCALE
        self.put_out[instead] = put_out.reshape(-1, self._factor)[instead, 0] * volts_per_count

    def _stop(self) -> None:
        self._end()

    def _close(self) -> None:
        self._end()
        self._device = None

    def _end(self) -> None:
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()
