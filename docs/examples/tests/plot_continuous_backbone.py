"""
A backbone without waiting
==========================

The response is swept up and down while the loop holds phase resonance. Nothing settles; the slow flow says what the settled
points would be. Beside it are settled points of a test that waits.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.measurements import continuous_backbones

run = rig.run("magnet-beam/continuous-backbone")
(continuous,) = continuous_backbones(run.recording)
continuous.plot()

# %%
# Three levels that settle.

plan = rig.load_plan("magnet-beam/backbone").model_copy(
    update={"levels_v": (0.5852, 1.3681, 2.5958), "record_periods": 20}
)
settled = identification.nonlinear_mode(rig.run(plan).backbone())
quick = continuous.nonlinear_mode()

figure, (frequency, damping) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for mode, line, label in ((quick, "-", f"continuous, {continuous.periods:.0f} periods"), (settled, "o", "settled")):
    frequency.plot(1e3 * mode.amplitude_m, mode.modal_frequency_hz, line, label=label)
    damping.plot(1e3 * mode.amplitude_m, 100 * mode.damping_ratio, line)
frequency.set(xlabel="displacement amplitude, mm", ylabel="modal frequency, Hz")
damping.set(xlabel="displacement amplitude, mm", ylabel="modal damping ratio, %")
frequency.legend()
plt.show()
# sphinx_gallery_thumbnail_number = -1
