"""`VirtualDAQ`: a virtual rig behind the DAQ contract, with any block size and any latency."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field, ValidationError

from rig.bench import Bench
from rig.bench.channels import SAME_SENSITIVITY
from rig.bench.configuration import Configured, invalid, validated
from rig.daq import DAQ, Capabilities, Image
from rig.drivers.virtual.faults import FAULT_FLAGS, FaultArrays, Outputs, PassingFaults, held_outputs
from rig.drivers.virtual.images import image_biases, image_remarks
from rig.drivers.virtual.kernels import Converters, Exchange, Loopback, fused, loopback_of
from rig.errors import ConfigurationError, DaqRefused
from rig.tick.layout import TickArrays
from rig.tick.safety.kernels import is_over
from simulators import VirtualRig
from simulators.kernels import Flag, RigArrays, addressed
from vibrolock.one_thread import one_thread

if TYPE_CHECKING:
    from simulators.analysis import ImageBias

FACT_TOLERANCE = 1e-3  # relative difference from the bench that is worth a remark; chosen: as facts are rounded
SKEW_TOLERANCE = 0.01  # samples; 0.02 degrees at a hundredth of the sample rate
COUNTED = (*(str(flag.name).lower() for flag in Flag), *FAULT_FLAGS, "lost_samples")
GROWTH = 1e-3  # a step; of a plant that does not grow there is rounding alone, far below
HOLD_SAMPLES = 0.5  # a held output is half a sample late on average


class Queue(Configured):
    """Latency and passing faults of the virtual device."""

    queue_blocks: int = Field(0, ge=0, le=64)
    """q: blocks of outputs in the device's queue, as in a buffered DAQ."""
    delay_samples: int = Field(0, ge=0, le=1000)
    """Further samples between the handing over of an output and the converter."""
    faults: PassingFaults = PassingFaults()
    """Passing faults: outputs that come too late, samples that are lost."""
    at_zero_v: Literal["attached", "open-circuit", "stinger-dropped"] = "attached"
    """What the exciter does while the output is exactly 0 V, as in a plan of kind ``decay``: it stays ``attached``; its coil is
    open (``open-circuit``); its stinger is off (``stinger-dropped``)."""


