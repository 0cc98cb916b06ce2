"""
Linear modes and their stabilisation diagram
============================================

A low-level multisine, the frequency responses of all channels, and a modal model fitted to them. A mode counts where poles of
rising model order agree in frequency, damping and shape.
"""

import matplotlib.pyplot as plt
import numpy as np

import identification
import rig
from rig.drivers import make_daq

change = {"levels_rms_v": (0.1,), "resolution_hz": 0.1, "realisations": 2, "highest_hz": 250.0}
run = rig.run(rig.load_plan("magnet-beam/modal").model_copy(update=change))
(responses,) = run.response_matrices().values()

diagram = identification.stabilisation(responses, orders=range(2, 21, 2))
diagram.plot()

# %%
# The fit to the responses; the table gives 95 % intervals.

modes = identification.linear_modes(responses, diagram=diagram)
modes

# %%
analysis = identification.ModalAnalysis(modes, responses, diagram)
analysis.plot()

# %%
# Identified over true. The truth is the finite-element model of the rig. The intervals are those of the noise in two
# realisations; a few thousandths of a per cent in frequency are beyond what the level of the test leaves linear.

truth = make_daq(rig.load_bench("magnet-beam")).rig.linear_modes
nearest = [truth.nearest(frequency) for frequency in modes.frequency_hz]

figure, (frequency, damping) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for axis, found, std, known, name in (
    (frequency, modes.frequency_hz, modes.frequency_std_hz, truth.frequency_hz[nearest], "frequency"),
    (damping, modes.damping_ratio, modes.damping_ratio_std, truth.damping_ratio[nearest], "damping ratio"),
):
    axis.errorbar(np.arange(1, len(nearest) + 1), 100 * (found / known - 1), 196 * std / known, fmt="o")
    axis.axhline(0.0, color="k", lw=0.6)
    axis.set(xlabel="mode", ylabel=f"{name}, identified over true, minus one, %", xticks=range(1, len(nearest) + 1))
plt.show()
# sphinx_gallery_thumbnail_number = 2
