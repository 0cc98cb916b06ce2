"""Arrays of the Runge-Kutta reference from a virtual rig."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.plant.discretise import pad
from simulators.virtual_rig import VirtualRig

__all__ = ["Rk4Arrays", "Rk4State", "build"]


class Rk4Arrays(NamedTuple):
    """The continuous plant: ``derivative`` [n_input, n_row] maps ``[x, u, f]`` to the rates of ``[x, site coordinates]``."""

    step_s: NDArray[np.float64]
    substeps: NDArray[np.int64]
    n_state: NDArray[np.int64]
    derivative: NDArray[np.float64]
    sites: NDArray[Any]
    elements: NDArray[np.float64]
    stuck: NDArray[np.float64]
    sense: NDArray[np.float64]


class Rk4State(NamedTuple):
    """``inputs``: ``[x, u, f]``; ``start``: ``[x, site coordinates]``; Jenkins state as in the rig; the rest is scratch."""

    inputs: NDArray[np.float64]
    start: NDArray[np.float64]
    deflection: NDArray[np.float64]
    friction: NDArray[np.float64]
    stage: NDArray[np.float64]
    slope: NDArray[np.float64]
    total: NDArray[np.float64]
    forces: NDArray[np.float64]
    outputs: NDArray[np.float64]


def build(rig: VirtualRig, substeps: int = 8) -> tuple[Rk4Arrays, Rk4State]:
    """The rig's plant (no sensors, no converters) for ``benchmarks.rk4.kernels.sample``, at rest."""
    arrays, state = rig.build()
    plant = rig.plant
    columns = np.column_stack([plant.dynamics, plant.voltage_column, plant.site_columns])
    derivative = pad(np.vstack([columns, plant.site_rows @ columns]).T)
    reference = Rk4Arrays(
        step_s=np.array([1.0 / (rig.converter.sample_rate_hz * substeps)]),
        substeps=np.array([substeps]),
        n_state=np.array([plant.dynamics.shape[0]]),
        derivative=derivative,
        sites=arrays.sites,
        elements=arrays.elements,
        stuck=arrays.stuck,
        sense=arrays.sense,
    )
    start, stage, slope, total = np.zeros((4, derivative.shape[1]))
    return reference, Rk4State(
        np.zeros(derivative.shape[0]),
        start,
        state.deflection,
        state.friction,
        stage,
        slope,
        total,
        state.forces,
        state.outputs,
    )
