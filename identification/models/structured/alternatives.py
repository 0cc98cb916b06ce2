"""Models that the training data do not tell from a fitted one: the same forces within the range of the data, others beyond.

Within the largest displacement X of the training data an alternative has the forces of the model. Beyond, three things are not
seen, each of which is let go as far as it may either way:

- A spring: what it adds there to a straight line through its force and slope at X. It may be nothing, or twice as much.
- A damper: its damping there. It may be none, or exceed that at X by twice as much as the model's does.
- A joint: sliders that slip only beyond X, which are springs in the data. Those that the model has may never slip, or all at X.
  There may be others, whose stiffness the fit took for the structure's: as much, at most, as all that slips within X has, which
  holds for every joint whose stiffness falls less and less with the displacement. Of sliders that slip between X and 2 X, those
  at X soften most and, up to twice the range, lose most energy, so that these two are the ends.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from identification.models.structured.elements import NonlinearElement
from identification.models.structured.hysteresis import hysteresis_step
from identification.models.structured.laws import Damper, Joint, Law, Spring
from identification.models.structured.model import StructuredModel
from vibrolock.arrays import Float

_MOST_HIDDEN = 0.5
"""Largest stiffness of unseen sliders over the static stiffness in their direction. Chosen: the rest carries the structure."""
_NEAR = 1e-4
"""Step of differences at the edge of the data, relative to it."""
_FALL = 0.2
"""Way over which damping falls to none, relative to the edge. Chosen: with a jump there often is no harmonic balance."""
_NEVER = 1e6
"""Displacement, over the largest in the data, at which sliders slip that never do."""


@dataclass(frozen=True, eq=False)
class _Tail(Spring):
    """What springs add beyond ``edge`` to straight lines there, times ``factor``."""

    kind = "tail"
    free: ClassVar = {}

    springs: tuple[Spring, ...]
    edge: float
    factor: float

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        found = np.zeros(np.shape(x))
        for side in (-self.edge, self.edge):
            near = np.array([side - _NEAR * self.edge, side, side + _NEAR * self.edge])
            beyond = x < side if side < 0.0 else x > side
            for spring in self.springs:
                less, there, more = spring.force(near)
                slope = (more - less) / (near[2] - near[0])
                found = found + np.where(beyond, spring.force(x) - there - slope * (x - side), 0.0)
        return np.asarray(self.factor * found)


@dataclass(frozen=True, eq=False)
class _Line(Spring):
    """A linear spring."""

    kind = "line"
    free: ClassVar = {}

    stiffness_n: float

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        return np.asarray(self.stiffness_n * x)


@dataclass(frozen=True, eq=False)
class _Damping(Damper):
    """Dampers that fall beyond ``edge`` to ``left`` of their damping, and have ``factor`` times what they exceed it by."""

    kind = "damping"
    free: ClassVar = {}

    dampers: tuple[Damper, ...]
    edge: float
    left: float
    factor: float

    def damping(self, x: Float) -> Float:
        """Return the damping at ``x``, N s/m."""
        size, found = np.abs(x), np.zeros(np.shape(x))
        for damper in self.dampers:
            inside = damper.damping(x)
            at_edge = float(damper.damping(np.array([self.edge]))[0])
            fallen = at_edge * (self.left + (1.0 - self.left) * np.maximum(1.0 - (size / self.edge - 1.0) / _FALL, 0.0))
            found = found + np.where(size > self.edge, fallen + self.factor * (inside - at_edge), inside)
        return np.asarray(np.maximum(found, 0.0))


@dataclass(frozen=True, eq=False)
class _Sliders(Joint):
    """Given sliders."""

    kind = "sliders"
    free: ClassVar = {}

    rows: Float
    """float[2, n]: stiffness and largest force."""

    def sliders(self) -> Float:
        """float[2, n]: stiffness and largest force."""
        return self.rows


class Alternative(NamedTuple):
    """A model that the training data do not tell from that of the fit."""

    family: str
    """What differs: ``spring``, ``damper`` or ``joint``."""
    model: StructuredModel


def alternatives(model: StructuredModel) -> tuple[Alternative, ...]:
    """Return the ends of what the data leave open beyond their range; none for elements whose range is unknown."""
    static = 1.0 / np.array([np.sum((one.phi / model.omega) ** 2) for one in model.elements])
    ends: Sequence[tuple[str, Callable[[NonlinearElement, float], tuple[Law, ...]]]] = (
        ("spring", lambda e, _: _with_tail(e, -1.0)),
        ("spring", lambda e, _: _with_tail(e, 1.0)),
        ("damper", lambda e, _: _with_damping(e, 0.0, 0.0)),
        ("damper", lambda e, _: _with_damping(e, 1.0, 2.0)),
        ("joint", lambda e, _: _never_slipping(e)),
        ("joint", _all_slipping),
    )
    found = []
    for family, end in ends:
        elements = [
            replace(e, laws=end(e, _MOST_HIDDEN * float(k) / e.scale_m)) if e.largest else e
            for e, k in zip(model.elements, static, strict=True)
        ]
        if any(one.laws != e.laws for one, e in zip(elements, model.elements, strict=True)):
            found.append(Alternative(family, replace(model, elements=tuple(elements))))
    return tuple(found)


def _edge(element: NonlinearElement) -> float:
    assert element.largest is not None
    return float(element.largest)


def _with_tail(element: NonlinearElement, factor: float) -> tuple[Law, ...]:
    springs = tuple(law for law in element.laws if isinstance(law, Spring))
    return (*element.laws, _Tail(springs, _edge(element), factor)) if springs else element.laws


def _with_damping(element: NonlinearElement, left: float, factor: float) -> tuple[Law, ...]:
    dampers = tuple(law for law in element.laws if isinstance(law, Damper))
    others = tuple(law for law in element.laws if not isinstance(law, Damper))
    return (*others, _Damping(dampers, _edge(element), left, factor)) if dampers else element.laws


def _plain(law: Law) -> bool:
    """Return whether a law is a joint of Jenkins sliders alone."""
    return isinstance(law, Joint) and not np.any(law.bends())


def _never_slipping(element: NonlinearElement) -> tuple[Law, ...]:
    laws = list(element.laws)
    for k, law in enumerate(laws):
        if isinstance(law, Joint) and _plain(law):
            rows = law.sliders().copy()
            beyond = rows[1] > _edge(element) * rows[0]
            if beyond.any():
                rows[1, beyond] = _NEVER * _edge(element) * rows[0, beyond]
                laws[k] = _Sliders(rows)
    return tuple(laws)


def _all_slipping(element: NonlinearElement, most: float) -> tuple[Law, ...]:
    laws, edge, released, beyond_n = list(element.laws), _edge(element), 0.0, 0.0
    for k, law in enumerate(laws):
        if not isinstance(law, Joint) or not law.sticks:
            continue
        if not _plain(law):
            released += _released(law, edge)
            continue
        rows = law.sliders().copy()
        beyond = rows[1] > edge * rows[0]
        released += float(np.sum(rows[0, ~beyond]))
        beyond_n += float(np.sum(rows[0, beyond]))
        if beyond.any():
            rows[1, beyond] = edge * rows[0, beyond]
            laws[k] = _Sliders(rows)
    hidden = min(released - beyond_n, most)
    if hidden > 0.0:
        laws += [_Line(-hidden), _Sliders(np.array([[hidden], [hidden * edge]]))]
    return tuple(laws)


def _released(law: Joint, edge: float) -> float:
    """Return by how much the stiffness of hystereses has fallen when they are first loaded up to the edge, N per unit of x."""
    total = 0.0
    for (k, largest), (y, n, gamma) in zip(law.sliders().T, law.bends().T, strict=True):
        before, after = (hysteresis_step(0.0, k, largest, y, n, gamma, way)[1] for way in ((1.0 - _NEAR) * edge, edge))
        total += k - (after - before) / (_NEAR * edge)
    return max(total, 0.0)
