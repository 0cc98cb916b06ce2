"""Segalman's four-parameter Iwan joint (J. Appl. Mech. 72, 2005, 752), cut into sliders."""

import numpy as np

from vibrolock.arrays import Float


def iwan_sliders(stiffness: float, chi: float, beta: float, edges: Float) -> tuple[Float, Float]:
    """Return the stiffness of each slider, and its slip relative to the deflection at which all slip.

    Each slider has the stiffness of its bin of the density ``R phi^chi``, and slips at the mean slip deflection of the bin. The
    end slider is the last; it has ``beta`` times the stiffness of the density. Stuck stiffness and force at full slip are
    exact.

    Parameters
    ----------
    stiffness
        Stiffness of the joint while nothing slips.
    chi
        Exponent of the density.
    beta
        Stiffness of the end slider over that of the density.
    edges
        float[n + 1], deflections from 0 to 1 at which the density is cut.
    """
    share = np.diff(edges ** (chi + 1.0))
    slip = (chi + 1.0) / (chi + 2.0) * np.diff(edges ** (chi + 2.0)) / share
    return stiffness / (1.0 + beta) * np.append(share, beta), np.append(slip, 1.0)
