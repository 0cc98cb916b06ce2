"""The samples of the rig behind the devices: what the output puts out, what the inputs read, and when."""

import math
import threading
import time
from collections.abc import Callable

import numpy as np

from rig.bench import Bench
from rig.emulator.nidaqmx.devices import Inputs
from rig.emulator.nidaqmx.filters import Filters, high_pass
from rig.emulator.nidaqmx.generation import Generation
from rig.emulator.plant import OutputLog, VirtualPlant, Wiring
from vibrolock.arrays import Float

LONGEST_STEP = 4096
"""Most samples that the rig is advanced by at once."""
KEPT = 1 << 17
"""Samples that are kept for reading: more than the largest buffer that NI-DAQmx chooses by itself (100 000)."""
TICK_S = 0.002
"""Interval at which the clock goes on where nobody calls, s."""
STALL_S = 0.006
"""Time for which this process may not be scheduled before its clock stands still, s: three ticks. A device is never late."""
OPEN_INPUTS = 8
"""Inputs without a sensor behind those of the rig; the first of them reads the output, and so does the `LAST` one."""
LAST = 7
"""Number of the last input of the chassis, where `rig new bench` expects the loopback cable."""
HOLD_SAMPLES = 0.5
"""A held output is half a sample late on average."""
ANTI_ALIAS = 0.4
"""Corner of the analog filter in front of a delta-sigma converter, of the sample rate."""


def converter_of(inputs: Inputs, output_range_v: float, rate_hz: float) -> dict[str, float]:
    """Settings of the virtual rig's converter for these inputs."""
    analog = {"anti_alias_hz": ANTI_ALIAS * rate_hz, "oversampling": 4, "substeps": 4} if inputs.is_delta_sigma else {}
    return {
        "sample_rate_hz": rate_hz,
        "adc_bits": inputs.bits,
        "adc_range_v": inputs.ranges_v[-1],
        "dac_bits": 16,
        "dac_range_v": output_range_v,
        "anti_alias_hz": 0.0,
        **analog,
    }


