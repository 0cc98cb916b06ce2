"""The plant behind a device's converters: a virtual rig, its wiring, and a log of the output."""

import os
import re
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rig.bench import Bench
from rig.drivers.virtual import VirtualDAQ
from rig.drivers.virtual.driver import COUNTED, HOLD_SAMPLES
from rig.drivers.virtual.faults import OUTPUT_HELD
from rig.drivers.virtual.kernels import Exchange, loopback_of
from rig.errors import ConfigurationError
from rig.wire.messages import DeviceFlag
from simulators.kernels import Flag

WHOLE_RANGE = 2.0**31
"""Counts of full scale where the virtual converter has no steps: 32 bits, signed."""


class Wiring:
    """How the sensors are connected to the channels; mistakes can be made on purpose. The rig itself is unchanged.

    ``flip``: sensors mounted the other way round. ``dead``: channels without a sensor, which toggle their last bit.
    ``swap``: pairs of sensors in each other's sockets.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        flip: tuple[str, ...] = (),
        dead: tuple[str, ...] = (),
        swap: tuple[tuple[str, str], ...] = (),
    ) -> None:
        for key, given in {"flip": flip, "dead": dead, "swap": tuple(name for pair in swap for name in pair)}.items():
            for name in given:
                if name not in names:
                    raise ConfigurationError("there is no such channel", field=key, value=name, allowed=names)
        at = {name: index for index, name in enumerate(names)}
        self._order = np.arange(len(names))
        for first, second in swap:
            pair = [at[first], at[second]]
            self._order[pair] = self._order[pair[::-1]]
        self._sign = np.array([-1 if name in flip else 1 for name in names])
        self._dead = [at[name] for name in dead]
        self.as_it_should_be = not (flip or dead or swap)

    def connect(self, counts: np.ndarray, first: int) -> np.ndarray:
        """Counts [n, n_channels] by channel from counts by sensor; ``first`` is the index of the first row."""
        out = counts[:, self._order] * self._sign
        for channel in self._dead:
            out[:, channel] = (np.arange(first, first + counts.shape[0]) * 7919 >> 4) & 1
        return np.asarray(np.clip(out, np.iinfo(counts.dtype).min, np.iinfo(counts.dtype).max), dtype=counts.dtype)


class VirtualPlant:
    """The virtual rig of a bench, read in counts of its converters: counts times volts per count are the rig's readings.

    ``range_v``, ``v_per_count`` and ``skew_s`` (delay behind the first channel) are by channel [n_channels]; counts have
    ``bits``, 16 or 32. It samples at ``rate_hz`` alone; ``filter_delay_s`` is the mean delay of its filters at low frequency.
    A rig that has diverged reads full scale, with the overload flag.
    """

    def __init__(self, bench: Bench, seed: int = 0, wiring: Wiring | None = None) -> None:
        bench = bench.at_device
        if bench.driver.name != "virtual":
            raise ConfigurationError(
                field="driver.name", value=bench.driver.name, allowed="'virtual', for what is emulated is a virtual rig"
            )
        options: Mapping[str, object] = {
            key: value for key, value in bench.driver.options.items() if key not in ("queue_blocks", "delay_samples")
        }
        driver = bench.driver.model_copy(update={"options": dict(options)})
        self._daq = VirtualDAQ(bench.model_copy(update={"driver": driver}), seed)
        self._rig, self._seed = self._daq.rig, seed
        converter = self._rig.converter
        self._channels = bench.channels
        self.names = tuple(channel.name for channel in bench.channels)
        loopbacks = len(self.names) - len(self._rig.channel_names)
        self.bits = 16 if 1 <= converter.adc_bits <= 16 and 1 <= converter.dac_bits <= 16 else 32
        step_v = converter.adc_step_v or converter.adc_range_v / WHOLE_RANGE
        self.v_per_count = np.full(len(self.names), step_v)
        self.range_v = np.full(len(self.names), converter.adc_range_v)
        self.skew_s = np.append(self._rig.channel_delays_samples, np.zeros(loopbacks)) / bench.sample_rate_hz
        self.output_range_v = converter.dac_range_v
        self.output_v_per_count = converter.dac_step_v or converter.dac_range_v / WHOLE_RANGE
        self.rate_hz = bench.sample_rate_hz
        self.filter_delay_s = self._rig.filter_delay_samples / bench.sample_rate_hz
        self._wiring = wiring if wiring is not None and not wiring.as_it_should_be else None
        self._dtype = np.dtype(f"<i{self.bits // 8}")
        self._device_flags = {
            int(Flag.SENSOR_CLIPPED): int(DeviceFlag.OVERLOAD),
            int(Flag.DIVERGED): int(DeviceFlag.OVERLOAD),
            int(Flag.DAC_CLIPPED): int(DeviceFlag.OUTPUT_CLIPPED),
            int(Flag.AMPLIFIER_CLIPPED): int(DeviceFlag.OUTPUT_CLIPPED),
            OUTPUT_HELD: int(DeviceFlag.OUTPUT_HELD),
        }
        self.log: OutputLog | None = None
        """Where a line is written for every block, and one of 0 V when the device is stopped."""
        self.reset()
        self.step(np.zeros(1))  # loads the kernels, or compiles them: no host waits for it later
        self.reset()

    def reset(self) -> None:
        """Back to rest, at sample 0, with the noise of the same seed."""
        self._realised = self._rig.realised(self._seed)
        self._arrays, self._state = self._realised.build(self._seed)
        loopback = loopback_of(self._channels, HOLD_SAMPLES + self._rig.filter_delay_samples)
        counts = np.zeros(len(COUNTED), np.int64)
        self._swap = Exchange(self._arrays, self._state, self._daq.converters(counts, loopback))
        self._first = 0
        self._buffers_for(0)
        if self.log is not None:
            self.log.write(0, 0.0)

    def _buffers_for(self, n: int) -> None:
        """Allocate the kernel's output arrays for blocks of ``n``: the kernel does not check their size."""
        self._readings_v = np.empty((n, len(self.names)))
        self._raised = np.zeros(n, np.uint16)
        self.put_out = np.full(n, np.nan)
        """Voltages of the last block [n] where the rig's own faults have put out others than those given, V; else NaN."""

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        """Advance the virtual rig by one sample a voltage [n], V; returns counts [n, n_channels] and `DeviceFlag` bits."""
        n = voltages.size
        if self.log is not None:
            self.log.write(self._first, float(np.abs(voltages).max()))
        if self._raised.size != n:
            self._buffers_for(n)
        for arrays, part in self._realised.pieces(self._arrays, self._first, n):
            self._arrays = arrays
            self._swap.change(arrays)
            self._swap(
                self._first + part.start,
                voltages[part],
                self._readings_v[part],
                self._raised[part],
                self.put_out[part],
            )
        counts, flags = self._counted()
        if self._wiring is not None:
            counts = self._wiring.connect(counts, self._first)
        self._first += n
        return counts, flags

    def _counted(self) -> tuple[np.ndarray, int]:
        """The readings as counts. They lie on the converter's steps and within its range, so nothing is lost."""
        raised = int(np.bitwise_or.reduce(self._raised))
        scaled = self._readings_v / self.v_per_count
        flags = 0
        if raised:
            for bit, device_bit in self._device_flags.items():
                flags |= device_bit if raised & bit else 0
            if raised & Flag.DIVERGED:
                scaled = np.nan_to_num(scaled, nan=2.0 ** (self.bits - 1) - 1.0)
        return np.rint(scaled, out=scaled).astype(self._dtype), flags


