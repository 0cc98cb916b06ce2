"""
How far a model reaches
=======================

A mode that was identified at small amplitudes only is asked for forces beyond them. Up to its range it is right; beyond it
says so, and up to twice the range it answers only when told to extrapolate.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.drivers import make_daq
from simulators.analysis import phase_resonance_backbone

whole = rig.run("magnet-beam/backbone-short").backbone()
small = whole.select(whole.amplitude_m < 1.1e-3)
mode = identification.nonlinear_mode(small)
responses = identification.steady_predictions(mode, (0.1, 0.2, 0.3, 0.4), largest_range_use=float("inf"))
responses[-1]

# %%
# Peaks of the predicted responses beside harmonic balance at phase resonance; the range of the model is shaded.

truth = phase_resonance_backbone(make_daq(rig.load_bench("magnet-beam")).rig, amplitudes_m=whole.amplitude_m)
figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
for response in responses:
    axis.plot(
        response.frequency_hz,
        1e3 * response.amplitude_m(),
        label=f"{response.name}, range use {response.range_use.max():.2f}",
    )
axis.plot(truth.frequency_hz, 1e3 * truth.amplitude_m, "k--", label="backbone by harmonic balance")
axis.axhspan(0.0, 1e3 * small.amplitude_m.max(), color="0.93", zorder=-1)
axis.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm", xlim=(24.1, 25.2), ylim=(0, None))
axis.legend()
plt.show()
