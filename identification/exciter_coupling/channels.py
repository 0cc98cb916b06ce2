"""What a run of a model with its exciter begins with: voltage, channels at the drive point, lowest frequency."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.experiments.simulators import Driven
from identification.validation import finite_array, positive
from vibrolock.arrays import Float

_HIGHEST = 0.45
"""Upper limit of the lowest frequency, over the sample rate: the exciter's reaction needs lines above it. Chosen."""


class DrivePoint(NamedTuple):
    """What is known before a run with an exciter."""

    voltage_v: Float
    """float[n], recorded voltage."""
    row: int
    """Row of the force among the inputs of the model."""
    output: int
    """Row of the drive point among its outputs."""
    order: int
    """How often that output is differentiated: 0 for a displacement, 2 for an acceleration."""
    lowest_hz: float
    """Frequency above which the exciter's reaction is exact."""


def drive_point(
    model: Driven, rate_hz: float, voltage_v: ArrayLike, lowest_hz: float | None, default_hz: Callable[[], float]
) -> DrivePoint:
    """Return what a run begins with.

    Raises
    ------
    IdentificationError
        If values are NaN or infinite, or the model lacks these channels.
    """
    v = finite_array("voltage_v", voltage_v, np.float64, 1)
    row, output = driven_rows(model)
    low = default_hz() if lowest_hz is None else positive("lowest_hz", lowest_hz, "Hz")
    if low >= _HIGHEST * rate_hz:
        raise IdentificationError(field="lowest_hz", value=low, allowed=f"well below half of {rate_hz:g} Hz")
    return DrivePoint(v, row, output, MOTION_ORDER[model.outputs[output].motion], low)


def driven_rows(model: Driven) -> tuple[int, int]:
    """Return the rows of the force among the inputs, and of the drive point among the outputs.

    Raises `IdentificationError` if there is none, or there are other inputs.
    """
    forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
    if len(forces) != 1:
        raise IdentificationError(
            f"has {len(forces)} forces among its inputs", field="model", allowed="one, which the exciter makes"
        )
    others = [channel.name for row, channel in enumerate(model.inputs) if row != forces[0]]
    if others:
        raise IdentificationError(
            f"has inputs beside its force ({', '.join(others)}), whose values a run with an exciter does not know",
            field="model",
            allowed="a model of the force alone",
        )
    return forces[0], find_role(model.outputs, "drive")
