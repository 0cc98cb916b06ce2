"""
A parameter study on a Dask cluster
===================================

``ensemble`` sends rigs to whatever joblib is told to use. Here that is a Dask cluster of two workers on this machine; the
address of a scheduler in its place is all that a real cluster needs. Dask is a library of its own: ``pip install distributed``.

The study asks how the gap to the magnet and its strength set the hardening.
"""

import matplotlib.pyplot as plt
import numpy as np
from distributed import Client, LocalCluster
from joblib import parallel_config

from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from simulators.ensemble import ensemble

GAPS_M = np.array([9e-3, 10e-3, 11e-3, 12e-3, 13e-3])
STRENGTHS_N_M4 = 8.353e-8 * np.array([0.6, 0.8, 1.0, 1.2])


def hardening(virtual_rig):
    """Rise of the modal frequency from 0.1 to 1.2 mm at the drive point, in per cent."""
    return 100 * phase_resonance_backbone(virtual_rig, amplitudes_m=[1e-4, 5e-4, 1.2e-3]).frequency_shift


def with_magnet(gap_m, strength_n_m4):
    """Return the shipped beam with another magnet."""
    magnet = {"kind": "magnet-one-sided", "at": "magnet", "gap_m": gap_m, "strength_n_m4": strength_n_m4}
    return VirtualRig.shipped("magnet-beam", elements=[magnet])


if __name__ == "__main__":  # workers may be started by importing this file
    variants = [with_magnet(gap, strength) for strength in STRENGTHS_N_M4 for gap in GAPS_M]
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster),
        parallel_config(backend="dask"),
    ):
        found = np.array([rise for _, rise in ensemble(variants, hardening)])

    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for strength, rise in zip(STRENGTHS_N_M4, found.reshape(STRENGTHS_N_M4.size, -1), strict=True):
        axis.plot(1e3 * GAPS_M, rise, "o-", label=f"{strength:.2g} N m⁴")
    axis.set(xlabel="gap to the magnet, mm", ylabel="rise of the modal frequency, 0.1 to 1.2 mm, %")
    axis.legend(title="strength of the magnet")
    plt.show()
