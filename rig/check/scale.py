"""What a check measured of the scale of force and motion, for runs to compare with."""

import math

import numpy as np

from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.check.responses import Mode, Responses

BANDWIDTHS = 8.0
"""Half width of the band around the mode in which volts per acceleration are fitted, in half bandwidths."""
FEWEST = 5  # lines of such a fit
LARGEST_ERROR = 0.3  # relative misfit from which the fit does not say how many volts the motion needs


def scale_of(bench: Bench, responses: Responses, mode: Mode | None, at: str = "") -> CheckedScale | None:
    """Return the scale at the resonance of the mode under test; None if the check does not tell it.

    The accelerance at resonance is ``|phi_d^2| / (2 zeta)`` by the mode's residue. Volts per acceleration are
    ``u / A = beta + alpha / Y`` with the exciter ``u = alpha F + beta A`` and the accelerance Y of the structure. One over Y is
    a polynomial near a mode, so that the sum is smooth across the resonance: a parabola is fitted to the lines around it.
    """
    drive = bench.index_of("drive")
    if mode is None or not mode.damping_ratio > 0.0:
        return None
    per_newton = abs(mode.residue[0]) / (2.0 * mode.damping_ratio)
    off = responses.frequency_hz / mode.frequency_hz - 1.0
    order = np.argsort(np.abs(off), kind="stable")
    near = np.abs(off) <= max(BANDWIDTHS * mode.damping_ratio, float(np.abs(off[order[min(FEWEST, off.size) - 1]])))
    if np.count_nonzero(near) < FEWEST or not np.all(np.abs(responses.per_volt[drive][near]) > 0.0):
        return None
    volts = 1.0 / responses.per_volt[drive][near]
    terms = np.vander(off[near], 3)
    found, *_ = np.linalg.lstsq(terms.astype(complex), volts, rcond=None)
    left = np.linalg.norm(volts - terms @ found) / np.linalg.norm(volts)
    if not (left <= LARGEST_ERROR and abs(found[-1]) > 0.0 and 0.0 < per_newton < math.inf):
        return None
    return CheckedScale(
        at=at,
        frequency_hz=mode.frequency_hz,
        damping_ratio=mode.damping_ratio,
        acceleration_per_newton=float(per_newton),
        acceleration_per_volt=float(1.0 / abs(found[-1])),
    )
