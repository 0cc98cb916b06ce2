"""What may have held up the thread of a loop: Python's own doings, and the system's."""

import gc
import importlib.util
import sys

__all__ = ["disturbances", "since"]


def disturbances() -> dict[str, int]:
    """Counts so far: modules imported and runs of the garbage collector.

    Of this thread too, where the system tells: switches that it did not ask for, page faults with (major) and without
    (minor) the disk.
    """
    system = _of_the_system()  # which imports something the first time
    collections = sum(int(generation["collections"]) for generation in gc.get_stats())
    return {"imports": len(sys.modules), "collections": collections, **system}


def since(before: dict[str, int]) -> dict[str, int]:
    """How many more than before."""
    now = disturbances()
    return {name: now[name] - count for name, count in before.items()}


def _of_the_system() -> dict[str, int]:
    if importlib.util.find_spec("resource") is None:
        return {}
    import resource

    if not hasattr(resource, "RUSAGE_THREAD"):
        return {}
    used = resource.getrusage(resource.RUSAGE_THREAD)
    return {"involuntary_switches": used.ru_nivcsw, "major_faults": used.ru_majflt, "minor_faults": used.ru_minflt}
