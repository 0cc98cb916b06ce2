"""
Gains and margins from a linear test
====================================

A low-level multisine tells enough of rig and structure to choose the gains of the loop, with their margins, and to write a
plan.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from rig.tuning import TuningRequest, tune

with TemporaryDirectory() as folder:
    tuned = tune("magnet-beam", Path(folder) / "tuned.h5", TuningRequest(level_rms_v=0.01, points=5))
tuned

# %%
# Plant with its model, open loops with their margins, and what a step in frequency or level does.

tuned.plot()

# %%
# The plan that comes out of it.

print(tuned.plan_toml)
