"""The bench: drivers, the loop, campaigns, recordings, figures and the command line.

`run` carries out a plan, `resume` finishes an interrupted one, `Recording` opens a file. The names are imported on
first use, so that the command line starts at once.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.api import Run, resume, run
    from rig.bench import Bench, load_bench
    from rig.campaigns.plans import load_plan
    from rig.recording.reader import Recording

__all__ = ["Bench", "Recording", "Run", "load_bench", "load_plan", "resume", "run"]

_MODULE_OF = {
    "Bench": "bench",
    "Recording": "recording.reader",
    "Run": "api",
    "load_bench": "bench",
    "load_plan": "campaigns.plans",
    "resume": "api",
    "run": "api",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
