"""Import of python-can without a library for files that it would import if it is installed, and that is never used here."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

_UNUSED = "asammdf"  # of the extra `formats`; it takes seconds


@contextmanager
def lean_import() -> Iterator[None]:
    """Hide the library while python-can, or cantools, is imported for the first time."""
    if "can" in sys.modules or _UNUSED in sys.modules:
        yield
        return
    sys.modules[_UNUSED] = None  # type: ignore[assignment]  # makes its import fail
    try:
        yield
    finally:
        del sys.modules[_UNUSED]
