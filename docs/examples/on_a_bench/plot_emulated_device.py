"""
Another device in the bench's place
===================================

The same plan on the virtual rig and on an emulated device behind a serial port, with the frames of the wire protocol, their
check sums and their latency. Only the bench differs.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.emulator.emulated import emulated

plan = rig.load_plan("magnet-beam/backbone-short")
plan = plan.model_copy(update={"levels_m": plan.levels_m[3:9:2]})
virtual = identification.nonlinear_mode(rig.run(plan).backbone())
with emulated(rig.load_bench("magnet-beam"), "serial", lockstep=True) as bench:
    device = rig.run(plan, bench=bench)
behind_wire = identification.nonlinear_mode(device.backbone())
device

# %%
# The difference of the modal frequencies lies within the intervals.

figure, (frequency, difference) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for mode, marker, label in ((virtual, "o-", "virtual rig"), (behind_wire, "x", "serial device, emulated")):
    frequency.plot(1e3 * mode.amplitude_m, mode.modal_frequency_hz, marker, label=label)
frequency.set(xlabel="displacement amplitude, mm", ylabel="modal frequency, Hz")
frequency.legend()
apart = 1e6 * (behind_wire.modal_frequency_hz / virtual.modal_frequency_hz - 1)
bound = 1e6 * behind_wire.bound_95("modal_frequency_hz") / virtual.modal_frequency_hz
difference.errorbar(1e3 * virtual.amplitude_m, apart, bound, fmt="o")
difference.axhline(0.0, color="k", lw=0.6)
difference.set(xlabel="displacement amplitude, mm", ylabel="device over virtual rig, minus one, 1e-6")
plt.show()
