"""What the covariance of a fit says of anything that its model predicts."""

from collections.abc import Callable, Iterator

import numpy as np

from identification.channels import find_role
from identification.models.structured.fit import StructuredFit
from identification.models.structured.model import StructuredModel
from identification.models.structured.parameters import Parameters
from vibrolock.arrays import Float

_SHARE = 0.1
"""Steps of the central differences relative to the standard errors of the numbers."""


def std_of(fit: StructuredFit, quantity: Callable[[StructuredModel], Float]) -> Float:
    """Return standard errors of what a function computes of a model, float[k], by central differences along the free numbers.

    Linear in the errors, and as certain as `StructuredFit.covariance`. The steps follow the principal axes of the covariance,
    so that what the data do not tell apart moves together.
    """
    parameters, parts = _parameters_of(fit), []
    for axis in _axes_of(fit):
        step = _SHARE * axis
        more, less = (quantity(parameters.model(fit.values + sign * step)) for sign in (1.0, -1.0))
        parts.append((more - less) / (2.0 * _SHARE))
    return np.asarray(np.linalg.norm(parts, axis=0))


def drawn(fit: StructuredFit, count: int, seed: int = 0) -> Iterator[StructuredModel]:
    """Yield ``count`` models whose free numbers are drawn about those of a fit, from a normal distribution with its covariance.

    Numbers that leave the bounds of a fit are set to them.
    """
    parameters, axes, random = _parameters_of(fit), _axes_of(fit), np.random.default_rng(seed)
    bounds = parameters.bounds(fit.values)
    for _ in range(count):
        yield parameters.model(np.clip(fit.values + random.standard_normal(len(axes)) @ axes, *bounds))


def _parameters_of(fit: StructuredFit) -> Parameters:
    drive = find_role(fit.start.outputs, "drive")
    poles = sum(name.startswith("frequency ") for name in fit.names)
    return Parameters(fit.start, (drive,), "support" in fit.names, poles=poles)


def _axes_of(fit: StructuredFit) -> Float:
    """float[k, P]: principal axes of the covariance, each as long as its standard error."""
    size = np.sqrt(np.diag(fit.covariance))
    unit = np.where(size > 0.0, size, 1.0)
    values, axes = np.linalg.eigh(fit.covariance / np.outer(unit, unit))
    kept = values > 0.0
    return np.asarray((axes[:, kept] * np.sqrt(values[kept])).T * size)
