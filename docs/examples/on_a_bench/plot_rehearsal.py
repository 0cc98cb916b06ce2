"""
A rehearsal before anything moves
=================================

The plan runs on virtual twins of the rig, each with other gains, noise, damping and shaker within what is known. The verdict
says how often it would end well, trip, or miss points.
"""

import rig
from rig.rehearsal.rehearsal import rehearse
from rig.results.rehearsal.rehearse import Subject, request_for

bench = rig.load_bench("magnet-beam")
plan = rig.load_plan("magnet-beam/continuous-backbone")  # which says what is known of the plant
plan = plan.model_copy(update={"levels_m": plan.levels_m[2:12:4]})
rehearsal = rehearse(request_for(Subject(plan=plan, bench=bench, draws=4)), jobs=2)
rehearsal

# %%
# Four twins are few: the interval of a share is as wide as it says. A plan for a real bench is rehearsed on two hundred.

rehearsal.plot()
