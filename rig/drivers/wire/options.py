"""What every driver over a wire may be told."""

from pydantic import Field

from rig.bench.configuration import Configured

__all__ = ["WireOptions"]

LONGEST_S = 4000.0  # microseconds in an unsigned word of four bytes


class WireOptions(Configured):
    """Options that all wires share; a driver adds those that say where the device is."""

    queue_blocks: int = Field(1, ge=1, le=64)
    """q: blocks between the handing over of an output and the converter; more forgive a later host and delay the loop."""
    watchdog_s: float | None = Field(None, gt=0, le=LONGEST_S)
    """Time without an output after which the device brings its own to 0 V, s; by default 0.1 s, or 4 blocks if longer."""
    ramp_s: float = Field(0.05, ge=0, le=LONGEST_S)
    """Time of the ramp with which the device's watchdog does so, s; 0 drops the output."""
    timeout_s: float | None = Field(None, gt=0, le=LONGEST_S)
    """Longest wait for a block before the device counts as silent, s; by default 0.25 s, or 10 blocks if longer."""