class Timeline:
    """The virtual rig, advanced sample by sample: by the clock, or in lockstep as far as the output has been written.

    Sample k is put out, and read, at the same instant; it counts from the start of the first task. All methods but `__init__`
    are called with ``lock`` held.
    """

    def __init__(
        self,
        bench: Bench,
        seed: int,
        wiring: Wiring | None,
        *,
        lockstep: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.lock = threading.Condition()
        self.lockstep, self.clock = lockstep, clock
        self.log: OutputLog | None = None
        self.on = False
        self.done = 0
        """Samples that have been put out and read."""
        self.held_v = 0.0
        """Voltage of the output where no task generates."""
        self.generation: Generation | None = None
        self.stood_still = 0
        """How often this process was not scheduled in time, so that its clock stood still."""
        self.rate_hz = 0.0
        sensors = tuple(channel for channel in bench.channels if not channel.loopback)
        self.bench = bench.model_copy(update={"channels": sensors})
        self.columns = len(sensors) + OPEN_INPUTS
        self._seed, self._wiring = seed, wiring
        self._inputs: Inputs | None = None
        self._kept = np.zeros((KEPT, self.columns))

    def prepare(self, rate_hz: float, inputs: Inputs, ac_coupled: tuple[int, ...] = ()) -> None:
        """Bring a rig at a rate to rest; ``ac_coupled`` are the columns whose inputs are AC coupled."""
        if rate_hz != self.rate_hz or inputs is not self._inputs:
            options = dict(self.bench.driver.options)
            given = options.get("converter")
            output_v = self.bench.output_range_v
            options["converter"] = {
                **(given if isinstance(given, dict) else {}),
                **converter_of(inputs, output_v, rate_hz),
            }
            driver = self.bench.driver.model_copy(update={"options": options})
            bench = self.bench.model_copy(update={"sample_rate_hz": rate_hz, "driver": driver})
            self._plant = VirtualPlant(bench, self._seed, self._wiring)
            self._plant.step(np.zeros(2))  # compiles
            self.rate_hz, self._inputs = rate_hz, inputs
        self._plant.log = None
        self._plant.reset()
        delay = inputs.delay_samples + inputs.delay_s * rate_hz
        n, plant_delay = len(self._plant.names), self._plant.filter_delay_s * rate_hz
        self._read_by = [*range(n), *sorted({n, max(n, LAST)})]
        cables = len(self._read_by) - n
        delays = np.repeat((max(0.0, delay - plant_delay), delay + HOLD_SAMPLES), (n, cables))
        passed = high_pass(inputs.high_pass_hz, rate_hz), (0.0, 0.0)
        self._filters = Filters(delays, [passed[column not in ac_coupled] for column in self._read_by])
        self._filters(np.zeros((2, delays.size)), 1.0)  # compiles
        self._plant.log = self.log

    def begin(self) -> None:
        """Sample 0 is now."""
        self.on, self.done = True, 0
        self._origin_s = self._seen_s = self.clock()

    def end(self) -> None:
        """No task runs any more; the output stays where it is."""
        self.advance()
        self.on = False

    def put_out(self, volts: float) -> None:
        """Put out a voltage without a clock, and hold it."""
        self.advance()
        self.held_v = volts
        self.note()

    def note(self) -> None:
        """Log the voltage that is held."""
        if self.log is not None:
            self.log.write(self.done, abs(self.held_v))

    def due_s(self, sample: int) -> float:
        """When a sample is due, s of the clock."""
        return self._origin_s + sample / self.rate_hz

    def present(self) -> int:
        """The first sample that is not due yet: by the clock, in lockstep as far as the output has been written."""
        if self.lockstep:
            generation = self.generation
            if generation is None or generation.first is None:
                return self.done
            return generation.first + generation.written
        now_s = self.clock()
        if now_s - self._seen_s > STALL_S:
            self._origin_s += now_s - self._seen_s
            self.stood_still += 1
        self._seen_s = now_s
        return math.floor((now_s - self._origin_s) * self.rate_hz) + 1

    def advance(self) -> None:
        """Put out and read all that is due."""
        if self.on:
            self._advance_to(self.present())

    def tick(self) -> None:
        """Go on by the clock where nobody has called for a while."""
        if self.on and not self.lockstep and self.clock() - self._seen_s > TICK_S:
            self.advance()

    def advance_freely(self, samples: int) -> None:
        """In lockstep, where no output is generated: let time pass up to a sample."""
        generation = self.generation
        if self.on and self.lockstep and (generation is None or generation.first is None or generation.has_failed):
            self._advance_to(samples)

    def _advance_to(self, end: int) -> None:
        begun = self.done
        while self.done < end:
            n = min(end - self.done, LONGEST_STEP)
            volts = np.full(n, self.held_v)
            if self.generation is not None:
                self.held_v = self.generation.take(self.done, volts)
            self._read(volts)
            self.done += n
        if self.done > begun:
            self.lock.notify_all()

    def _read(self, volts: Float) -> None:
        counts, _ = self._plant.step(volts)
        assert self._inputs is not None
        cables = len(self._read_by) - counts.shape[1]
        raw = np.column_stack((counts * self._plant.v_per_count, *(volts for _ in range(cables))))
        rows = self._filters(raw, self._inputs.ranges_v[-1])
        first, n = self.done % KEPT, volts.size
        head = min(n, KEPT - first)
        self._kept[first : first + head, self._read_by] = rows[:head]
        self._kept[: n - head, self._read_by] = rows[head:]

    def readings(self, first: int, n: int, columns: list[int]) -> Float:
        """Readings of samples from ``first`` on, by channel [columns, n], V."""
        return np.asarray(self._kept[np.arange(first, first + n) % KEPT][:, columns].T)
