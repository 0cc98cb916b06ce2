"""Compiled plant: exact linear part, nonlinear site forces by a second-order exponential predictor-corrector (ETD2-PC).

Over a sub-step of length h the linear part ``x' = A x + B_u u + B_f f`` is solved exactly for a held voltage u and a
force f that changes linearly (Cox & Matthews 2002, exponential time differencing):

    x_1 = e^{hA} x_0 + h phi_1(hA) (B_u u + B_f f_0) + h phi_2(hA) B_f (f_1 - f_0)

The predictor takes f_1 = f_0, the corrector f_1 from the predicted site coordinates; the force is evaluated once more
from the corrected ones and kept. Friction forces of the predictor are provisional: Jenkins elements are committed once.
"""

from importlib import import_module
from typing import Any

import numpy as np
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from simulators.layout import CLEARANCE, CUBIC, MAGNET_ONE_SIDED, MAGNET_RANGE, MAGNET_SYMMETRIC, RigArrays, RigState
from vibrolock.compiled import Record, kernel

ir: Any = import_module("llvmlite.ir")  # it has no types


def _call_at(typing: Any, address: Any, z: Any, parameters: Any) -> Any:
    """``double (*)(double, const double *)`` at an address, called without any Python, for the user's own functions."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        prototype = ir.FunctionType(double, [double, double.as_pointer()])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        return builder.call(function, [arguments[1], builder.inttoptr(arguments[2], double.as_pointer())])

    return types.float64(types.int64, types.float64, types.uintp), generate


call_at: Any = intrinsic(_call_at)


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
def magnet_force(site: Record, z: float) -> float:
    """Force (N) of a magnet at deflection ``z`` (m).

    Scheel et al.: ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 + K0/(d0+z)^4`` symmetric. Beyond the limit of
    validity the force goes on along its tangent, so that it stays finite; the sample is flagged.
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
def local_force(site: Record, z: float) -> float:
    """Force (N) of one site without memory at coordinate ``z`` (m or m/s), minus its linear part.

    The laws are those of `simulators.elements`.
    """
    if site.kind <= MAGNET_SYMMETRIC:
        force = magnet_force(site, z)
    elif site.kind == CUBIC:
        force = -(site.quadratic + site.strength * z) * z * z
    elif site.kind == CLEARANCE:
        force = -site.strength * (max(z - site.gap, 0.0) + min(z + site.other_gap, 0.0))
    else:
        force = call_at(site.address, z, site.parameters.ctypes.data)
    return float(force + site.stiffness * z)


@kernel
def local_forces(
    sites: NDArray[Any], coordinates: NDArray[np.float64], first: int, forces: NDArray[np.float64]
) -> bool:
    """Forces of the sites without memory, whose coordinates begin at ``first``; True where a magnet is beyond its limit."""
    beyond = False
    for s in range(sites.size):
        z = coordinates[first + s]
        forces[s] = local_force(sites[s], z)
        beyond |= abs(z) > sites[s].limit
    return beyond


@kernel
def clip(value: float, limit: float) -> float:
    """``value`` within plus and minus ``limit``."""
    value = limit if value > limit else value
    return -limit if value < -limit else value


@kernel
def advance(rig: RigArrays, state: RigState, voltage: float) -> int:
    """Advance the plant by one sample with ``voltage`` (V) held; returns MAGNET_RANGE or 0.

    Jenkins sites, minus their stuck linear part: ``k delta - sum_j f_j``; each element slips at its limit, ``f_j <-
    clip(f_j + k_j d(delta), +-k_j delta_j)`` from its committed force. They stand here and not in a function of their own:
    its arguments would cost more than its work. Four elements at a time, whose sums do not wait for each other.
    """
    step, correct, sites, elements, stuck = rig.step, rig.correct, rig.sites, rig.elements, rig.stuck
    inputs, rows, forces, friction, deflection = (
        state.inputs,
        state.rows,
        state.forces,
        state.friction,
        state.deflection,
    )
    n, n_local = rig.plant[0].n_state, rig.plant[0].n_local
    _, n_jenkins, n_element = elements.shape
    n_site = n_local + n_jenkins
    beyond = False
    inputs[n] = voltage
    for _ in range(rig.plant[0].substeps):
        combine(step, inputs, rows)
        for corrected in range(2):
            beyond |= local_forces(sites, rows, n, forces)
            for s in range(n_jenkins):
                z = rows[n + n_local + s]
                dz = z - deflection[s]
                sum_0, sum_1, sum_2, sum_3 = 0.0, 0.0, 0.0, 0.0
                for e in range(0, n_element, 4):
                    f_0 = clip(friction[s, e] + elements[0, s, e] * dz, elements[1, s, e])
                    f_1 = clip(friction[s, e + 1] + elements[0, s, e + 1] * dz, elements[1, s, e + 1])
                    f_2 = clip(friction[s, e + 2] + elements[0, s, e + 2] * dz, elements[1, s, e + 2])
                    f_3 = clip(friction[s, e + 3] + elements[0, s, e + 3] * dz, elements[1, s, e + 3])
                    if corrected:
                        friction[s, e], friction[s, e + 1], friction[s, e + 2], friction[s, e + 3] = f_0, f_1, f_2, f_3
                    sum_0 += f_0
                    sum_1 += f_1
                    sum_2 += f_2
                    sum_3 += f_3
                forces[n_local + s] = stuck[s] * z - ((sum_0 + sum_1) + (sum_2 + sum_3))
            if not corrected:
                for s in range(n_site):
                    change = forces[s] - inputs[n + 1 + s]
                    for i in range(rows.size):
                        rows[i] += change * correct[s, i]
        for s in range(n_site):
            inputs[n + 1 + s] = forces[s]
        for s in range(n_jenkins):
            deflection[s] = rows[n + n_local + s]
        for i in range(n):
            inputs[i] = rows[i]
    return MAGNET_RANGE if beyond else 0
