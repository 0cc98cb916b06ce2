"""Which numbers of a fitted structured model the data tell, and their 95 % intervals."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.models.structured.laws import Transform
from identification.models.structured.parameters import Parameters
from vibrolock.arrays import Float

_TWO_SIDED_95 = 1.96
_AT_BOUND = 1e-6
"""Relative distance within which a number is at a bound of the fit."""


class FittedNumber(NamedTuple):
    """A number of a fitted model with its 95 % interval, in its own unit.

    The interval is that of what the fit moves (`Law.free`): relative for numbers that are above zero. It is as certain as the
    covariance.
    """

    name: str
    """Its name in the fit."""
    value: float
    """What was fitted."""
    low: float
    """Lower end of the interval; NaN if the data do not depend on the number."""
    high: float
    """Upper end."""
    unknown: str
    """Why the data do not tell it: ``at its bound``, ``no effect`` or ``wide`` (interval wider than the number); else empty."""


def fitted_numbers(
    parameters: Parameters, vector: Float, covariance: Float, unseen: Sequence[str]
) -> tuple[FittedNumber, ...]:
    """Return the frequencies, damping ratios and numbers of laws and support that are free.

    Components of shapes and directions, and feed-throughs, are left out: about zero they are known as well as elsewhere.

    Parameters
    ----------
    parameters
        Which numbers are free.
    vector
        float[P], their values.
    covariance
        float[P, P].
    unseen
        Names of those on which the data do not depend.
    """
    half = _TWO_SIDED_95 * np.sqrt(np.diag(covariance))
    bounds = parameters.bounds(vector)
    at_bound = np.any([np.isclose(vector, bound, rtol=_AT_BOUND, atol=0.0) for bound in bounds], axis=0)
    return tuple(
        _number(name, transform, (vector[k], half[k]), bool(at_bound[k]), name in unseen)
        for k, (name, transform) in enumerate(zip(parameters.names, parameters.transforms, strict=True))
        if transform is not None
    )


def _number(name: str, transform: Transform, moved: Sequence[float], at_bound: bool, unseen: bool) -> FittedNumber:
    value, half = moved
    low, number, high = (float(transform.back(np.asarray(value + shift))) for shift in (-half, 0.0, half))
    wide = high - low >= (abs(number) if transform.size is None else transform.size)
    no_effect = unseen or not half > 0.0
    unknown = "at its bound" if at_bound else "no effect" if no_effect else "wide" if wide else ""
    return FittedNumber(name, number, *((np.nan, np.nan) if no_effect else (low, high)), unknown)
