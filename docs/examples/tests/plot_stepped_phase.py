"""
Through the folds: stepped phase
================================

At constant force a hardening structure has up to three vibrations at one frequency, and a test that steps the frequency jumps
between two of them. A test that steps the phase lag passes through all three, for every lag has one vibration.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response

plan = rig.load_plan("magnet-beam/stepped-phase-fast").model_copy(update={"levels_n": (0.55,)})
(measured,) = rig.run(plan).frequency_responses()
measured

# %%
# Beside it is harmonic balance of the coupled rig at the same force; its unstable part is dotted.

truth = constant_force_response(make_daq(rig.load_bench("magnet-beam")).rig, 0.55, np.arange(-172, -7, 4))

figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
amplitude = 1e3 * truth.amplitude_m
axis.plot(truth.frequency_hz, amplitude, "C0:", label="unstable at constant force")
axis.plot(truth.frequency_hz, np.where(truth.stable, amplitude, np.nan), "C0", label="harmonic balance")
axis.plot(measured.frequency_hz, 1e3 * measured.amplitude_m, "oC1", label="stepped phase, 0.55 N")
axis.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm")
axis.legend()
plt.show()
