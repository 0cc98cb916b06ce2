"""What the tick takes: its arrays, by name and type, whatever the bench."""

from functools import cache
from typing import Final, NamedTuple

import numpy as np

from controller import AmplitudeLaw, preset
from rig.bench import load_bench
from rig.daq import CONTINUATION
from rig.tick.layout import TickArrays
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings

SHOWN: Final = "magnet-beam"
"""Bench whose tick shows the types; those of all benches are equal."""


class Arguments(NamedTuple):
    """Arguments of `rig.tick.kernels.tick_block`."""

    t: TickArrays
    volts: np.ndarray
    flags: np.ndarray
    readings: np.ndarray
    rows: np.ndarray
    outputs: np.ndarray
    put_out: np.ndarray
    continuation: np.ndarray

    def by_name(self) -> dict[str, np.ndarray]:
        """Return all arrays in the order in which machine code takes them."""
        return {**self.t._asdict(), **{name: getattr(self, name) for name in self._fields[1:]}}


def arguments_for(tick: Tick, block: int) -> Arguments:
    """Return arguments for blocks of this many samples, with zeros in place of samples."""
    readings, rows = tick.buffers(block)
    return Arguments(
        tick.arrays,
        volts=np.zeros((block, readings.shape[1])),
        flags=np.zeros(block, np.uint16),
        readings=readings,
        rows=rows,
        outputs=np.zeros(block),
        put_out=np.full(block, np.nan),
        continuation=np.zeros(1, CONTINUATION),
    )


@cache
def example() -> Arguments:
    """Return arguments whose types are those of every bench; their numbers mean nothing."""
    segments = [Segment(SegmentKind.HOLD, -1, 0.5, 1.0)]
    settings = TickSettings(load_bench(SHOWN), preset(SHOWN), AmplitudeLaw.VOLTAGE, SettleRule(), segments)
    return arguments_for(settings.build(0.5), 1)
