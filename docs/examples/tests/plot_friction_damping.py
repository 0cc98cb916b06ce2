"""
Damping of a beam with a friction joint
=======================================

A joint that begins to slip loses energy: damping rises steeply with the amplitude. A short test beside harmonic balance.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.drivers import make_daq
from simulators.analysis import hysteresis_loops, phase_resonance_backbone

mode = identification.nonlinear_mode(rig.run("friction-beam/backbone-short").backbone())
virtual = make_daq(rig.load_bench("friction-beam")).rig
truth = phase_resonance_backbone(virtual, amplitudes_m=mode.amplitude_m[2::4])

figure, (damping, loop) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
x = 1e6 * mode.amplitude_m
damping.errorbar(x, 100 * mode.damping_ratio, 100 * mode.bound_95("damping_ratio"), fmt="o", label="test, 95 %")
damping.plot(1e6 * truth.amplitude_m, 100 * truth.damping_ratio, "s", ms=8, mfc="none", label="harmonic balance")
damping.set(xlabel="displacement amplitude, µm", ylabel="modal damping ratio, %", xscale="log")
damping.legend()

# Why: the hysteresis of one joint at three levels. Its area is the energy that is lost in a period.
for point in (0, 1, 3):
    found = hysteresis_loops(virtual, truth, point)[0]
    size = f"{1e6 * truth.amplitude_m[point]:.0f} µm"
    loop.plot(found.coordinate / abs(found.coordinate).max(), found.force / abs(found.force).max(), label=size)
loop.set(xlabel="coordinate of the joint over its largest", ylabel="force over its largest")
loop.legend()
plt.show()
