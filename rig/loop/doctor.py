"""Examination of this machine and of a bench, for ``rig doctor``."""

import os
import platform
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, cast

from rig.bench import Bench
from rig.errors import RigError

if TYPE_CHECKING:
    from rig.loop.worker.probe import DeviceReport, WakeUps

RATE_HZ = 1000.0  # of the wake-ups that are measured; chosen
SECONDS = 1.0  # for which wake-ups are measured; chosen
MEASURED_S = 1.5  # of a device, before settings are recommended and tried


class MachineReport(TypedDict):
    """Facts on this machine."""

    vibrolock: str
    python: str
    system: str
    processors: int
    realtime_scheduling: str
    memory_lock: str
    timer_slack: str
    wake_up_lateness_us: dict[str, float]
    without_privilege_us: dict[str, float]
    kernel_cache: str
    free_disk_gb: float
    drivers: list[str]
    benches: list[str]
    serial_ports: list[str]
    wall_clock_rigs: str


def examine(folder: Path) -> MachineReport:
    """Return facts on processor, clock, privileges, kernels, disk, drivers and serial ports; ``folder`` holds recordings.

    The wake-up lateness is measured in a process like that of a wall-clock loop, woken a thousand times in a second, with and
    without the loop's privileges.
    """
    import vibrolock
    from rig.bench import shipped_benches
    from rig.drivers import driver_names
    from rig.wire.serial.port import port_names
    from vibrolock.kernel_cache import kernel_cache_folder

    with_it, without_it = _probed(privileged=True), _probed(privileged=False)
    return {
        "vibrolock": vibrolock.__version__,
        "python": sys.version.split()[0],
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "processors": os.cpu_count() or 1,
        "realtime_scheduling": with_it.pop("scheduling", "not on this system"),
        "memory_lock": with_it.pop("memory", "not on this system"),
        "timer_slack": with_it.pop("timer_slack", "not on this system"),
        "wake_up_lateness_us": with_it.get("wake_up_us", {}),
        "without_privilege_us": without_it.get("wake_up_us", {}),
        "kernel_cache": str(kernel_cache_folder()),
        "free_disk_gb": round(shutil.disk_usage(folder).free / 1e9, 1),
        "drivers": driver_names(),
        "benches": shipped_benches(),
        "serial_ports": port_names(),
        "wall_clock_rigs": _promise(with_it),
    }


def examine_bench(bench: Bench, seed: int = 0, seconds: float = MEASURED_S) -> "DeviceReport":
    """Exchange 0 V with a bench's device; return timing, measured for some ``seconds``, and recommended settings, tried.

    What is done and returned: `rig.loop.worker.examination.examine_device`. Nothing is driven.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError` if the device cannot be opened.
    """
    from rig.loop.worker.examination import examine_device

    return _measured("examination", examine_device, bench, seed, seconds)


def measure_bench(bench: Bench, seed: int = 0, seconds: float = 2.0) -> "DeviceReport":
    """Exchange 0 V with a bench's device as the bench has it for some seconds; return the timing. Nothing is driven.

    Raises `rig.errors.DaqError` or `rig.errors.ConfigurationError` if the device cannot be opened.
    """
    from rig.loop.worker.probe import round_trips

    return _measured("round trips", round_trips, bench, seed, seconds)


def _measured(
    order: str, measure: "Callable[[Bench, int, float], DeviceReport]", bench: Bench, seed: int, seconds: float
) -> "DeviceReport":
    """Measure in a process like that of a wall-clock loop, where the system has one; else in this process."""
    from rig.loop.worker.spawn import ask, supported

    return cast("DeviceReport", ask(order, bench, seed, seconds)) if supported() else measure(bench, seed, seconds)


def _probed(*, privileged: bool) -> "WakeUps":
    from rig.loop.worker.spawn import ask, supported

    if not supported():
        return {}
    try:
        return cast("WakeUps", ask("probe", RATE_HZ, SECONDS, privileged))
    except RigError as error:
        return {"scheduling": str(error)}


def _promise(probed: "WakeUps") -> str:
    """Return one sentence on the timing that a wall-clock loop can rely on here."""
    if "wake_up_us" not in probed:
        return "in the campaign's own process, and nothing is promised on this system"
    rate_hz = 0.5e6 / max(1.0, probed["wake_up_us"]["p99_9"])
    return f"in a process of their own; by this second, 999 of 1000 blocks begin within half a period up to {rate_hz:.0f} Hz"
