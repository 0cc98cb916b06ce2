"""Arrays of the Runge-Kutta reference from a virtual rig."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators import VirtualRig
from simulators.kernels import aligned, pad


class Rk4Arrays(NamedTuple):
    """The continuous plant: ``derivative`` [n_input, n_row] maps ``[x, u, f]`` to the rates of the rows of a rig."""

    step_s: NDArray[np.float64]
    substeps: NDArray[np.int64]
    plant: NDArray[Any]
    derivative: NDArray[np.float64]
    sites: NDArray[Any]
    elements: NDArray[np.float64]
    stuck: NDArray[np.float64]
    sense: NDArray[np.float64]


class Rk4State(NamedTuple):
    """``inputs``: ``[x, u, f]``; ``start``: rows as in the rig, as is the Jenkins state; the rest is scratch."""

    inputs: NDArray[np.float64]
    start: NDArray[np.float64]
    deflection: NDArray[np.float64]
    friction: NDArray[np.float64]
    rows: NDArray[np.float64]
    slope: NDArray[np.float64]
    total: NDArray[np.float64]
    forces: NDArray[np.float64]
    joints: NDArray[np.float64]
    outputs: NDArray[np.float64]


def build(rig: VirtualRig, substeps: int = 8) -> tuple[Rk4Arrays, Rk4State]:
    """The rig's plant (no sensors, no converters) for ``benchmarks.rk4.kernels.sample``, at rest."""
    arrays, state = rig.build()
    plant = rig.plant
    columns = np.column_stack([plant.dynamics, plant.voltage_column, plant.site_columns])
    rows = np.roll(plant.site_rows, len(rig.friction), axis=0)
    derivative = pad(np.vstack([rows @ columns, columns]).T)
    reference = Rk4Arrays(
        step_s=np.array([1.0 / (rig.converter.sample_rate_hz * substeps)]),
        substeps=np.array([substeps]),
        plant=arrays.plant,
        derivative=derivative,
        sites=arrays.sites,
        elements=arrays.elements,
        stuck=arrays.stuck,
        sense=arrays.sense,
    )
    start, stage, slope, total = (aligned(derivative.shape[1]) for _ in range(4))
    return reference, Rk4State(
        inputs=state.inputs,
        start=start,
        deflection=state.deflection,
        friction=state.friction,
        rows=stage,
        slope=slope,
        total=total,
        forces=state.forces,
        joints=state.joints,
        outputs=state.outputs,
    )
