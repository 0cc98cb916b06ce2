"""What a device may do wrong, so that a host can be tested with it."""

from dataclasses import dataclass

__all__ = ["Faults"]


@dataclass(frozen=True)
class Faults:
    """Nothing by default. Blocks are counted from 1; ``every`` of 0 is never."""

    version: int | None = None
    """Speaks this version of the protocol only."""
    channel_names: tuple[str, ...] | None = None
    """Says that its channels are called so."""
    channels_sent: int | None = None
    """Sends so many channels, whatever it says."""
    deaf_after_s: float | None = None
    """Understands nothing any more so long after START, and goes on sampling."""
    silent_after_s: float | None = None
    """Sends nothing any more so long after START."""
    reset_after_s: float | None = None
    """Starts anew so long after START."""
    drop_every: int = 0
    """Every so many a block is lost on the way."""
    drop_burst: int = 1
    """So many in a row."""
    repeat_every: int = 0
    """Every so many a block comes twice."""
    reorder_every: int = 0
    """Every so many a block comes after the next one."""
    late_every: int = 0
    """Every so many a block, and all behind it, come late."""
    late_s: float = 0.05
    """By so much."""
