"""Derivatives of a system's monomials, gathered: those of a cubic model are a handful of products, however many monomials."""

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.fitting.layout import Slopes, System
from identification.pnlss.kernels import Table

__all__ = ["slopes_of"]

Float = NDArray[np.float64]


def slopes_of(system: System) -> Slopes:
    """``E d phi / d x`` and ``F d chi / d x`` of the monomials of a system as combinations of the fewest products."""
    n, outputs = system.state.shape[0], system.output.shape[0]
    found: dict[tuple[int, ...], Float] = {}
    for first, matrix, table in ((0, system.state, system.state_table), (n, system.output, system.output_table)):
        variables = table.limits.size
        for index, row in enumerate(table.factors):
            factors = [int(j) for j in row if j >= 0]
            for position, j in enumerate(factors):
                if j >= n:
                    continue
                rest = tuple(factors[:position] + factors[position + 1 :])
                shares = found.setdefault(rest, np.zeros((n + outputs, n)))
                shares[first : first + len(matrix), j] += matrix[:, variables + index]
    degree = max((len(rest) for rest in found), default=0)
    padded = [(*rest, *[-1] * (degree - len(rest))) for rest in found]
    table = Table(
        np.array(padded, dtype=np.int64).reshape(len(found), degree),
        np.minimum(system.state_table.limits, system.output_table.limits),
        np.zeros((0, system.state_table.limits.size + 1)),
        np.zeros(0),
    )
    return Slopes(table, np.array(list(found.values())).reshape(len(found), (n + outputs) * n))
