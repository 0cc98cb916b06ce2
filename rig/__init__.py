"""The bench: drivers, the loop, campaigns, recordings, figures and the command line.

`run` carries out a plan, `resume` finishes an interrupted one, `Recording` opens a file. The names are imported on
first use, so that the command line starts at once.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from rig.api import Run, resume, run
    from rig.bench import Bench, load_bench
    from rig.campaigns.plans import load_plan
    from rig.recording.reader import Recording
else:
    __getattr__, __dir__ = on_use(
        __name__,
        {
            "Bench": "bench",
            "Recording": "recording.reader",
            "Run": "api",
            "load_bench": "bench",
            "load_plan": "campaigns.plans",
            "resume": "api",
            "run": "api",
        },
    )

__all__ = ["Bench", "Recording", "Run", "load_bench", "load_plan", "resume", "run"]
