"""
A nonlinear state-space model of a multisine
============================================

Two states and polynomials of both, fitted over time to realisations of a multisine, and judged on one that the fit has not
seen. The linear start shows what the polynomials add.
"""

import matplotlib.pyplot as plt

import rig
from identification import FitSettings, error_spectra, identify_pnlss

plan = rig.load_plan("magnet-beam/multisine-2").model_copy(update={"realisations": 3, "resolution_hz": 0.25})
records = rig.run(plan).experiments(outputs=["drive"], rate_hz=250.0)
fit = identify_pnlss(records[:2], states=2, validation=records[2:], settings=FitSettings(iterations=8))
fit

# %%
# The spectrum of the record that the fit has not seen, and what is left by the linear start and by the model.

spectra = error_spectra(fit.model, fit.linear, records[2])
figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
for values, label in (
    (spectra.measured, "measured"),
    (spectra.linear_error, "error of the linear start"),
    (spectra.error, "error of the model"),
):
    axis.semilogy(spectra.frequency_hz, values[0], ".", ms=3, label=label)
axis.set(xlabel="frequency, Hz", ylabel="acceleration, m/s²", xlim=(0, 85), ylim=(1e-4, None))
axis.legend(loc="upper right", markerscale=3)
plt.show()
