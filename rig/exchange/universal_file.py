"""Datasets of a universal file, as its reader returns them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Float

_DIRECTION = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
"""Directions by their codes; a negative code is the opposite direction."""
TIME_RESPONSE, GENERAL, FREQUENCY_RESPONSE = 1, 0, 4  # types of functions (dataset 58)


@dataclass(frozen=True)
class Axis:
    """Quantity along an axis of a function."""

    data_type: int
    """Specific data type; 0 if unknown."""
    label: str
    """Name of the quantity."""
    unit: str
    """Label of the unit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Function:
    """Function of a universal file (dataset 58)."""

    where: str
    """File and number of the dataset, for messages."""
    type: int
    """Type of the function."""
    number: int
    """Its identification."""
    load_case: int
    """Its load case."""
    lines: tuple[str, ...]
    """Lines ID 1 to 5."""
    response: tuple[int, int]
    """Node and direction of the response."""
    reference: tuple[int, int]
    """Node and direction of the reference."""
    even: bool
    """Whether the abscissa is evenly spaced."""
    step: float
    """Increment of the abscissa."""
    ordinate: Axis
    """Quantity of the numerator."""
    denominator: Axis
    """Quantity of the denominator."""
    x: Float
    """Abscissa [n]."""
    data: NDArray[np.generic]
    """Values [n], real or complex."""

    @property
    def own(self) -> bool:
        """Whether this program wrote it."""
        return self.lines[3].startswith("vibrolock")


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeShape:
    """Normal mode of a universal file (dataset 55 of analysis type 2)."""

    where: str
    """File and number of the dataset, for messages."""
    lines: tuple[str, ...]
    """Lines ID 1 to 5."""
    frequency_hz: float
    """Natural frequency."""
    modal_mass: float
    """Modal mass in the file's unit."""
    damping_ratio: float
    """Viscous damping ratio."""
    nodes: tuple[int, ...]
    """Numbers of the nodes."""
    shape: NDArray[np.generic]
    """Shape [3 directions, n nodes], real or complex."""


@dataclass(frozen=True)
class UnitSystem:
    """System of units of a universal file (dataset 164)."""

    code: int
    """Code of the system."""
    length: float
    """Factor by which a length is divided to give m."""
    force: float
    """Factor by which a force is divided to give N."""


@dataclass(frozen=True, eq=False, kw_only=True)
class UniversalFile:
    """Datasets 55, 58 and 164 of a universal file."""

    functions: tuple[Function, ...]
    """Functions in their order."""
    modes: tuple[ModeShape, ...]
    """Normal modes in their order."""
    has_shapes: bool
    """Whether there are shapes (dataset 55) of any analysis type."""
    units: tuple[UnitSystem, ...]
    """Systems of units in their order."""
    count: int
    """Number of all datasets that were read."""

    def of_type(self, kind: int) -> Sequence[Function]:
        """Return the functions of a type."""
        return [function for function in self.functions if function.type == kind]


def degree_name(degree: tuple[int, int]) -> str:
    """Return node and direction as text, such as ``3+Z``."""
    node, direction = degree
    sign = _DIRECTION.get(abs(direction), f"?{direction}")
    return f"{node}{sign.replace('+', '-') if direction < 0 else sign}"
