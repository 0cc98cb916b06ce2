"""Forces of all nonlinear sites under a periodic motion: alternating frequency-time (Cameron & Griffin 1989)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.analysis.kernels import friction_over_a_period, memoryless_over_a_period
from simulators.analysis.series import Series
from simulators.plant.sites import local_sites
from simulators.virtual_rig import VirtualRig

__all__ = ["SiteForces", "SiteWaves"]

Real = NDArray[np.float64]

_RELATIVE_STEP = 6e-6
"""Half step of the central differences over the size of the motion, near the cube root of the rounding error."""
_SMALLEST_STEP = 1e-15


class SiteWaves(NamedTuple):
    """Forces of the sites over one period, and how they change with the coefficients of the motion."""

    forces: Real
    """Forces on the structure [n_site, N], minus the linear parts that the linear plant holds."""
    jacobian: Real
    """Derivative of the force coefficients by the coefficients of the coordinates [n_site, P, n_site, P]."""
    beyond: bool
    """True where a site leaves the range in which its law holds."""


class SiteForces:
    """The nonlinear sites of a rig, in the order of ``rig.plant.site_rows``: those without memory, then the joints."""

    def __init__(self, rig: VirtualRig) -> None:
        self.sites = local_sites(rig.elements, rig.exciter)
        self.n_site = rig.plant.site_rows.shape[0]
        self.n_local = self.n_site - len(rig.friction)
        self.joints = [
            np.array([joint.stiffness, np.multiply(joint.stiffness, joint.slip)], dtype=np.float64)
            for joint in rig.friction
        ]

    def __call__(self, series: Series, coefficients: Real) -> SiteWaves:
        """Forces under coordinates with the given coefficients [n_site, P]."""
        motion = np.ascontiguousarray(coefficients @ series.basis.T)
        forces = np.zeros((self.n_site, series.samples))
        jacobian = np.zeros((self.n_site, series.size, self.n_site, series.size))
        beyond = self._local(series, motion, forces, jacobian)
        tangent = np.empty((series.samples, series.size))
        for s, elements in enumerate(self.joints, start=self.n_local):
            n_element = elements.shape[1]
            scratch = np.empty(n_element), np.empty(n_element, np.int64)
            friction_over_a_period(elements, motion[s], series.basis, *scratch, forces[s], tangent)
            jacobian[s, :, s] = series.projection @ tangent
        return SiteWaves(forces, jacobian, beyond)

    def _local(self, series: Series, motion: Real, forces: Real, jacobian: Real) -> bool:
        """Sites without memory, which may act on each other."""
        n = self.n_local
        if n == 0:
            return False
        local = np.ascontiguousarray(motion[:n].T)
        steps = np.maximum(_RELATIVE_STEP * np.max(np.abs(local), axis=0), _SMALLEST_STEP)
        out, slopes = np.zeros_like(local), np.zeros((series.samples, n, n))
        beyond = memoryless_over_a_period(self.sites, local, steps, np.empty(n), np.empty((2, n)), out, slopes)
        forces[:n] = out.T
        for i, j in zip(*np.nonzero(np.any(slopes, axis=0)), strict=True):
            jacobian[i, :, j] = series.projection @ (slopes[:, i, j, None] * series.basis)
        return bool(beyond)
