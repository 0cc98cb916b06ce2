"""Modal assurance criterion between all modes of two modal models."""

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.linear.modes import LinearModes

__all__ = ["mac_matrix"]


def mac_matrix(a: LinearModes, b: LinearModes) -> NDArray[np.float64]:
    """float[n_modes of a, n_modes of b]: ``(x^T y)^2 / (x^T x y^T y)`` of the shapes at the channels that both have.

    Raises `IdentificationError` where they have no channel in common.
    """
    names = [channel.name for channel in b.channels]
    common = [(row, names.index(channel.name)) for row, channel in enumerate(a.channels) if channel.name in names]
    if not common:
        raise IdentificationError(
            f"channels: {', '.join(c.name for c in a.channels)} and {', '.join(names)} share none"
        )
    x, y = a.shapes[[i for i, _ in common]], b.shapes[[j for _, j in common]]
    product = np.outer(np.sum(x**2, axis=0), np.sum(y**2, axis=0))
    return np.asarray((x.T @ y) ** 2 / np.where(product > 0.0, product, 1.0))
