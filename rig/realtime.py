"""What this machine can promise: the answer of ``rig doctor``."""

import os
import platform
import shutil
import sys
import time
from pathlib import Path
from typing import Any

__all__ = ["examine"]

WAKE_UPS = 1000
PERIOD_S = 0.001


def examine(folder: Path) -> dict[str, Any]:
    """Facts on processor, clock, privileges, kernels, disk and drivers; ``folder`` is where recordings would go.

    The lateness is that of a sleeping Python thread, measured for a second; a wall-clock rig wants its own process.
    """
    import vibrolock
    from rig.bench import shipped_benches
    from rig.drivers import driver_names
    from vibrolock.compiled import kernel_cache_folder

    lateness_us = _lateness_us()
    return {
        "vibrolock": vibrolock.__version__,
        "python": sys.version.split()[0],
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "processors": os.cpu_count() or 1,
        "realtime_scheduling": _may_schedule_realtime(),
        "memory_lock": _may_lock_memory(),
        "wake_up_lateness_us": {
            "p50": lateness_us[WAKE_UPS // 2],
            "p99": lateness_us[WAKE_UPS * 99 // 100],
            "largest": lateness_us[-1],
        },
        "kernel_cache": str(kernel_cache_folder()),
        "free_disk_gb": round(shutil.disk_usage(folder).free / 1e9, 1),
        "drivers": driver_names(),
        "benches": shipped_benches(),
        "wall_clock_rigs": "not in this version; virtual rigs run on every system",
    }


def _lateness_us() -> list[float]:
    """Sorted lateness of wake-ups from a 1 ms sleep, in microseconds."""
    out = []
    due = time.perf_counter()
    for _ in range(WAKE_UPS):
        due += PERIOD_S
        time.sleep(max(0.0, due - time.perf_counter()))
        out.append(round(1e6 * (time.perf_counter() - due), 1))
    return sorted(out)


def _may_schedule_realtime() -> str:
    """Whether this process may ask for SCHED_FIFO; tried and taken back."""
    if not hasattr(os, "sched_setscheduler"):
        return "not on this system"
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, *before)
    except PermissionError:
        return "not permitted (set rtprio in /etc/security/limits.conf)"
    except OSError as error:
        return f"not available ({error.strerror})"
    return "permitted"


def _may_lock_memory() -> str:
    """How much memory this process may lock."""
    try:
        import resource
    except ImportError:
        return "not on this system"
    if not hasattr(resource, "RLIMIT_MEMLOCK"):
        return "not on this system"
    soft, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    return "unlimited" if soft == resource.RLIM_INFINITY else f"{soft // 1024} KiB"
