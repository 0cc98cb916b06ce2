"""
Best linear approximation and distortion
========================================

A random-phase multisine leaves some of its lines out. What answers on these is noise or nonlinear distortion, and even and odd
nonlinearities answer on different lines. The magnet is on one side of the beam: the force is neither even nor odd.
"""

import matplotlib.pyplot as plt
import numpy as np

import identification
import rig

change = {"grid": "odd-random", "resolution_hz": 0.1, "realisations": 3, "levels_rms_v": (0.5,)}
run = rig.run(rig.load_plan("magnet-beam/multisine-2").model_copy(update=change))
(spectra,) = run.spectra().values()

# %%
# How strong the distortion is, channel by channel.

levels = identification.distortion_levels(spectra)
levels

# %%
levels.plot()

# %%
# The best linear approximation with the standard deviation of noise and distortion together.

response = spectra.frequency_response("drive")
figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
axis.semilogy(response.frequency_hz, np.abs(response.value), ".-", label="best linear approximation")
axis.semilogy(response.frequency_hz, response.total_std, label="noise and distortion")
axis.semilogy(response.frequency_hz, response.noise_std, label="noise")
axis.set(xlabel="frequency, Hz", ylabel="acceleration over force, (m/s²)/N")
axis.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
