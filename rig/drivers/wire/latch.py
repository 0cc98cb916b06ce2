"""What a device may have latched, in words, and the error for it."""

from rig.errors import DaqEmergencyStop, DaqError, DaqWatchdog
from rig.wire.messages import DeviceFlag

__all__ = ["STOPPED", "latched_text", "stopped"]

STOPPED = DeviceFlag.WATCHDOG | DeviceFlag.EMERGENCY_STOP


def latched_text(latched: DeviceFlag) -> str:
    """In words; empty for nothing."""
    names = {DeviceFlag.EMERGENCY_STOP: "emergency stop", DeviceFlag.WATCHDOG: "watchdog"}
    said = " and ".join(name for flag, name in names.items() if latched & flag)
    return f"the device's {said} had latched" if said else ""


def stopped(name: str, flags: int, text: str) -> DaqError:
    """The error of the graver of what has latched at the port of a name."""
    kind = DaqEmergencyStop if flags & DeviceFlag.EMERGENCY_STOP else DaqWatchdog
    return kind(f"{name}: {text}")