class VirtualDAQ(DAQ):
    """A virtual rig behind the DAQ contract.

    Options: those of `simulators.VirtualRig` (``specimen`` and its parts), ``queue_blocks``, ``delay_samples`` and ``faults``.
    The seed draws noise and faults; on one machine a run with the same seed and outputs returns the same inputs bit for bit,
    whatever the block.

    Channels with ``loopback = true`` behind those of the rig's sensors read the output itself, late by hold and filters as the
    sensors are, without noise or steps.

    It returns at once: pacing is the loop's. Not modelled: jitter, a device that fails.
    """

    wall_clock = False

    @one_thread()
    def __init__(self, bench: Bench, seed: int = 0) -> None:
        bench = bench.at_device
        super().__init__(bench.channels, bench.sample_rate_hz, bench.output_range_v)
        options = dict(bench.driver.options)
        queue = {key: options.pop(key) for key in list(options) if key in Queue.model_fields}
        self._queue_options = validated(Queue, queue, "driver.options")
        converter = {"sample_rate_hz": bench.sample_rate_hz, "dac_range_v": bench.output_range_v}
        if "seed" in options:
            raise ConfigurationError("is given to the run (`seed`), not to the bench", field="driver.options.seed")
        given = options.get("converter", {})
        if not isinstance(given, dict):
            raise ConfigurationError(field="driver.options.converter", value=given, allowed="a table")
        options["converter"] = {**converter, **given}
        self.rig = validated(VirtualRig, options, "driver.options")
        self._wears = self.rig.wear.wears
        self._compare_channels()
        arrays = self._checked_arrays(seed)
        self._seed = seed
        self._specimen = bench.specimen
        self._counts = np.zeros(len(COUNTED), np.int64)
        self._bench_block = bench.block
        self._how = self._queue_options.at_zero_v
        if self._how != "attached" and self._wears:
            raise ConfigurationError(
                field="driver.options.at_zero_v", value=self._how, allowed="'attached' for a specimen that wears"
            )
        if self._how != "attached":
            arrays = self.rig.realised(seed).released(self._how).build(seed)[0]
        self._released = arrays
        """Arrays of the rig while the output is 0 V; those of the rig itself if its exciter stays attached."""
        self._exchanged = self._converters(0, loopback_of(self.channels, 0.0), self._faults(bench.block))
        self._first = 0
        self._swap: Exchange

    def _faults(self, ahead: int) -> FaultArrays:
        outputs = Outputs(self.block or self._bench_block, ahead, self.continuation)
        return self._queue_options.faults.build(self._seed, self.sample_rate_hz, self._bench_block, outputs)

    def converters(self, counts: np.ndarray, loopback: Loopback) -> Converters:
        """Converters without a queue for a device around the rig that counts and loses samples in a way of its own."""
        late_per_s = self._queue_options.faults.late_per_s
        if late_per_s > 0.0:
            raise ConfigurationError(
                field="driver.options.faults.late_per_s",
                value=late_per_s,
                allowed="0 for an emulated device, whose outputs come as late as its host sends them",
            )
        faults = held_outputs(self._seed, self.sample_rate_hz, self._bench_block, self._queue_options.faults)
        return Converters(np.zeros(0), counts, loopback, faults, self._how != "attached", addressed(self._released))

    def _converters(self, queue_samples: int, loopback: Loopback, faults: FaultArrays) -> Converters:
        releases = self._how != "attached"
        return Converters(np.zeros(queue_samples), self._counts, loopback, faults, releases, addressed(self._released))

    def _checked_arrays(self, seed: int) -> RigArrays:
        """Arrays of the rig; refuses, before a run begins, parts whose arrays cannot be computed or are not finite."""
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                arrays, _ = self.rig.build(seed)
                delays = self.rig.channel_delays_samples
        except ValidationError as error:  # of the specimen that scatters
            raise invalid(error, VirtualRig, where="driver.options") from None
        except (ArithmeticError, ValueError, MemoryError) as error:
            raise ConfigurationError(
                f"this rig cannot be simulated: one of its numbers is far too large or small ({error})",
                field="driver.options",
            ) from None
        finite = all(np.all(np.isfinite(array)) for array in (arrays.step, arrays.correct, arrays.sense, delays))
        size, first = self.rig.plant.dynamics.shape[0], self.rig.plant.site_rows.shape[0]
        transition = arrays.step[:size, first : first + size].T  # behind the rows of the sites
        if not finite or np.max(np.abs(np.linalg.eigvals(transition))) > 1.0 + GROWTH:
            raise ConfigurationError(
                "this rig cannot be computed, its integration step grows: a mass, stiffness, resistance or inductance is far "
                "too large or small beside the others",
                field="driver.options",
            )
        return arrays

    def _compare_channels(self) -> None:
        ours = [channel.name for channel in self.channels]
        theirs = [sensor.name for sensor in self.rig.sensors]
        sensed = len(theirs)
        if ours[:sensed] != theirs or not all(channel.loopback for channel in self.channels[sensed:]):
            raise ConfigurationError(
                f"{ours} in the bench, the virtual rig has {theirs}, in this order, and loopbacks behind them",
                field="channels",
            )
        if self.rig.converter.sample_rate_hz != self.sample_rate_hz:
            raise ConfigurationError(
                field="driver.options.converter.sample_rate_hz",
                value=self.rig.converter.sample_rate_hz,
                allowed=f"the bench's {self.sample_rate_hz:g}",
            )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Where the bench's facts differ from what the virtual rig is made of."""
        out = image_remarks(self.rig, self._image_biases, self._specimen.linear_frequency_hz)
        delays = self.rig.channel_delays_samples
        for channel, sensor, delay in zip(self.channels[: delays.size], self.rig.sensors, delays, strict=True):
            said, has = channel.sensitivity_v_per_unit, sensor.sensitivity_v_per_unit
            if not math.isclose(said, has, rel_tol=SAME_SENSITIVITY):
                out.append(
                    f"channel {channel.name}: the bench says {said:.8g} V per {channel.unit}, "
                    f"the virtual sensor has {has:.8g}"
                )
            if abs(channel.skew_samples - delay) > SKEW_TOLERANCE:
                out.append(
                    f"channel {channel.name}: the bench says skew_samples = {channel.skew_samples:g}, "
                    f"the virtual sensor is {delay:.4g} samples late"
                )
        modes, facts = self.rig.linear_modes, self._specimen
        mode = modes.nearest(facts.linear_frequency_hz)
        shape, frequency_hz = float(modes.drive_shape[mode]), float(modes.frequency_hz[mode])
        if facts.drive_mode_shape is not None and abs(facts.drive_mode_shape - shape) > FACT_TOLERANCE * shape:
            out.append(
                f"specimen.drive_mode_shape = {facts.drive_mode_shape:g}: the virtual specimen has {shape:.6g}; "
                "the damping goes with its square"
            )
        if abs(facts.linear_frequency_hz - frequency_hz) > FACT_TOLERANCE * frequency_hz:
            out.append(
                f"specimen.linear_frequency_hz = {facts.linear_frequency_hz:g}: the virtual specimen has {frequency_hz:.6g} Hz"
            )
        return tuple(out)

    @cached_property
    def _image_biases(self) -> "dict[float, ImageBias]":
        return image_biases(self.rig, self.channels)

    @property
    def images(self) -> tuple[Image, ...]:
        """Images of the held output in the force, of every linear mode that is sampled, past the filters."""
        parts = ((hz, bias.force_n_per_v) for hz, bias in self._image_biases.items())
        return tuple(Image(hz, part.real, part.imag) for hz, part in parts)

    def image_shares(self, frequency_hz: np.ndarray) -> dict[str, np.ndarray]:
        """Images of the held output in each channel of the linear rig; none behind a reconstruction filter."""
        if self.rig.converter.reconstruction_hz:
            return {}
        from simulators.analysis import image_shares  # no run needs it

        return image_shares(self.rig, frequency_hz)

    @property
    def capabilities(self) -> Capabilities:
        """Any block size, not paced, repeatable; safe without the host because it ends with its process."""
        return Capabilities(largest_block=1_000_000, paced=False, virtual=True, repeatable=True, safe_without_host=True)

    @property
    def queue_samples(self) -> int:
        """Samples between the handing over of an output and the converter."""
        return self._queue_options.queue_blocks * self.block + self._queue_options.delay_samples

    @property
    def latency_samples(self) -> float:
        """Queue, half a sample of hold, and the delay of the converter's filters at low frequency."""
        return self.queue_samples + HOLD_SAMPLES + self.filter_delay_samples

    @property
    def filter_delay_samples(self) -> float:
        """Delay of the converter's filters at low frequency."""
        return self.rig.filter_delay_samples

    @property
    def counters(self) -> dict[str, int]:
        """Samples at which each flag of rig and device was up, and samples that were lost."""
        return dict(zip(COUNTED, self._counts.tolist(), strict=True))

    @property
    def output_v(self) -> float:
        """Voltage on the converter now, V; only while blocks are exchanged, not in a fused run."""
        past = self._exchanged.loopback.past
        return float(past[(self._first - 1) % past.size])

    def _open(self) -> None:
        pass

    @one_thread()
    def _start(self) -> None:
        self._realised = self.rig.realised(self._seed)
        self._arrays, self._state = self._realised.build(self._seed)
        loopback = loopback_of(self.channels, HOLD_SAMPLES + self.filter_delay_samples)
        faults = self._faults(self.block + self.queue_samples)
        self._exchanged = self._converters(self.queue_samples, loopback, faults)
        self._fused = self._converters(self.block + self.queue_samples, loopback, faults)
        self._swap = Exchange(self._arrays, self._state, self._exchanged)
        self._counts[:] = 0
        self._first = 0

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        if not self._wears:
            self._swap(self._first, voltages, inputs, self.flags, self.put_out)
            self._first += voltages.size
            return
        for arrays, part in self._pieces(voltages.size):
            self._arrays = arrays
            self._swap.change(arrays)
            self._swap(self._first, voltages[part], inputs[part], self.flags[part], self.put_out[part])
            self._first += part.stop - part.start

    def _pieces(self, n: int) -> Iterator[tuple[RigArrays, slice]]:
        """The next ``n`` samples of the rig in pieces over each of which its plant stays as it is, with its arrays."""
        return self._realised.pieces(self._arrays, int(self._state.counter[0]), n)

    def run_fused(self, t: TickArrays, readings: np.ndarray, rows: np.ndarray) -> int:
        """Run the tick and the rig in one compiled loop, bit for bit as `exchange` with this block would.

        The lead of the tick must be the block plus the latency. A run is either fused or exchanged, not both.
        """
        lead = int(t.loop["delay_whole"][0])
        if lead != math.floor(self.block + self.latency_samples):
            raise DaqRefused(
                f"the tick expects a lead of {lead} samples, this device has {math.floor(self.block + self.latency_samples)}"
            )
        volts = np.empty(len(self.channels))
        done = 0
        for arrays, part in self._pieces(rows.size):
            self._arrays = arrays
            done += fused(t, self._arrays, self._state, self._fused, volts, readings[part], rows[part])
            if is_over(t.guard[0], lead):
                break
        return done

    def _stop(self) -> None:
        self._rest()

    def _close(self) -> None:
        self._rest()

    def _rest(self) -> None:
        self._exchanged.queue[:] = 0.0
        self._exchanged.loopback.past[:] = 0.0
        self._exchanged.faults.last_v[:] = 0.0