_LOGGED = re.compile(rb"[\d.]+ \d+ [\d.e+-]+\s")
"""What the log of a plant begins with."""


def check_log(path: Path) -> None:
    """Raise `ConfigurationError` for a file that exists and is no log of an output, or cannot be read."""
    try:
        start = b""
        if path.is_file():
            with path.open("rb") as stream:
                start = stream.read(100)
    except OSError as error:
        raise ConfigurationError(f"cannot be written: {error.strerror}", field="log_output", value=str(path)) from error
    if start and not _LOGGED.match(start):
        raise ConfigurationError(
            "exists already and is not a log of an emulator; choose another name", field="log_output", value=str(path)
        )


class OutputLog:
    """A log of the output: a line has the time of ``time.monotonic`` in s, a sample, and the largest absolute output in V.

    A file that cannot be made, or that exists and is not such a log, is a `ConfigurationError`; a disk that is full later ends
    the writing and nothing else.
    """

    def __init__(self, path: Path) -> None:
        try:
            check_log(path)
            # open as long as the device lives
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        except OSError as error:
            raise ConfigurationError(
                f"cannot be written: {error.strerror}", field="log_output", value=str(path)
            ) from error
        self._is_full = False

    def write(self, first: int, largest_v: float) -> None:
        """Write the line of a block from sample ``first`` on."""
        if self._is_full:
            return
        try:
            os.write(self._descriptor, f"{time.monotonic():.6f} {first} {largest_v:.6g}\n".encode("ascii"))
        except OSError:
            self._is_full = True
