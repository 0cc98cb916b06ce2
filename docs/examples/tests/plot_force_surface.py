"""
Response-controlled test: one surface, many curves
==================================================

With the displacement held, the response is nearly linear at each level and never jumps. The levels make a surface of the force
over frequency and displacement, from which curves at any constant force are cut, unstable branches included.
"""

import matplotlib.pyplot as plt
import numpy as np

import rig
from rig.drivers import make_daq
from simulators.analysis import constant_force_response

change = {
    "levels_m": (0.00045, 0.00063, 0.00089, 0.00125, 0.00165),
    "phase_lags_deg": (-150.0, -120.0, -90.0, -60.0, -30.0),
}
run = rig.run(rig.load_plan("magnet-beam/response-controlled").model_copy(update=change))
surface = run.force_surface()
surface.plot()

# %%
# Cut at 0.25 N, with the 95 % interval of the amplitude, beside harmonic balance.

curve = surface.constant_force(0.25)
truth = constant_force_response(make_daq(rig.load_bench("magnet-beam")).rig, 0.25, np.arange(-172, -7, 4))
lag = (180 + truth.phase_lag_deg) % 360

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
measured = curve.response
left.plot(truth.frequency_hz, 1e3 * truth.amplitude_m, lw=4, alpha=0.4, label="harmonic balance")
left.plot(measured.frequency_hz, np.where(curve.stable, 1e3 * measured.amplitude_m, np.nan), "C1", label="cut")
left.plot(
    measured.frequency_hz, np.where(curve.stable, np.nan, 1e3 * measured.amplitude_m), "C1:", label="cut, unstable"
)
left.set(xlabel="frequency, Hz", ylabel="displacement amplitude, mm")
left.legend()
right.plot(truth.frequency_hz, lag, lw=4, alpha=0.4)
right.plot(measured.frequency_hz, measured.phase_lag_deg, "C1")
right.set(xlabel="frequency, Hz", ylabel="phase lag, deg")
plt.show()
# sphinx_gallery_thumbnail_number = -1
