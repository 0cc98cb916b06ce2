"""A virtual rig in whose wires somebody puts a hand: it breaks at a sample, and remembers what was true all the same."""

from functools import cache

import numpy as np

from rig.bench import Bench
from simulators import VirtualRig
from simulators.kernels import RigArrays, aligned, pad, run_observed
from simulators.parts import Deviation
from tests.reliability.faults.spoiling import AMPLIFIER, SENSOR
from tests.reliability.faults.table import Fault
from vibrolock.compiled import bound

SOFTER = 0.8  # of the stiffness
SOFTENING_PERIODS, SOFTENING_STEPS = 50.0, 20
CLIPPED = 0.25  # of the largest voltage of the run without a fault
LATE_S = {"2-ms-late": 2e-3, "5-ms-late": 5e-3, "10-ms-late": 10e-3}
MOST_LATE_SAMPLES = 500
"""More than any of them takes."""
NEVER = 2**62


@cache
def softened(specimen: str, rate_hz: float, range_v: float, stiffness: float, seed: int) -> RigArrays:
    """The compiled rig of a shipped specimen with all its modes less stiff."""
    rig = VirtualRig.shipped(specimen, converter={"sample_rate_hz": rate_hz, "dac_range_v": range_v})
    moved = (stiffness**0.5 - 1.0,) * rig.plant.n_mode
    return VirtualRig.shipped(
        specimen,
        converter={"sample_rate_hz": rate_hz, "dac_range_v": range_v},
        deviation=Deviation(frequency=moved).model_dump(),
    ).build(seed)[0]


class BrokenRig:
    """Voltages in, readings out, sample by sample as `simulators.stepping.sample`; ``fault`` acts from sample ``onset`` on.

    ``needed_v``: largest output of the run without a fault. ``sent``: voltages [n] as they came from the device, before the
    amplifier; ``true``: readings [n, n_channels] (V) before the sensors' fault; ``motion`` [n, 2]: force (N) and
    displacement (m) of the drive point, of no sensor.
    """

    def __init__(
        self, rig: VirtualRig, bench: Bench, seed: int, fault: Fault | None, onset: int, needed_v: float
    ) -> None:
        self.arrays, self.state = rig.build(seed)
        self._rig, self._bench, self._seed = rig, bench, seed
        self._fault, self._onset, self._needed_v = fault, NEVER if fault is None else onset, needed_v
        drive = rig.shape(rig.stinger.at)
        self._observe = pad(np.array([rig.plant.force_row(), rig.plant.displacement_row(drive)]).T)
        self._index = next(
            (i for i, c in enumerate(bench.channels) if fault is not None and c.role == fault.part), None
        )
        self.swapped_with = next(i for i, channel in enumerate(bench.channels) if channel.role == "response")
        self._last_v = self._last_out_v = 0.0
        self._past = np.empty(0)
        self.first = 0
        self._truth, self._run = np.empty((0, 0)), None
        self.sent: list[np.ndarray] = []
        self.true: list[np.ndarray] = []
        self.motion: list[np.ndarray] = []

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One sample a voltage [n]; returns readings [n, n_channels] (V) and flags uint16[n]."""
        n = voltages.size
        readings, flags = np.empty((n, len(self._bench.channels))), np.empty(n, np.int64)
        near = (
            self.first + 2 * n + MOST_LATE_SAMPLES > self._onset
        )  # else nothing acts, and nothing is remembered for it
        if near:
            self._weaken()
        sent = self._amplified(voltages) if near else voltages
        given = self.arrays, self.state, self._observe, sent, readings, self._truth_of(n), flags
        if self._run is None:
            self._run = bound(run_observed, *given)
        self._run(*given)
        truth = self._truth
        self.sent.append(voltages.copy())
        self.true.append(readings.copy())
        self.motion.append(truth[:, :2].copy())
        if near:
            self._spoil(readings)
        self.first += n
        return readings, flags.astype(np.uint16)

    def _truth_of(self, n: int) -> np.ndarray:
        if self._truth.shape[0] != n:
            self._truth = aligned((n, self._observe.shape[1]))
        return self._truth

    def _acts_from(self, part: str, n: int) -> int:
        """The first of the next n samples at which a fault of this part acts; n if it does at none of them."""
        here = self._fault is not None and self._fault.part == part
        return min(max(self._onset - self.first, 0), n) if here else n

    def _since(self, k: int, n: int) -> np.ndarray:
        """Samples since the fault began, of the next n from the k-th on."""
        return np.arange(self.first + k, self.first + n) - self._onset

    def _amplified(self, voltages: np.ndarray) -> np.ndarray:
        n, out = voltages.size, voltages.copy()
        k = self._acts_from("amplifier", n)
        self._last_out_v = float(voltages[k - 1]) if k else self._last_out_v
        if k == n or self._fault is None:
            return out
        if self._fault.kind == "clipped":
            limit = CLIPPED * self._needed_v
            out[k:] = np.clip(voltages[k:], -limit, limit)
        else:
            spoil = AMPLIFIER[self._fault.kind]
            out[k:] = spoil(voltages[k:], self._since(k, n), self._last_out_v, self._bench.sample_rate_hz)
        return out

    def _spoil(self, readings: np.ndarray) -> None:
        if self._index is None or self._fault is None:
            return
        n, volts = readings.shape[0], readings[:, self._index]
        if self._fault.kind in LATE_S:
            self._past = np.concatenate([self._past, volts])
        k = self._acts_from(self._fault.part, n)
        self._last_v = float(volts[k - 1]) if k else self._last_v
        if k == n:
            return
        if self._fault.kind in LATE_S:
            late = np.arange(k, n) + self._past.size - n - round(LATE_S[self._fault.kind] * self._bench.sample_rate_hz)
            readings[k:, self._index] = np.where(late >= 0, self._past[np.maximum(late, 0)], 0.0)
        elif self._fault.kind == "swapped":
            pair = [self._index, self.swapped_with]
            readings[k:, pair] = readings[k:, pair[::-1]]
        else:
            spoil = SENSOR[self._fault.kind]
            readings[k:, self._index] = spoil(
                volts[k:].copy(), self._since(k, n), self._last_v, self._bench.sample_rate_hz
            )

    def _weaken(self) -> None:
        """The arrays of a softer rig, the state as it is: its coordinates are those of the same modes."""
        at = self.first - self._onset
        if self._fault is None or self._fault.part != "structure" or at < 0:
            return
        share = 1.0
        if self._fault.kind == "softening":
            periods = at / self._bench.sample_rate_hz * self._bench.specimen.linear_frequency_hz
            share = min(1.0, np.ceil(SOFTENING_STEPS * periods / SOFTENING_PERIODS) / SOFTENING_STEPS)
        if share > 0.0:
            rate_hz, range_v = self._bench.sample_rate_hz, self._bench.output_range_v
            stiffness = 1.0 - share * (1.0 - SOFTER)
            self.arrays = softened(str(self._rig.specimen), rate_hz, range_v, stiffness, self._seed)
