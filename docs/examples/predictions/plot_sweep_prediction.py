"""
A sweep predicted from a backbone
=================================

The mode and the force of a recorded sweep give the motion over time; with a model of the shaker, the voltage would do.
"""

import matplotlib.pyplot as plt
import numpy as np

import identification
import rig

mode = identification.nonlinear_mode(rig.run("magnet-beam/backbone-short").backbone())
change = {"start_hz": 22.5, "stop_hz": 27.0, "levels_v": (1.5,)}
(sweep,) = rig.run(rig.load_plan("magnet-beam/sweep-1").model_copy(update=change)).sweeps().values()
predicted = identification.predict_sweep(mode, sweep)
predicted

# %%
# The displacement beside the recorded one, and the difference over the largest.

measured = 1e3 * np.abs(sweep.fundamental("drive")) / (2 * np.pi * sweep.frequency_hz) ** 2
model = 1e3 * np.abs(predicted.drive_m)

figure, (motion, difference) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
motion.plot(sweep.time_s, measured, lw=3, alpha=0.5, label="recorded")
motion.plot(predicted.time_s, model, label="predicted from the recorded force")
difference.plot(predicted.time_s, 100 * (model - np.interp(predicted.time_s, sweep.time_s, measured)) / measured.max())
motion.set(ylabel="displacement amplitude, mm")
motion.legend()
difference.set(xlabel="time, s", ylabel="difference over the largest, %")
plt.show()
