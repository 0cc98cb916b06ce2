"""The bench: carry out vibration tests, read their recordings, draw them.

First::

    import identification
    import rig

    run = rig.run("magnet-beam/backbone")    # a shipped plan on a virtual rig
    mode = identification.nonlinear_mode(run.backbone())
    print(mode.modal_frequency_hz, mode.damping_ratio)

Names, of which ``help(rig.run)`` and so on say more:

    run, resume             carry out a plan; finish one that was interrupted
    Run, Recording          a run with its points and measurements; a file, opened
    load_plan, load_bench   a plan, a bench from its name or TOML file
    Bench                   driver, channels, limits and specimen

Further on: `rig.measurements` (recordings as measurements), `rig.daq` and `rig.conformance` (drivers), `rig.errors`.
The command line is `rig`; ``rig docs NAME`` opens the page of a name, a key or a command.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from rig.api import Run as Run, resume as resume, run as run
    from rig.bench import Bench as Bench, load_bench as load_bench
    from rig.campaigns.plans import load_plan as load_plan
    from rig.recording.reader import Recording as Recording
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
