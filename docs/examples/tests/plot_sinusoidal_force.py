"""
A force that is a sine
======================

A shaker makes harmonics: at resonance the second one is larger than the fundamental of the force itself. A loop adds harmonics
to the output until the force has none.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig


def force_over_a_period(run):
    """Force of the highest point over its fundamental's amplitude, against the phase in periods."""
    point = [point for point in run.recording.points if point["accepted"]][-1]
    part = run.recording.parts[point["part"]]
    first, end = point["first_sample"], point["end_sample"]
    theta = part.rows("theta_rad", first, end).astype(float)
    force = part.rows("inputs", first, end)[:, 0] / point["force_n"]
    order = np.argsort(theta)
    return theta[order] / (2 * np.pi), force[order]


plain, pure = rig.run("magnet-beam/backbone"), rig.run("magnet-beam/backbone-pure")

# %%
# Points of the second run show a force purity of 100 %.

pure

# %%
# The force over one period at the highest level, and both dampings: from the power of the fundamental (filled) and of all
# harmonics together (open). Under a sine there is one.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for run, name in ((plain, "a sine on the output"), (pure, "harmonics controlled")):
    left.plot(*force_over_a_period(run), ".", ms=1, label=name)
    points = [point for point in run.recording.points if point["accepted"]]
    x = np.array([1e3 * point["amplitude_m"] for point in points])
    damping = np.array([100 * point["damping_ratio"] for point in points])
    whole = damping * (1 + np.array([point["harmonic_power"] for point in points]))
    (line,) = right.plot(x, damping, "o-", label=name)
    right.plot(x, whole, "s", mfc="none", ms=8, color=line.get_color())
left.set(xlabel="phase of the oscillator, periods", ylabel="force over its fundamental")
left.legend(markerscale=8)
right.set(xlabel="displacement amplitude, mm", ylabel="modal damping ratio, %")
right.legend()
plt.show()
