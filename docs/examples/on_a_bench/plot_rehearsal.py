"""
A rehearsal before anything moves
=================================

The plan runs on virtual twins of the rig, each with other gains, noise, damping and shaker within what is known. The verdict says
how often it would end well, trip, or miss points.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import rig
from rig.models.rehearse import Subject, request_for
from rig.rehearsal.rehearsal import rehearse
from rig.tuning import tune

bench = rig.load_bench("magnet-beam")
with TemporaryDirectory() as folder:
    known = Path(folder) / "tuned.h5"
    plan = tune(bench, known).plan
    rehearsal = rehearse(request_for(Subject(plan=plan, bench=bench, sources=[known], draws=8)), jobs=2)
rehearsal

# %%
# Eight twins are few: the interval of a share is as wide as it says. A plan for a real bench is rehearsed on two hundred.

rehearsal.plot()
