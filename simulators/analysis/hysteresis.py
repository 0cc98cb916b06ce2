"""Hysteresis loops of friction joints from their harmonics."""

import numpy as np

from simulators.analysis.responses import HysteresisLoop, PeriodicResponses
from simulators.analysis.series import Series
from simulators.analysis.site_forces import SiteForces
from simulators.virtual_rig import VirtualRig

__all__ = ["hysteresis_loops"]


def hysteresis_loops(
    rig: VirtualRig, responses: PeriodicResponses, point: int, *, samples: int = 512
) -> tuple[HysteresisLoop, ...]:
    """Loops of all friction joints of ``rig`` at one point of its responses, in the order of ``rig.friction``."""
    n_point, _, n_harmonic = responses.site_harmonics.shape
    if not -n_point <= point < n_point:
        raise ValueError(f"point = {point}: allowed is {-n_point} to {n_point - 1}")
    series, sites = Series(n_harmonic - 1, samples), SiteForces(rig)
    coefficients = series.to_real(responses.site_harmonics[point])
    first = sites.n_site - len(rig.friction)
    motion = (coefficients @ series.basis.T)[first:]
    forces = sites(series, coefficients).forces[first:]
    loops = []
    for joint, coordinate, force in zip(rig.friction, motion, forces, strict=True):
        restoring = joint.stuck_stiffness * coordinate - force
        loops.append(HysteresisLoop(np.append(coordinate, coordinate[0]), np.append(restoring, restoring[0])))
    return tuple(loops)
