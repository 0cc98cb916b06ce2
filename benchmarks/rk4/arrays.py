"""Arrays of the Runge-Kutta reference from a virtual rig."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.plant.discretise import pad
from simulators.virtual_rig import VirtualRig

__all__ = ["Rk4Arrays", "Rk4State", "build"]


class Rk4Arrays(NamedTuple):
    """The continuous plant: ``derivative`` [n_input, n_row] maps ``[x, u, f]`` to x'; ``coordinates`` x to the sites."""

    step_s: NDArray[np.float64]
    substeps: NDArray[np.int64]
    n_state: NDArray[np.int64]
    derivative: NDArray[np.float64]
    coordinates: NDArray[np.float64]
    sites: NDArray[Any]
    elements: NDArray[np.float64]
    stuck: NDArray[np.float64]
    sense: NDArray[np.float64]


class Rk4State(NamedTuple):
    """``inputs`` is the vector ``[x, u, f]``; Jenkins state as in `simulators.layout.RigState`; the rest is scratch."""

    inputs: NDArray[np.float64]
    deflection: NDArray[np.float64]
    friction: NDArray[np.float64]
    start: NDArray[np.float64]
    stage: NDArray[np.float64]
    slope: NDArray[np.float64]
    total: NDArray[np.float64]
    rows: NDArray[np.float64]
    outputs: NDArray[np.float64]


def build(rig: VirtualRig, substeps: int = 8) -> tuple[Rk4Arrays, Rk4State]:
    """The rig's plant (no sensors, no converters) for ``benchmarks.rk4.kernels.sample``, at rest."""
    arrays, state = rig.build()
    plant = rig.plant
    columns = np.column_stack([plant.dynamics, plant.voltage_column, plant.site_columns])
    n = plant.dynamics.shape[0]
    derivative, coordinates = pad(columns.T), pad(plant.site_rows.T)
    reference = Rk4Arrays(
        step_s=np.array([1.0 / (rig.converter.sample_rate_hz * substeps)]),
        substeps=np.array([substeps]),
        n_state=np.array([n]),
        derivative=derivative,
        coordinates=coordinates,
        sites=arrays.sites,
        elements=arrays.elements,
        stuck=arrays.stuck,
        sense=arrays.sense,
    )
    n_row = derivative.shape[1]
    return reference, Rk4State(
        inputs=np.zeros(derivative.shape[0]),
        deflection=state.deflection,
        friction=state.friction,
        start=np.zeros(n),
        stage=np.zeros(coordinates.shape[0]),
        slope=np.zeros(n_row),
        total=np.zeros(n_row),
        rows=np.zeros(coordinates.shape[1]),
        outputs=state.outputs,
    )
