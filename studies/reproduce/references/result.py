"""Result of a reference study: our figures and published ones in the same columns, and what is drawn of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rig.text.column import Column
from studies.reproduce.references.data import DataSet

Say = Callable[[str], None]

OURS = "this version"
"""Source of a figure that the study has computed."""


@dataclass(frozen=True)
class Line:
    """Figures of one model or method."""

    method: str
    """The model or method."""
    values: Mapping[str, float]
    """Figures by the key of their column; those that are unknown are left out."""
    source: str = OURS
    """Where they are from."""
    chosen: bool = False
    """Whether it is the model that validation data chose."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a panel."""

    label: str
    x: NDArray[Any]
    y: NDArray[Any]
    role: str = "model"
    """``measured``, ``model`` or ``residual``."""


@dataclass(frozen=True, eq=False)
class Panel:
    """A panel of the figure."""

    x_label: str
    y_label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyResult:
    """What a study came to."""

    title: str
    """What was studied."""
    columns: tuple[Column, ...]
    """Columns of the table, the one that is drawn first."""
    lines: tuple[Line, ...]
    """Our models."""
    published: tuple[Line, ...] = ()
    """Published figures."""
    notes: tuple[str, ...] = ()
    """How to read them, one line each."""
    panels: tuple[Panel, ...] = ()
    """Curves of the figure."""
    models: Mapping[str, Any] = field(default_factory=dict)
    """Models to be stored, by name of the file without its ending."""
    seconds: float = 0.0
    """Time of the study."""


@dataclass(frozen=True)
class ReferenceStudy:
    """A study that can be reproduced."""

    data: DataSet
    run: Callable[[tuple[Path, ...], int, int, Say], StudyResult]
    """From the files, the number of models and the first seed to the result."""
