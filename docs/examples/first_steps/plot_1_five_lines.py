"""
A backbone in five lines
========================

A shipped plan, a virtual rig, a run: the structure is held at phase resonance and stepped through thirteen levels.
"""

import rig

run = rig.run("magnet-beam/backbone-short")
run.plot()
