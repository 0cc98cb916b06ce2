"""
A frequency response from a backbone, with its uncertainty
==========================================================

The nonlinear mode knows frequency and damping over the amplitude; that is enough for the response at any force in its range.
Standard errors of the points are carried through by Monte Carlo.
"""

import matplotlib.pyplot as plt
import numpy as np

import identification
import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response

mode = identification.nonlinear_mode(rig.run("magnet-beam/backbone-short").backbone())
predicted = identification.frequency_response(mode, 0.4)
band = identification.response_band(mode, 0.4, draws=100)
predicted

# %%
# Beside harmonic balance of the coupled rig.

truth = constant_force_response(make_daq(rig.load_bench("magnet-beam")).rig, 0.4, np.arange(-172, -7, 4))
lag = (180 + truth.phase_lag_deg) % 360

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
amplitude = 1e3 * predicted.amplitude_m()
left.plot(truth.frequency_hz, 1e3 * truth.amplitude_m, "k.", label="harmonic balance")
left.plot(predicted.frequency_hz, np.where(predicted.stable, amplitude, np.nan), label="predicted from the backbone")
left.plot(predicted.frequency_hz, np.where(predicted.stable, np.nan, amplitude), "C0:", label="unstable")
left.plot(predicted.fold_frequency_hz, 1e3 * predicted.fold_amplitude_m, "sC1", mfc="w", label="folds")
left.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm", xlim=(23.8, 25.6))
left.legend(loc="upper left")

exact = np.interp(lag, predicted.phase_lag_deg(), predicted.amplitude_m())
low, high = band.amplitude_m / np.interp(band.phase_lag_deg, predicted.phase_lag_deg(), predicted.amplitude_m()) - 1
right.fill_between(band.phase_lag_deg, 100 * low, 100 * high, alpha=0.3, label="95 % of the model's own errors")
right.plot(lag, 100 * (truth.amplitude_m / exact - 1), "k.", label="harmonic balance")
right.set(xlabel="phase lag, deg", ylabel="amplitude over predicted, minus one, %", xlim=(20, 160))
right.legend()
plt.show()
