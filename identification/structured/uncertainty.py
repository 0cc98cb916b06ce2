"""What the covariance of a fit says of anything that its model predicts."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from identification.channels import find_role
from identification.structured.fit import StructuredFit
from identification.structured.model import StructuredModel
from identification.structured.parameters import Parameters

__all__ = ["std_of"]

Float = NDArray[np.float64]

_SHARE = 0.1
"""Steps of the central differences relative to the standard errors of the numbers."""


def std_of(fit: StructuredFit, quantity: Callable[[StructuredModel], Float]) -> Float:
    """Return standard errors of what a function computes of a model, float[k], by central differences along the free numbers.

    Linear in the errors, and as certain as `StructuredFit.covariance`. The steps follow the principal axes of the covariance,
    so that what the data do not tell apart moves together.
    """
    drive = find_role(fit.start.outputs, "drive")
    poles = sum(name.startswith("frequency ") for name in fit.names)
    parameters = Parameters(fit.start, (drive,), "support" in fit.names, poles=poles)
    size = np.sqrt(np.diag(fit.covariance))
    unit = np.where(size > 0.0, size, 1.0)
    values, axes = np.linalg.eigh(fit.covariance / np.outer(unit, unit))
    parts = []
    for value, axis in zip(values.tolist(), axes.T, strict=True):
        if value <= 0.0:
            continue
        step = _SHARE * np.sqrt(value) * axis * size
        more, less = (quantity(parameters.model(fit.values + sign * step)) for sign in (1.0, -1.0))
        parts.append((more - less) / (2.0 * _SHARE))
    return np.asarray(np.linalg.norm(parts, axis=0))
