"""
A nonlinear state-space model of a multisine
============================================

Two states and polynomials of both, fitted over time to realisations of a multisine, and judged on one that the fit has not
seen. The linear start shows what the polynomials add.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from identification import FitSettings, identify_pnlss

plan = rig.load_plan("magnet-beam/multisine-2").model_copy(update={"realisations": 3, "resolution_hz": 0.25})
records = rig.run(plan).experiments(outputs=["drive"], rate_hz=250.0)
fit = identify_pnlss(records[:2], states=2, validation=records[2:], settings=FitSettings(iterations=8))
fit.plot()

# %%
# The record of the validation, its spectrum, and what is left by the linear start and by the model.

unseen = records[2]
measured = unseen.outputs[0]
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
frequency = np.fft.rfftfreq(measured.size, 1 / unseen.sample_rate_hz)
shown = (frequency > 5) & (frequency < 90)
for values, label in (
    (measured, "measured"),
    (measured - fit.linear.simulate(unseen.inputs).outputs[0, -measured.size :], "error of the linear start"),
    (measured - fit.model.simulate(unseen.inputs).outputs[0, -measured.size :], "error of the model"),
):
    amplitude = 2 * np.abs(np.fft.rfft(values)) / values.size
    axis.semilogy(frequency[shown], amplitude[shown], ".", ms=3, label=label)
axis.set(xlabel="frequency, Hz", ylabel="acceleration, m/s²", ylim=(1e-4, None))
axis.legend()
plt.show()
