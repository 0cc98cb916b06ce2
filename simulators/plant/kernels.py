"""Compiled plant: exact linear part, nonlinear site forces by a second-order exponential predictor-corrector (ETD2-PC).

Over a sub-step of length h the linear part ``x' = A x + B_u u + B_f f`` is solved exactly for a held voltage u and a force f
that changes linearly (exponential time differencing, Cox & Matthews 2002):

    x_1 = e^{hA} x_0 + h phi_1(hA) (B_u u + B_f f_0) + h phi_2(hA) B_f (f_1 - f_0)

The predictor takes f_1 = f_0. The corrector takes f_1 from the predicted site coordinates. The force is then evaluated from the
corrected coordinates and kept. Friction forces of the predictor are provisional: Jenkins elements are committed once.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from simulators.layout import (
    AMPLIFIER_CLIPPED,
    CLEARANCE,
    CUBIC,
    DAMPING_TABLE,
    DROOP,
    FORCE_TABLE,
    LAW_RANGE,
    MAGNET_ONE_SIDED,
    MAGNET_SYMMETRIC,
    RigArrays,
    RigState,
)
from simulators.products import add_columns, combine
from vibrolock.compiled import Record, inner_kernel, kernel
from vibrolock.lanes import greatest, least, load, spread, store
from vibrolock.width import WIDTH


def _call_at(typing: Any, address: Any, z: Any, parameters: Any) -> Any:
    """Call a user's function ``double (*)(double, const double *)`` at an address, without Python."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        prototype = ir.FunctionType(double, [double, double.as_pointer()])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        return builder.call(function, [arguments[1], builder.inttoptr(arguments[2], double.as_pointer())])

    return types.float64(types.int64, types.float64, types.uintp), generate


call_at: Any = intrinsic(_call_at)


