"""
Stepped sine at a held force, and its jump
==========================================

The force is held and the frequency stepped up. At the fold of the response the vibration jumps down to the lower branch, and
the unstable branch between is not measured.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response

change = {"levels_n": (0.25,), "start_hz": 24.3, "stop_hz": 24.8, "steps": 11}
run = rig.run(rig.load_plan("magnet-beam/stepped-sine-up").model_copy(update=change))
run.plot()

# %%
# Harmonic balance says where the folds are: where the curve turns back in frequency.

(measured,) = run.frequency_responses()
truth = constant_force_response(make_daq(rig.load_bench("magnet-beam")).rig, 0.25, np.arange(-172, -7, 4))
folds = np.flatnonzero(np.diff(truth.stable.astype(int)))

figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
amplitude = 1e3 * truth.amplitude_m
axis.plot(truth.frequency_hz, amplitude, "C0:", label="unstable at constant force")
axis.plot(truth.frequency_hz, np.where(truth.stable, amplitude, np.nan), "C0", label="harmonic balance")
axis.plot(truth.frequency_hz[folds], amplitude[folds], "sC2", mfc="w", label="folds")
axis.plot(measured.frequency_hz, 1e3 * measured.amplitude_m, "oC1--", lw=0.8, label="stepped up at 0.25 N")
axis.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm", xlim=(24.2, 24.9))
axis.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
