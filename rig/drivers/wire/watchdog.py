"""How long the device's watchdog waits: what the bench asks for, within what is safe and the device can do."""

from rig.drivers.wire.facts import DeviceFacts
from rig.drivers.wire.options import WireOptions
from rig.errors import DaqRefused

__all__ = ["raised_remark", "watchdog_s"]

DEFAULT_S, DEFAULT_BLOCKS = 0.1, 4
SHORTEST_BLOCKS = 2
LONGEST_S, LONGEST_BLOCKS = 1.0, 10  # where something moves: so long an output may be held


def _default_s(block_s: float) -> float:
    return max(DEFAULT_S, DEFAULT_BLOCKS * block_s)


def watchdog_s(options: WireOptions, facts: DeviceFacts, block_s: float) -> float:
    """The time to set, s.

    `DaqRefused` where it is shorter than two blocks, or longer than a device that moves something may wait.
    """
    chosen_s = options.watchdog_s or max(_default_s(block_s), facts.watchdog_s[0])
    shortest_s, longest_s = SHORTEST_BLOCKS * block_s, max(LONGEST_S, LONGEST_BLOCKS * block_s)
    if chosen_s < shortest_s:
        raise DaqRefused(
            f"driver.options.watchdog_s = {chosen_s:g}: allowed is from {shortest_s:g} s on, {SHORTEST_BLOCKS} blocks"
        )
    if chosen_s > longest_s and not facts.simulated:
        whose = "" if options.watchdog_s else ", the shortest that the device can do"
        raise DaqRefused(
            f"driver.options.watchdog_s = {chosen_s:g}{whose}: allowed is up to {longest_s:g} s "
            "for a device that does not say that nothing moves: so long it may hold its last output"
        )
    return chosen_s


def raised_remark(options: WireOptions, facts: DeviceFacts, block_s: float) -> str:
    """That the device cannot do a watchdog as short as the default; empty where it can, or nobody wanted the default."""
    if options.watchdog_s or facts.watchdog_s[0] <= _default_s(block_s):
        return ""
    return (
        f"the device's watchdog waits {facts.watchdog_s[0]:g} s, the shortest that it can do, "
        f"instead of the usual {_default_s(block_s):g} s"
    )
