"""Shared memory that a killed run may leave behind."""

from pathlib import Path

# Python's own shared memory and semaphores, and ours. Other programs, and joblib in tests beside this one, come and go.
NAMES = ("psm_", "sem.mp-", "vibrolock")


def named_memory() -> set[str]:
    """Shared memory with a name that Python's own or ours would have."""
    return {path.name for path in Path("/dev/shm").glob("*") if path.name.startswith(NAMES)}
