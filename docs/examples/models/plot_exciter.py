"""
Parameters of a shaker from a test on the structure
===================================================

Voltage, force and acceleration at the drive point of one multisine give the blocked force per volt and the dynamic stiffness of
the armature, and from them the shaker's parameters. The structure stays attached.
"""

import matplotlib.pyplot as plt

import identification
import rig
from rig.drivers import make_daq

plan = rig.load_plan("magnet-beam/exciter").model_copy(update={"realisations": 2, "resolution_hz": 0.2})
(spectra,) = rig.run(plan).spectra().values()
exciter = identification.identify_exciter(spectra, sample_rate_hz=5000.0, source="magnet beam")
exciter

# %%
exciter.plot()

# %%
# Beside the true values of the virtual rig.

true = make_daq(rig.load_bench("magnet-beam")).rig.exciter
known = {
    "moving mass": ("moving_mass_kg", true.armature_mass_kg),
    "suspension stiffness": ("suspension_stiffness_n_m", true.suspension_stiffness_n_m),
    "blocked force per volt": ("force_per_volt_n_v", true.force_factor_n_a / true.resistance_ohm),
}
figure, axis = plt.subplots(figsize=(7, 2.5), layout="constrained")
for row, (name, value) in enumerate(known.values()):
    share = 100 * (getattr(exciter, name) / value - 1)
    axis.errorbar(share, row, xerr=196 * exciter.std[name] / value, fmt="o", color="C0")
axis.axvline(0.0, color="k", lw=0.6)
axis.set_yticks(range(len(known)), known)
axis.set(xlabel="identified over true, minus one, %, with 95 %", ylim=(-0.5, len(known) - 0.5))
plt.show()
