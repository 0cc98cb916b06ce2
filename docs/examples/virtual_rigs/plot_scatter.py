"""
A specimen that is a little different each time
===============================================

Sixteen rigs whose frequencies and damping scatter, drawn from a seed, on two processes. How much do their backbones differ?
"""

import matplotlib.pyplot as plt
import numpy as np

from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from simulators.ensemble import ensemble

AMPLITUDES_M = np.array([2e-4, 6e-4, 1.2e-3, 2e-3])
scatter = {"frequency": 0.002, "damping": 0.03, "magnet_strength": 0.03}


def backbone(seed):
    """Modal frequency (Hz) and damping (%) over the amplitude of one assembly."""
    one = VirtualRig.shipped("magnet-beam", scatter=scatter | {"assembly": seed + 1}).realised(seed)
    found = phase_resonance_backbone(one, amplitudes_m=AMPLITUDES_M)
    return found.modal_frequency_hz, 100 * found.damping_ratio


frequency, damping = np.array([result for _, result in ensemble(range(16), backbone, n_jobs=2)]).swapaxes(0, 1)
nominal = phase_resonance_backbone(VirtualRig.shipped("magnet-beam"), amplitudes_m=AMPLITUDES_M)

figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
for axis, values, known, name in (
    (axes[0], frequency, nominal.modal_frequency_hz, "modal frequency, Hz"),
    (axes[1], damping, 100 * nominal.damping_ratio, "modal damping ratio, %"),
):
    axis.plot(1e3 * AMPLITUDES_M, values.T, color="0.75", lw=0.8)
    axis.plot(1e3 * AMPLITUDES_M, values.mean(axis=0), "o-", label="mean of 16")
    axis.plot(1e3 * AMPLITUDES_M, known, "k--", label="nominal")
    axis.set(xlabel="displacement amplitude, mm", ylabel=name)
axes[0].legend()
plt.show()
