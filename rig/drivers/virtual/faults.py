"""Passing faults of a device with a clock, for the virtual one: outputs that come too late, and samples that are lost.

Time is cut into slots as long as a fault. Whether a slot is hit depends only on the seed and the number of the slot. A run is
therefore repeatable, and it is the same however its samples are cut into blocks.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from rig.bench.configuration import Configured
from rig.continuation import SOURCE, begin, count_at, keep, period_steps, ramp_length, ring_for
from rig.daq import CONTINUATION, CONTINUED, HELD, LOST
from simulators.kernels import Flag, mix, unit
from vibrolock.compiled import inner_kernel, kernel
from vibrolock.described import Described

OUTPUT_HELD = 1 << len(Flag)
"""Bit of the device's flags behind those of the rig, as wired devices have it."""
OUTPUT_CONTINUED = OUTPUT_HELD << 1  # the next bit
FAULT_FLAGS = (HELD, CONTINUED)
"""Names of the bits behind those of the rig."""
LONGEST_PERIOD = 16384
"""Longest period of outputs, samples, with which the virtual device goes on; beyond, outputs are held."""
V_PER_COUNT = 2.0**-20  # V; counts in which late outputs are continued; chosen: a microvolt, below any converter

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # increment of SplitMix64 (Steele, Lea & Flood 2014)
_HELD, _LOST, _LATE = (
    0x48454C44,
    0x4C4F5354,
    0x4C415445,
)  # separate the draws of the faults from each other and from the noise
_HIT_HELD, _HIT_LOST, _HIT_LATE = range(3)  # places in the arrays by kind of fault


class PassingFaults(Configured, Described):
    """Passing faults of the virtual device, as devices with a clock have them. None by default.

    Times of a fault are rounded to whole blocks of the bench. Faults may follow each other without a gap.
    """

    late_per_s: float = Field(0.0, ge=0, le=1000)
    """How often the host's outputs come too late, 1/s on average. The device then goes on with the last period of outputs."""
    late_s: float = Field(0.02, gt=0, le=10)
    """By how much they are late, s."""
    held_per_s: float = Field(0.0, ge=0, le=1000)
    """The same of a device that cannot go on with a period, 1/s on average: the converter repeats its last output, and the late
    ones are dropped."""
    held_s: float = Field(0.02, gt=0, le=10)
    """For how long an output is held, s."""
    lost_per_s: float = Field(0.0, ge=0, le=1000)
    """How often samples are lost in transmission, 1/s on average."""
    lost_s: float = Field(0.005, gt=0, le=10)
    """For how long samples are lost, s."""

    def build(self, seed: int, sample_rate_hz: float, block: int, outputs: "Outputs") -> "FaultArrays":
        """Return what the kernels read, for a bench with blocks of ``block`` samples."""
        slots, shares = [], []
        for per_s, duration_s in (
            (self.held_per_s, self.held_s),
            (self.lost_per_s, self.lost_s),
            (self.late_per_s, self.late_s),
        ):
            slot = max(1, round(duration_s * sample_rate_hz / block)) * block
            slots.append(slot)
            shares.append(-math.expm1(-per_s * slot / sample_rate_hz))  # at least one fault in a slot
        keys = [mix(np.uint64((seed + 1) * int(_GOLDEN) + name & 0xFFFFFFFFFFFFFFFF)) for name in (_HELD, _LOST, _LATE)]
        source, ring = np.zeros(1, SOURCE), ring_for(LONGEST_PERIOD if self.late_per_s else 0)
        begin(source[0], LONGEST_PERIOD)
        return FaultArrays(
            bool(any(shares)),
            np.array(slots, np.int64),
            np.array(shares),
            np.array(keys, np.uint64),
            np.zeros(1),
            outputs,
            source,
            ring,
            np.zeros(ring.size, np.int64),
            np.zeros(outputs.block, np.int64),
            np.zeros(1, np.int64),
        )


class Outputs(NamedTuple):
    """How outputs are handed over to the device."""

    block: int
    """Samples of a block."""
    ahead: int
    """Samples from the beginning of a block, when it is swapped, to the end of the outputs handed over with it."""
    told: np.ndarray
    """How they go on (`rig.daq.CONTINUATION`, one record)."""


