"""Common parts of the four packages of this distribution: its version, the compilation of kernels, names imported on use."""

from typing import Any

__version__: str


def __getattr__(name: str) -> Any:
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version  # takes longer than everything else that a small command imports

    globals()[name] = found = version("vibrolock")
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), "__version__"})
