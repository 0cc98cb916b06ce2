"""
A sweep up and a sweep down
===========================

Both sweeps hold the force while they pass the resonance. Between the folds of the response the structure has two stable
vibrations; which of them is measured depends on where the sweep comes from.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response

change = {"levels_n": (0.55,), "rate_hz_per_s": 0.05, "hold_periods": 50}
up = rig.run(rig.load_plan("magnet-beam/controlled-sweep-up").model_copy(update=change))
down = rig.run(rig.load_plan("magnet-beam/controlled-sweep-down").model_copy(update=change))
up.plot()

# %%
# Displacement over frequency of both ways, beside harmonic balance with its unstable part dotted.

truth = constant_force_response(make_daq(rig.load_bench("magnet-beam")).rig, 0.55, np.arange(-172, -7, 3))
amplitude = 1e3 * truth.amplitude_m

figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
axis.plot(truth.frequency_hz, amplitude, "k:", label="unstable")
axis.plot(truth.frequency_hz, np.where(truth.stable, amplitude, np.nan), "k", lw=0.8, label="harmonic balance")
for run, label in ((up, "sweep up"), (down, "sweep down")):
    (sweep,) = run.sweeps().values()
    displacement = np.abs(sweep.fundamental("drive")) / (2 * np.pi * sweep.frequency_hz) ** 2
    axis.plot(sweep.frequency_hz, 1e3 * displacement, alpha=0.8, lw=2, label=label)
axis.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm", xlim=(23.8, 25.6))
axis.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
