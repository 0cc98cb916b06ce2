"""Compiled plant: exact linear part, nonlinear site forces by a second-order exponential predictor-corrector (ETD2-PC).

Over a sub-step of length h the linear part ``x' = A x + B_u u + B_f f`` is solved exactly for a held voltage u and a
force f that changes linearly (Cox & Matthews 2002, exponential time differencing):

    x_1 = e^{hA} x_0 + h phi_1(hA) (B_u u + B_f f_0) + h phi_2(hA) B_f (f_1 - f_0)

The predictor takes f_1 = f_0, the corrector f_1 from the predicted site coordinates; the force is evaluated once more
from the corrected ones and kept. Friction forces of the predictor are provisional: Jenkins elements are committed once.
"""

import numpy as np
from numpy.typing import NDArray

from simulators.layout import MAGNET_ONE_SIDED, MAGNET_RANGE, RigArrays, RigState
from vibrolock.compiled import Record, kernel


@kernel
def combine(columns: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """``out = sum_j weights[j] columns[j]``; both lengths are multiples of four.

    Four columns at a time, so that the inner loop runs over contiguous rows with few loads and stores.
    """
    n_column, n_row = columns.shape
    for i in range(n_row):
        out[i] = 0.0
    for j in range(0, n_column, 4):
        a, b, c, d = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
        for i in range(n_row):
            out[i] += (a * columns[j, i] + b * columns[j + 1, i]) + (c * columns[j + 2, i] + d * columns[j + 3, i])


@kernel
def local_force(site: Record, z: float) -> float:
    """Force (N) of one site without memory at deflection ``z`` (m), minus its linear part.

    Magnets (Scheel et al.): ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 + K0/(d0+z)^4`` symmetric. Beyond the
    limit of validity the force goes on along its tangent, so that it stays finite; the sample is flagged.
    """
    held = min(max(z, -site.limit), site.limit)
    near = 1.0 / (site.gap - held)
    near_4 = (near * near) * (near * near)
    force = site.offset - site.strength * near_4
    slope = -4.0 * site.strength * near_4 * near
    if site.kind != MAGNET_ONE_SIDED:
        far = 1.0 / (site.gap + held)
        far_4 = (far * far) * (far * far)
        force += site.strength * far_4
        slope -= 4.0 * site.strength * far_4 * far
    if held != z:
        force += slope * (z - held)
    return float(force + site.stiffness * z)


@kernel
def friction_forces(
    rig: RigArrays, state: RigState, first: int, after: NDArray[np.float64], forces: NDArray[np.float64]
) -> None:
    """Forces of the Jenkins sites minus their stuck linear part: ``k_stuck delta - sum_j f_j``.

    Each element slips at its limit: ``f_j <- clip(f_j + k_j d(delta), +-k_j delta_j)``, from the committed state into
    ``after``. ``first``: row of the first site. All sites side by side, so that the compiled loop runs over whole vectors.
    """
    stiffness, limit, before, total = rig.jenkins_stiffness, rig.jenkins_limit, state.friction, state.friction_sum
    n_element, n_padded = stiffness.shape
    for s in range(n_padded):
        total[s] = 0.0
    for e in range(n_element):
        for s in range(n_padded):
            force = before[e, s] + stiffness[e, s] * (state.rows[first + s] - state.deflection[s])
            force = min(max(force, -limit[e, s]), limit[e, s])
            after[e, s] = force
            total[s] += force
    n_local = rig.sites.size
    for s in range(rig.plant[0].n_jenkins):
        forces[n_local + s] = rig.stuck[s] * state.rows[first + s] - total[s]


@kernel
def site_forces(
    rig: RigArrays, state: RigState, friction_after: NDArray[np.float64], forces: NDArray[np.float64]
) -> bool:
    """All site forces from the site coordinates in ``state.rows``; True where a magnet is beyond its limit."""
    beyond = False
    n = rig.plant[0].n_state
    for s in range(rig.sites.size):
        z = state.rows[n + s]
        forces[s] = local_force(rig.sites[s], z)
        beyond |= abs(z) > rig.sites[s].limit
    if rig.plant[0].n_jenkins > 0:
        friction_forces(rig, state, n + rig.sites.size, friction_after, forces)
    return beyond


@kernel
def advance(rig: RigArrays, state: RigState, voltage: float) -> int:
    """Advance the plant by one sample with ``voltage`` (V) held; returns MAGNET_RANGE or 0."""
    plant = rig.plant[0]
    n = plant.n_state
    n_local = plant.n_local
    n_site = n_local + plant.n_jenkins
    inputs, rows = state.inputs, state.rows
    flags = 0
    inputs[n] = voltage
    for _ in range(plant.substeps):
        combine(rig.step, inputs, rows)
        site_forces(rig, state, state.friction_trial, state.forces)
        for s in range(n_site):
            change = state.forces[s] - inputs[n + 1 + s]
            for i in range(rows.size):
                rows[i] += change * rig.correct[s, i]
        if site_forces(rig, state, state.friction, state.forces):
            flags = MAGNET_RANGE
        for s in range(n_site):
            inputs[n + 1 + s] = state.forces[s]
        for s in range(plant.n_jenkins):
            state.deflection[s] = rows[n + n_local + s]
        for i in range(n):
            inputs[i] = rows[i]
    return flags