class FaultArrays(NamedTuple):
    """Passing faults as the kernels read them; entries are of held outputs, lost samples and late outputs."""

    any: bool
    """Whether there are faults at all."""
    slot_samples: np.ndarray
    """int64[3]: length of a slot."""
    share: np.ndarray
    """float64[3]: part of the slots that is hit."""
    key: np.ndarray
    """uint64[3]: keys of the draws."""
    last_v: np.ndarray
    """float64[1]: the voltage that the converter holds."""
    outputs: Outputs
    """How outputs are handed over."""
    source: np.ndarray
    """With what the device goes on (`rig.continuation.SOURCE`, one record)."""
    kept: np.ndarray
    """int64[m]: ring of the outputs that have come, counts."""
    due: np.ndarray
    """int64[m]: ring of the outputs by the instants at which they were due, counts."""
    counts: np.ndarray
    """int64[block]: outputs of one block."""
    kept_before: np.ndarray
    """int64[1]: instant before which outputs have come."""


def held_outputs(seed: int, sample_rate_hz: float, block: int, faults: PassingFaults) -> FaultArrays:
    """Return the held outputs among ``faults`` alone, for a device around the rig that has the others in a way of its own."""
    held = faults.model_copy(update={"lost_per_s": 0.0, "late_per_s": 0.0})
    return held.build(seed, sample_rate_hz, block, Outputs(block, 0, np.zeros(1, CONTINUATION)))


@kernel
def is_hit(faults: FaultArrays, which: int, sample: int) -> bool:
    """Return whether a fault hits a sample; ``which`` is 0, 1 or 2: held outputs, lost samples, late outputs."""
    if faults.share[which] == 0.0:
        return False
    slot = np.uint64(sample // faults.slot_samples[which])
    return bool(unit(mix(faults.key[which] + slot * _GOLDEN)) < faults.share[which])


@kernel
def take_outputs(faults: FaultArrays, index: int) -> None:
    """Take the outputs due before sample ``index``, the first of a block, unless they are still late."""
    if index == 0 or is_hit(faults, _HIT_LATE, index - 1):
        return
    told, block, size = faults.outputs.told[0], faults.outputs.block, faults.due.size
    period = period_steps(told.period_samples)
    ramp = ramp_length(told.ramp_samples + faults.outputs.ahead) if told.ramp_samples > 0.0 else 0
    first = max(faults.kept_before[0], index - size // block * block)
    while first < index:
        for place in range(block):
            faults.counts[place] = faults.due[(first + place) % size]
        keep(faults.source[0], faults.kept, first, faults.counts, period, ramp)
        first += block
    faults.kept_before[0] = index


@inner_kernel
def convert(faults: FaultArrays, index: int, voltage: float) -> tuple[float, int]:
    """Return the voltage on the converter at sample ``index``, held or continued if it is late, and the flags of the faults."""
    if not faults.any:
        return voltage, 0
    return convert_with_faults(faults, index, voltage)


@kernel
def convert_with_faults(faults: FaultArrays, index: int, voltage: float) -> tuple[float, int]:
    """Do as `convert`, of a device with faults; a call of its own, for which seventy numbers are put on the stack."""
    raised = 0
    if faults.share[_HIT_LATE] > 0.0:
        if index % faults.outputs.block == 0:
            take_outputs(faults, index)
        faults.due[index % faults.due.size] = round(voltage / V_PER_COUNT)
        if is_hit(faults, _HIT_LATE, index):
            is_known = faults.source[0].period > 0
            raised |= OUTPUT_CONTINUED if is_known else OUTPUT_HELD
            voltage = V_PER_COUNT * count_at(faults.source[0], faults.kept, index) if is_known else faults.last_v[0]
    if is_hit(faults, _HIT_HELD, index):
        voltage = faults.last_v[0]
        raised = OUTPUT_HELD
    faults.last_v[0] = voltage
    if is_hit(faults, _HIT_LOST, index):
        raised |= LOST
    return voltage, raised
