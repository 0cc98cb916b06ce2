"""Forces of all nonlinear sites under a periodic motion: alternating frequency-time (Cameron & Griffin 1989).

The module also contains the Fourier series of this method, and the hysteresis loops of friction joints that follow from it.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from simulators.analysis.kernels import friction_over_a_period, memoryless_over_a_period
from simulators.analysis.responses import HysteresisLoop, PeriodicResponses
from simulators.plant.sites import local_sites
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError

_RELATIVE_STEP = 6e-6
"""Half step of the central differences relative to the motion's amplitude, near the cube root of the rounding error."""
_SMALLEST_STEP = 1e-15  # m, or m/s; lower bound of that half step, for a site at rest; chosen


class Series:
    """Series ``y(theta) = Re sum_h Y_h exp(i h theta)`` up to harmonic H, sampled N times over a period.

    Its real coefficients are ``[Y_0, Re Y_1 ... Re Y_H, Im Y_1 ... Im Y_H]``, P = 2 H + 1 of them.
    """

    def __init__(self, harmonics: int, samples: int) -> None:
        self.harmonics = harmonics
        self.samples = samples
        self.size = 2 * harmonics + 1
        self.orders = np.arange(harmonics + 1)

    @cached_property
    def basis(self) -> Float:
        """Matrix [N, P] from coefficients to samples."""
        angles = np.outer(2.0 * np.pi * np.arange(self.samples) / self.samples, self.orders[1:])
        return np.ascontiguousarray(np.hstack([np.ones((self.samples, 1)), np.cos(angles), -np.sin(angles)]))

    @cached_property
    def projection(self) -> Float:
        """Matrix [P, N] from samples to coefficients."""
        projection = self.basis.T * (2.0 / self.samples)
        projection[0] *= 0.5
        return np.ascontiguousarray(projection)

    def to_complex(self, coefficients: Float) -> Complex:
        """Return harmonics [n, H + 1, ...] from coefficients [n, P, ...]."""
        packed = coefficients[:, : self.harmonics + 1].astype(np.complex128)
        packed[:, 1:] += 1j * coefficients[:, self.harmonics + 1 :]
        return packed

    def to_real(self, harmonics: Complex) -> Float:
        """Return coefficients [n, P, ...] from harmonics [n, H + 1, ...]."""
        return np.concatenate([harmonics.real, harmonics[:, 1:].imag], axis=1)

    def waveforms(self, harmonics: Complex) -> Float:
        """Return samples [n, N] from harmonics [n, H + 1]."""
        return np.asarray(self.to_real(harmonics) @ self.basis.T)


class SiteWaves(NamedTuple):
    """Forces of the sites over one period, and their derivatives by the coefficients of the motion."""

    forces: Float
    """Forces on the structure [n_site, N], without the linear parts that belong to the linear plant."""
    jacobian: Float
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

    def __call__(self, series: Series, coefficients: Float) -> SiteWaves:
        """Return the forces for site coordinates with the given coefficients [n_site, P]."""
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

    def _local(self, series: Series, motion: Float, forces: Float, jacobian: Float) -> bool:
        """Fill forces and Jacobian of the sites without memory, which may act on each other; return whether one is beyond."""
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


def hysteresis_loops(
    rig: VirtualRig, responses: PeriodicResponses, point: int, *, samples: int = 512
) -> tuple[HysteresisLoop, ...]:
    """Return the loops of all friction joints of a rig, in the order of ``rig.friction``.

    Parameters
    ----------
    rig
        The virtual rig.
    responses
        Its periodic responses.
    point
        Number of a point of the responses.
    samples
        Samples of one period of a loop.
    """
    n_point, _, n_harmonic = responses.site_harmonics.shape
    if not -n_point <= point < n_point:
        raise InputError(field="point", value=point, allowed=f"{-n_point} to {n_point - 1}")
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
