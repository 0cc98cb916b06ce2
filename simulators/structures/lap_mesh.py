"""Mesh of two beams with a lap joint: two full-thickness arms, and in the lap two half-thickness legs.

Every node has three coordinates ``(u, w, theta)`` on the mid-plane of the whole beam, which in the lap is the interface:
axial displacement, deflection, rotation ``w'``. A leg's own axis lies a quarter of the thickness above or below, so that
``u_axis = u - e theta``: bending drags the legs' interfaces against each other. The upper leg grows out of the arm at
position 0, the lower one out of the other arm; each shares a node with it and is free at its other end.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simulators.structures.beam import Quantity, hermite

__all__ = ["LapMesh", "bending_dofs"]

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class LapMesh:
    """Nodes, numbered along the left arm, the rest of the upper leg, the lower leg, the rest of the right arm."""

    length_m: float
    lap_length_m: float
    thickness_m: float
    n_arm: int
    """Elements in each arm."""
    n_lap: int
    """Elements in each leg."""

    @cached_property
    def positions_m(self) -> Matrix:
        """Ends of all elements [2 n_arm + n_lap + 1], from end to end."""
        first, last = (self.length_m - self.lap_length_m) / 2.0, (self.length_m + self.lap_length_m) / 2.0
        arms = np.linspace(0.0, first, self.n_arm + 1), np.linspace(last, self.length_m, self.n_arm + 1)
        return np.concatenate([arms[0], np.linspace(first, last, self.n_lap + 1)[1:-1], arms[1]])

    @property
    def n_dof(self) -> int:
        """Number of coordinates."""
        return 3 * (2 * self.n_arm + 2 * self.n_lap + 2)

    @property
    def legs(self) -> tuple[list[int], list[int]]:
        """Node numbers of the upper and the lower leg."""
        a, n = self.n_arm, self.n_lap
        return list(range(a, a + n + 1)), list(range(a + n + 1, a + 2 * n + 2))

    @property
    def lap_positions_m(self) -> Matrix:
        """Positions of the legs' nodes [n_lap + 1]."""
        return self.positions_m[self.n_arm : self.n_arm + self.n_lap + 1]

    def members(self, element: int) -> list[tuple[int, int, float]]:
        """Left node, right node and eccentricity (m) of the arm, or of upper and lower leg, in one element."""
        if self.n_arm <= element < self.n_arm + self.n_lap:
            i = element - self.n_arm
            return [(leg[i], leg[i + 1], e) for leg, e in zip(self.legs, self._eccentricities, strict=True)]
        left = element if element < self.n_arm else element + 1 + self.n_lap
        return [(left, left + 1, 0.0)]

    def row(self, position_m: float, quantity: Quantity = "deflection") -> Matrix:
        """Row [n_dof] that reads deflection, slope or curvature; in the lap the mean of both legs, at its edge the arm."""
        element, s, size = self._locate(position_m)
        members = self.members(element)
        row = np.zeros(self.n_dof)
        for left, right, _ in members:
            row[bending_dofs(left, right)] += hermite(s, size, quantity) / len(members)
        return row

    def axial_row(self, position_m: float) -> Matrix:
        """Row [n_dof] that reads the axial displacement of the mid-plane; in the lap the mean of both legs."""
        element, s, _ = self._locate(position_m)
        members = self.members(element)
        row = np.zeros(self.n_dof)
        for left, right, _ in members:
            row[[3 * left, 3 * right]] += np.array([1.0 - s, s]) / len(members)
        return row

    def slip_row(self, position_m: float) -> Matrix:
        """Row [n_dof] that reads the tangential displacement of the upper leg's interface relative to the lower leg's.

        Each interface moves with ``u_axis + e w'``: the axial displacement of the leg's axis is linear in an element, the
        slope quadratic. ``position_m`` lies in the lap.
        """
        element, s, size = self._locate(position_m, inwards=True)
        row = np.zeros(self.n_dof)
        for (left, right, e), sign in zip(self.members(element), (1.0, -1.0), strict=True):
            row[[3 * left, 3 * right]] += sign * np.array([1.0 - s, s])
            row[[3 * left + 2, 3 * right + 2]] -= sign * e * np.array([1.0 - s, s])
            row[bending_dofs(left, right)] += sign * e * hermite(s, size, "slope")
        return row

    @property
    def _eccentricities(self) -> tuple[float, float]:
        return self.thickness_m / 4.0, -self.thickness_m / 4.0

    def _locate(self, position_m: float, *, inwards: bool = False) -> tuple[int, float, float]:
        """Element (at a node the outer, or the inner one), place in it from 0 to 1, and its size (m)."""
        towards = 1.0 if (position_m < self.length_m / 2.0) == inwards else -1.0
        nodes = self.positions_m
        element = int(np.searchsorted(nodes, position_m + towards * 1e-9 * self.length_m)) - 1
        element = min(max(element, 0), nodes.size - 2)
        size = float(nodes[element + 1] - nodes[element])
        return element, (position_m - float(nodes[element])) / size, size


def bending_dofs(left: int, right: int) -> list[int]:
    """Coordinates of deflection and rotation of two nodes, in the order of the Hermite shapes."""
    return [3 * left + 1, 3 * left + 2, 3 * right + 1, 3 * right + 2]
