"""What a driver's counters say of frames that arrive out of order, in words."""

from collections.abc import Mapping

__all__ = ["DISORDER", "LATE_BLOCKS", "OUT_OF_ORDER_FRAMES", "REORDERED_BLOCKS", "disorder_text"]

OUT_OF_ORDER_FRAMES = "out_of_order_frames"
"""Counter of frames that came after a later one, on a bus."""
REORDERED_BLOCKS = "reordered_blocks"
"""Counter of blocks that came after the next one and were put in their place."""
LATE_BLOCKS = "late_blocks"
"""Counter of blocks that came too late for that: they count as lost."""
DISORDER = "frames arrive out of order"


def disorder_text(counters: Mapping[str, int]) -> str:
    """Return one line if a driver's counters tell of frames out of order, else an empty string."""
    frames, placed, late = (counters.get(name, 0) for name in (OUT_OF_ORDER_FRAMES, REORDERED_BLOCKS, LATE_BLOCKS))
    if not frames and not placed and not late:
        return ""
    told = [f"{frames} frames after a later one"] if frames else []
    told += [f"{placed} blocks put in their place"] if placed or not late else []
    told += [f"{late} blocks too late for their place, and lost"] if late else []
    return f"{DISORDER}: {', '.join(told)} (adapter, its firmware or its driver)"
