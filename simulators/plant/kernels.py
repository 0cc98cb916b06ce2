"""Compiled plant: exact linear part, site forces by a third-order exponential multistep method (Adams, one solve a step).

Over a sub-step of length h the linear part ``x' = A x + B_u u + B_f f`` is solved exactly for a held voltage u and a force f
that is a parabola through its last two values and the new one (exponential time differencing, Cox & Matthews 2002; as
predictor and corrector of Adams, Hochbruck & Ostermann 2010, section 2.6). With ``d_0 = f_0 - f_-1``:

    x_p = e^{hA} x_0 + h phi_1(hA) (B_u u + B_f f_0) + h phi_2(hA) B_f d_0
    x_1 = x_p + h (phi_3(hA) + phi_2(hA) / 2) B_f (f_1 - f_0 - d_0)

f_1 is that of the predicted site coordinates. Forces of local sites are then evaluated once more, from the corrected
coordinates, and kept: a stop may be stiff. Those of joints are kept as they are, for the two coordinates differ by a fourth
power of the step.

A joint turns between instants. Its turning point, on a parabola through three of its deflections, is passed through when the
reversal is seen: without that the elements would slip too little, by a second power of the step.
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
from vibrolock.lanes import differ, greatest, least, load, multiply_add, spread, store
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
def turn_joints(rig: RigArrays, state: RigState, first: int) -> None:
    """Move Jenkins elements through the turning points of those of eight joints, from ``first`` on, that have reversed.

    With the last two increments d_1, d_2 of the deflection the vertex lies ``-(d_1 + d_2)^2 / (8 (d_2 - d_1))`` beside the
    deflection between them. An element slips at its limit on the way there; the way back is taken off its force.
    """
    elements, friction = rig.elements, state.friction
    for s in range(first, first + WIDTH):
        before, after = state.increment[s], state.rows[s] - state.deflection[s]
        if before * after < 0.0:
            beyond = -((before + after) ** 2) / (8.0 * (after - before))
            for e in range(elements.shape[1]):
                limit, change = elements[1, e, s], elements[0, e, s] * beyond
                friction[e, s] = min(max(friction[e, s] + change, -limit), limit) - change


@kernel
def joint_forces(rig: RigArrays, state: RigState) -> None:
    """Move the friction joints to the deflections in ``state.rows``; write their forces to ``state.joints``.

    Without the stuck linear part these are ``k delta - sum_j f_j``. Each element slips at its limit:
    ``f_j <- clip(f_j + k_j d(delta), +-k_j delta_j)``. A vector holds the same element of eight joints. Missing joints are
    padded with elements of zero stiffness.
    """
    elements, rows, deflection, friction = rig.elements, state.rows, state.deflection, state.friction
    _, n_element, n_joint = elements.shape
    for s in range(0, n_joint, WIDTH):
        z = load(rows, s)
        dz = z - load(deflection, s)
        way = dz * load(state.increment, s)
        if differ(greatest(way, spread(0.0)), way):
            turn_joints(rig, state, s)
        total = spread(0.0)
        for at in range(s, s + n_element * n_joint, n_joint):
            limit = load(elements, n_element * n_joint + at)
            force = multiply_add(load(elements, at), dz, load(friction, at))
            force = greatest(least(force, limit), spread(0.0) - limit)
            store(friction, at, force)
            total = total + force
        store(state.joints, s, load(rig.stuck, s) * z - total)
        store(state.increment, s, dz)
        store(deflection, s, z)


@inner_kernel
def advance(rig: RigArrays, state: RigState, voltage: float) -> int:
    """Advance the plant by one sample with ``voltage`` (V) held; return the bits LAW_RANGE and AMPLIFIER_CLIPPED, or 0.

    Vectors that are stored beyond their part of the inputs are followed by the part that they overwrite.
    """
    inputs, rows, forces, joints = state.inputs, state.rows, state.forces, state.joints
    changes, increments = state.changes, state.increments
    n, n_local, n_joint = rig.plant[0].n_state, rig.plant[0].n_local, rig.plant[0].n_joint
    n_site = n_local + n_joint
    local, joint = n + 1, n + 1 + n_local  # where their forces begin; their increments are n_site behind
    beyond = False
    limit = rig.plant[0].input_limit_v
    held = min(max(voltage, -limit), limit)
    inputs[n] = held
    for _ in range(rig.plant[0].substeps):
        combine(rig.step, inputs, rows)
        joint_forces(rig, state)
        for s in range(0, n_joint, WIDTH):
            increment = load(joints, s) - load(inputs, joint + s)
            store(increments, n_local + s, increment)
            store(changes, n_local + s, increment - load(inputs, joint + n_site + s))
        if n_local > 0:
            beyond |= local_forces(rig.sites, rows, n_joint, forces)
            for s in range(n_local):
                changes[s] = forces[s] - inputs[local + s] - inputs[local + n_site + s]
        add_columns(rig.correct, changes, rows)
        if n_local > 0:
            beyond |= local_forces(rig.sites, rows, n_joint, forces)
            for s in range(n_local):
                increments[s] = forces[s] - inputs[local + s]
        for i in range(0, n, WIDTH):
            store(inputs, i, load(rows, n_site + i))
        inputs[n] = held
        for s in range(n_local):
            inputs[local + s] = forces[s]
        for s in range(0, n_joint, WIDTH):
            store(inputs, joint + s, load(joints, s))
        for s in range(0, n_site, WIDTH):
            store(inputs, local + n_site + s, load(increments, s))
    return (LAW_RANGE if beyond else 0) | (AMPLIFIER_CLIPPED if held != voltage else 0)
