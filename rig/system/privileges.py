"""Privileges that let a loop wake up in time; each is requested, and whether it was granted is reported."""

import ctypes
import gc
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

PRIORITY = 80
"""Priority of SCHED_FIFO: above the interrupt threads of the kernel (50)."""

CPU_VARIABLE = "VIBROLOCK_LOOP_CPU"
"""Environment variable with the number of the processor to which the loop is bound."""

NICE = 5  # niceness (0 to 19) of what only watches; chosen: the loop goes first
LOCK_CURRENT, LOCK_FUTURE = 1, 2  # <sys/mman.h>
SET_TIMER_SLACK = 29  # <sys/prctl.h>
NO_SUCH = "not on this system"


def prepare(*, privileged: bool = True, priority: int = PRIORITY) -> dict[str, str]:
    """Request real-time scheduling, locked memory and CPU affinity for this process; return which were granted.

    With ``privileged = False`` steps that need a permission are left out. The garbage collector is switched off: existing
    objects are kept for good, and a loop without cyclic garbage needs no collector.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    steps: dict[str, Callable[[], str]] = {"timer_slack": _timer_slack, "processor": _affinity}
    if privileged:
        steps |= {"memory": _lock_memory, "scheduling": lambda: _schedule(priority)}
    out = {"garbage_collector": "off"}
    for name, step in steps.items():
        try:
            out[name] = step()
        except PermissionError:
            out[name] = "not permitted"
        except (OSError, ValueError) as error:
            out[name] = f"not available ({error})"
    return {"memory": "not asked for", "scheduling": "not asked for"} | out


def lower_priority() -> None:
    """Let this process, and what it starts, stand back behind those that drive a rig."""
    with suppress(OSError, AttributeError):  # not on Windows
        os.nice(NICE)


def ordinary_scheduling() -> None:
    """Give back real-time scheduling, for work that nobody waits for; a no-op where there is none."""
    if hasattr(os, "sched_setscheduler"):
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))


def _schedule(priority: int) -> str:
    """Set SCHED_FIFO for all existing threads; new threads inherit it."""
    if not hasattr(os, "sched_setscheduler"):
        return NO_SUCH
    for thread in _threads():
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    return f"SCHED_FIFO {priority}"


def _threads() -> list[int]:
    """Return the numbers of all threads of this process; 0, the calling one, where the system does not tell."""
    folder = Path("/proc/self/task")
    return [int(path.name) for path in folder.iterdir()] if folder.exists() else [0]


def _lock_memory() -> str:
    library = ctypes.CDLL(None, use_errno=True)
    if not hasattr(library, "mlockall"):
        return NO_SUCH
    if library.mlockall(LOCK_CURRENT | LOCK_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return "locked"


def _timer_slack() -> str:
    """Set the timer slack to 1 ns; without real-time scheduling the kernel's default delays wake-ups by up to 50 us."""
    library = ctypes.CDLL(None, use_errno=True)
    if not hasattr(library, "prctl"):
        return NO_SUCH
    unused = ctypes.c_ulong(0)
    if library.prctl(SET_TIMER_SLACK, ctypes.c_ulong(1), unused, unused, unused) != 0:
        raise OSError(ctypes.get_errno(), "prctl")
    return "1 ns"


def _affinity() -> str:
    wanted = os.environ.get(CPU_VARIABLE, "")
    if not wanted:
        return "any"
    if not hasattr(os, "sched_setaffinity"):
        return NO_SUCH
    os.sched_setaffinity(0, {int(wanted)})
    return f"number {int(wanted)}"