@kernel
def magnet_force(site: Record, z: float) -> float:
    """Return the force (N) of a magnet at deflection ``z`` (m).

    Scheel et al.: ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 + K0/(d0+z)^4`` symmetric. Beyond the limit of
    validity the force continues along its tangent, so that it stays finite; the sample is flagged.
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
    return float(force)


@kernel
def table_force(site: Record, z: float) -> float:
    """Return the restoring force (N) of a force table at deflection ``z`` (m): cubics between nodes, straight lines beyond."""
    last = site.table.shape[1] - 1
    if z <= site.gap:
        return float(site.table[0, 0] + site.quadratic * (z - site.gap))
    if z >= site.other_gap:
        return float(site.table[0, last] + site.strength * (z - site.other_gap))
    at = (z - site.gap) / (site.other_gap - site.gap) * last
    i = min(int(at), last - 1)
    t = at - i
    begin, rise, first, second = (
        site.table[0, i],
        site.table[0, i + 1] - site.table[0, i],
        site.table[1, i],
        site.table[1, i + 1],
    )
    square, cube = 3.0 * rise - 2.0 * first - second, first + second - 2.0 * rise
    return float(begin + t * (first + t * (square + t * cube)))


@kernel
def table_damping(site: Record, z: float) -> float:
    """Return the damping (N s/m) of a damping table at deflection ``z`` (m): lines between nodes, constant beyond."""
    last = site.table.shape[1] - 1
    at = (min(max(z, site.gap), site.other_gap) - site.gap) / (site.other_gap - site.gap) * last
    i = min(int(at), last - 1)
    return float(site.table[0, i] + (at - i) * (site.table[0, i + 1] - site.table[0, i]))


@kernel
def local_force(site: Record, z: float) -> float:
    """Return the force (N) of one site without memory at coordinate ``z`` (m or m/s), minus its linear part.

    The laws are those of `simulators.sites.elements`.
    """
    if site.kind <= MAGNET_SYMMETRIC:
        force = magnet_force(site, z)
    elif site.kind == CUBIC:
        force = -(site.quadratic + site.strength * z) * z * z
    elif site.kind == CLEARANCE:
        force = -site.strength * (max(z - site.gap, 0.0) + min(z + site.other_gap, 0.0))
    elif site.kind == FORCE_TABLE:
        force = -table_force(site, z)
    else:
        force = call_at(site.address, z, site.parameters.ctypes.data)
    return float(force + site.stiffness * z)


@kernel
def local_forces(
    sites: NDArray[Any], coordinates: NDArray[np.float64], first: int, forces: NDArray[np.float64]
) -> bool:
    """Fill ``forces`` of the sites without memory; return whether the coordinate of a site is beyond its limit.

    ``first`` is the index of the sites' first coordinate in ``coordinates``. The force by droop of the force factor, and that
    of a damping table, depend on two coordinates: the site's own, and the one that is ``partner`` places before it.
    """
    beyond = False
    for s in range(sites.size):
        z = coordinates[first + s]
        if sites[s].kind == DROOP:
            x = coordinates[first + s - sites[s].partner]
            forces[s] = (sites[s].quadratic + sites[s].strength * x) * x * z
        elif sites[s].kind == DAMPING_TABLE:
            forces[s] = -table_damping(sites[s], coordinates[first + s - sites[s].partner]) * z
        else:
            forces[s] = local_force(sites[s], z)
            beyond |= abs(z) > sites[s].limit
    return beyond


@kernel
def joint_forces(rig: RigArrays, state: RigState, commit: bool) -> None:
    """Write the forces of the friction joints, without the stuck linear part, to ``state.joints``: ``k delta - sum_j f_j``.

    Starting from its committed force, each element slips at its limit: ``f_j <- clip(f_j + k_j d(delta), +-k_j delta_j)``.
    A vector holds the same element of eight joints. Missing joints are padded with elements of zero stiffness.
    """
    elements, rows, deflection, friction = rig.elements, state.rows, state.deflection, state.friction
    _, n_element, n_joint = elements.shape
    for s in range(0, n_joint, WIDTH):
        z = load(rows, s)
        dz = z - load(deflection, s)
        total = spread(0.0)
        for at in range(s, s + n_element * n_joint, n_joint):
            limit = load(elements, n_element * n_joint + at)
            force = load(friction, at) + load(elements, at) * dz
            force = greatest(least(force, limit), spread(0.0) - limit)
            if commit:
                store(friction, at, force)
            total = total + force
        store(state.joints, s, load(rig.stuck, s) * z - total)
        if commit:
            store(deflection, s, z)


@inner_kernel
def advance(rig: RigArrays, state: RigState, voltage: float) -> int:
    """Advance the plant by one sample with ``voltage`` (V) held; return the bits LAW_RANGE and AMPLIFIER_CLIPPED, or 0."""
    inputs, rows, forces, joints, changes = state.inputs, state.rows, state.forces, state.joints, state.changes
    n, n_local, n_joint = rig.plant[0].n_state, rig.plant[0].n_local, rig.plant[0].n_joint
    first_state, first_local, first_joint = n_joint + n_local, n + 1, n + 1 + n_local
    beyond = False
    limit = rig.plant[0].input_limit_v
    held = min(max(voltage, -limit), limit)
    inputs[n] = held
    for _ in range(rig.plant[0].substeps):
        combine(rig.step, inputs, rows)
        joint_forces(rig, state, False)
        beyond |= local_forces(rig.sites, rows, n_joint, forces)
        for s in range(n_local):
            changes[s] = forces[s] - inputs[first_local + s]
        for s in range(n_joint):
            changes[n_local + s] = joints[s] - inputs[first_joint + s]
        add_columns(rig.correct, changes, rows)
        joint_forces(rig, state, True)
        beyond |= local_forces(rig.sites, rows, n_joint, forces)
        for i in range(0, n, WIDTH):  # values copied beyond x are overwritten at once
            store(inputs, i, load(rows, first_state + i))
        inputs[n] = held
        for s in range(n_local):
            inputs[first_local + s] = forces[s]
        for s in range(n_joint):
            inputs[first_joint + s] = joints[s]
    return (LAW_RANGE if beyond else 0) | (AMPLIFIER_CLIPPED if held != voltage else 0)
