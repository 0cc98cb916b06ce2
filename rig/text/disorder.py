"""What a driver's counters say of frames that arrive out of order, in words."""

from collections.abc import Mapping

OUT_OF_ORDER_FRAMES = "out_of_order_frames"
"""Counter of frames that came after a later one, on a bus."""
REORDERED_BLOCKS = "reordered_blocks"
"""Counter of blocks that came after the next one and were put in their place."""
LATE_FRAMES = "late_frames"
"""Counter of frames out of order that came after their block had been given up: it counts as lost."""
LATE_BLOCKS = "late_blocks"
"""Counter of blocks that came too late to be put in their place: they count as lost."""
DISORDER = "frames arrive out of order"


def is_late(counters: Mapping[str, int]) -> bool:
    """Whether samples were lost because frames came too late to be put in order."""
    return bool(counters.get(LATE_FRAMES, 0) or counters.get(LATE_BLOCKS, 0))


def disorder_text(counters: Mapping[str, int]) -> str:
    """Return one line if a driver's counters tell of frames out of order, else an empty string."""
    frames, placed, late_frames, late_blocks = (
        counters.get(name, 0) for name in (OUT_OF_ORDER_FRAMES, REORDERED_BLOCKS, LATE_FRAMES, LATE_BLOCKS)
    )
    if not frames and not placed and not late_blocks:
        return ""
    told = [f"{frames} frames after a later one"] if frames else []
    told += [f"{placed} blocks put in their place"] if placed or not is_late(counters) else []
    told += [f"{late_frames} frames too late for their block, which is lost"] if late_frames else []
    told += [f"{late_blocks} blocks too late for their place, and lost"] if late_blocks else []
    return f"{DISORDER}: {', '.join(told)} (adapter, its firmware or its driver)"
