"""Datasets of a universal file, as its reader returns them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Float

_DIRECTION = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ"}
"""Directions by their codes; a negative code is the opposite direction."""
TIME_RESPONSE, GENERAL, FREQUENCY_RESPONSE = 1, 0, 4  # types of functions (dataset 58)
_TYPES = (
    *("general function", "time response", "auto spectrum", "cross spectrum", "frequency response", "transmissibility"),
    *("coherence", "auto correlation", "cross correlation", "power spectral density", "energy spectral density"),
    *("probability density", "spectrum", "cumulative frequency distribution", "peaks valley", "stress/cycles"),
    *("strain/cycles", "orbit", "mode indicator function", "force pattern", "partial power", "partial coherence"),
    *("eigenvalue", "eigenvector", "shock response spectrum", "impulse response filter", "multiple coherence"),
    "order function",
)
"""Names of the types of functions by their code."""


@dataclass(frozen=True)
class Axis:
    """Quantity along an axis: its specific data type (0 if unknown), its label, and the label of its unit; empty for none."""

    data_type: int
    label: str
    unit: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Function:
    """Function of a universal file (dataset 58).

    ``where`` is the place of a dataset for messages, ``lines`` are its lines ID 1 to 5, ``response`` and ``reference`` are node
    and direction, ``even`` and ``step`` say how the abscissa ``x`` is spaced, in the unit of ``abscissa``.
    """

    where: str
    type: int
    number: int
    load_case: int
    lines: tuple[str, ...]
    response: tuple[int, int]
    reference: tuple[int, int]
    even: bool
    step: float
    abscissa: Axis
    ordinate: Axis
    denominator: Axis
    x: Float
    data: NDArray[np.generic]

    @property
    def own(self) -> bool:
        """Whether this program wrote it."""
        return self.lines[3].startswith("vibrolock")


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeShape:
    """Normal mode of a universal file (dataset 55 of analysis type 2); ``shape`` is [3 directions, nodes], real or complex."""

    where: str
    lines: tuple[str, ...]
    frequency_hz: float
    modal_mass: float
    damping_ratio: float
    nodes: tuple[int, ...]
    shape: NDArray[np.generic]


@dataclass(frozen=True)
class UnitSystem:
    """System of units of a universal file (dataset 164): its code, and divisors of lengths and forces that give m and N."""

    code: int
    length: float
    force: float


@dataclass(frozen=True, eq=False, kw_only=True)
class UniversalFile:
    """Functions, normal modes and systems of units of a universal file, in their order.

    ``shapes`` is the number of shapes (dataset 55) of any analysis type, ``count`` that of all datasets.
    """

    functions: tuple[Function, ...]
    modes: tuple[ModeShape, ...]
    shapes: int
    units: tuple[UnitSystem, ...]
    count: int

    def of_type(self, kind: int) -> Sequence[Function]:
        """Return the functions of a type."""
        return [function for function in self.functions if function.type == kind]

    def left_out(self, *kinds: int) -> tuple[str, ...]:
        """Return a note on the functions of all other types than these; empty if there are none."""
        others = [function.type for function in self.functions if function.type not in kinds]
        told = ", ".join(f"{others.count(kind)} of type {kind} ({_type_name(kind)})" for kind in dict.fromkeys(others))
        return (f"left out of the universal file: functions {told}",) if told else ()


def _type_name(kind: int) -> str:
    return _TYPES[kind] if 0 <= kind < len(_TYPES) else "unknown"


def degree_name(degree: tuple[int, int]) -> str:
    """Return node and direction as text, such as ``3+Z``."""
    node, direction = degree
    sign = _DIRECTION.get(abs(direction), f"?{direction}")
    return f"{node}{sign.replace('+', '-') if direction < 0 else sign}"
