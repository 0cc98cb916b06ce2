"""
From a backbone to a model
==========================

The points of a backbone test become a nonlinear mode: modal frequency and damping over the amplitude, with 95 % intervals.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.drivers import make_daq
from simulators.analysis import phase_resonance_backbone

mode = identification.nonlinear_mode(rig.run("magnet-beam/backbone-short").backbone())

# %%
# In a notebook a result shows itself as a table.

mode

# %%
# ``plot`` draws everything that is known of the mode.

mode.plot()

# %%
# The rig is virtual, and so the truth is known: the same amplitudes at phase resonance by harmonic balance of beam, magnet,
# stinger and shaker. The test did not see it.

truth = phase_resonance_backbone(make_daq(rig.load_bench("magnet-beam")).rig, amplitudes_m=mode.amplitude_m)

figure, (frequency, damping) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
x = 1e3 * mode.amplitude_m
frequency.errorbar(x, mode.modal_frequency_hz, mode.bound_95("modal_frequency_hz"), fmt="o", label="test, 95 %")
frequency.plot(x, truth.modal_frequency_hz, label="harmonic balance")
damping.errorbar(x, 100 * mode.damping_ratio, 100 * mode.bound_95("damping_ratio"), fmt="o")
damping.plot(x, 100 * truth.damping_ratio)
frequency.set(xlabel="displacement amplitude, mm", ylabel="modal frequency, Hz")
damping.set(xlabel="displacement amplitude, mm", ylabel="modal damping ratio, %")
frequency.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
