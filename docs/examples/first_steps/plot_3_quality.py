"""
When a point is accepted
========================

Every point says whether it settled, how far the phase was off, and what its intervals are. Here a point is compared with the
record it was evaluated from.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig

run = rig.run("magnet-beam/backbone-short")

# %%
# A run shows its points with their quality and its warnings.

run

# %%
# The same as a list of records. On the left the relative 95 % interval of the damping tells the points apart. On the
# right is what the last one was evaluated from: the force as it was measured, and its fundamental. The magnet's force
# is far from harmonic.

points = [point for point in run.recording.points if point["accepted"]]
x = np.array([1e3 * point["amplitude_m"] for point in points])
interval = np.array([196.0 * point["damping_ratio_std"] / point["damping_ratio"] for point in points])

point = points[-1]
part = run.recording.parts[point["part"]]
first, end = point["first_sample"], point["end_sample"]
force, theta = part.rows("inputs", first, end)[:, 0], part.rows("theta_rad", first, end)
fundamental = 2.0 * np.mean(force * np.exp(-1j * theta))
time_s = np.arange(force.size) / run.recording.configuration["bench"]["sample_rate_hz"]

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(x, interval, "o-")
left.set(
    xlabel="displacement amplitude, mm",
    ylabel="95 % interval of the damping, %",
    ylim=(0, None),
)
right.plot(time_s, force, label="force")
right.plot(time_s, np.real(fundamental * np.exp(1j * theta)), label="its fundamental")
right.set(xlabel="time, s", ylabel="force, N", xlim=(0, 0.12))
right.legend()
plt.show()
