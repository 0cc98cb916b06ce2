"""Passing faults of a device with a clock, for the virtual one: outputs that come too late, and samples that are lost.

Time is cut into slots as long as a fault. Whether a slot is hit depends only on the seed and the number of the slot. A run is
therefore repeatable, and it is the same however its samples are cut into blocks.
"""

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from rig.bench.configuration import Configured
from simulators.layout import Flag
from simulators.sensing.noise.kernels import mix, unit
from vibrolock.compiled import kernel
from vibrolock.described import Described

__all__ = ["FAULT_FLAGS", "OUTPUT_HELD", "FaultArrays", "PassingFaults", "is_hit"]

OUTPUT_HELD = 1 << len(Flag)
"""Bit of the device's flags behind those of the rig, as wired devices have it."""
FAULT_FLAGS = ("output_held",)
"""Names of the bits behind those of the rig."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_HELD, _LOST = (
    0x48454C44,
    0x4C4F5354,
)  # separate the draws of the two faults from each other and from the sensors' noise


class PassingFaults(Configured, Described):
    """Passing faults of the virtual device, as devices with a clock have them. None by default.

    Times of a fault are rounded to whole blocks of the bench. Faults may follow each other without a gap.
    """

    held_per_s: float = Field(0.0, ge=0, le=1000)
    """How often the host's outputs come too late, 1/s on average. The converter then repeats its last output, and the late ones
    are dropped."""
    held_s: float = Field(0.02, gt=0, le=10)
    """For how long an output is held, s."""
    lost_per_s: float = Field(0.0, ge=0, le=1000)
    """How often samples are lost on their way, 1/s on average."""
    lost_s: float = Field(0.005, gt=0, le=10)
    """For how long samples are lost, s."""

    def build(self, seed: int, sample_rate_hz: float, block: int) -> "FaultArrays":
        """Return what the kernels read, for a device with blocks of ``block`` samples."""
        slots, shares = [], []
        for per_s, duration_s in ((self.held_per_s, self.held_s), (self.lost_per_s, self.lost_s)):
            slot = max(1, round(duration_s * sample_rate_hz / block)) * block
            slots.append(slot)
            shares.append(-math.expm1(-per_s * slot / sample_rate_hz))  # at least one fault in a slot
        keys = [mix(np.uint64((seed + 1) * int(_GOLDEN) + name & 0xFFFFFFFFFFFFFFFF)) for name in (_HELD, _LOST)]
        return FaultArrays(
            bool(any(shares)), np.array(slots, np.int64), np.array(shares), np.array(keys, np.uint64), np.zeros(1)
        )


class FaultArrays(NamedTuple):
    """Passing faults as the kernels read them; the first entry is of held outputs, the second of lost samples."""

    any: bool
    """Whether there are faults at all."""
    slot_samples: np.ndarray
    """int64[2]: length of a slot."""
    share: np.ndarray
    """float64[2]: part of the slots that is hit."""
    key: np.ndarray
    """uint64[2]: keys of the draws."""
    last_v: np.ndarray
    """float64[1]: the voltage that the converter holds."""


@kernel
def is_hit(faults: FaultArrays, which: int, sample: int) -> bool:
    """Return whether a sample lies in a slot that a fault hits; ``which`` is 0 for held outputs, 1 for lost samples."""
    if faults.share[which] == 0.0:
        return False
    slot = np.uint64(sample // faults.slot_samples[which])
    return bool(unit(mix(faults.key[which] + slot * _GOLDEN)) < faults.share[which])
