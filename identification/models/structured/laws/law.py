"""What a law declares: its numbers, how a fit moves them (`free`), and a function of x.

All take the displacement without unit, ``x = z / scale_m`` of their element, at which 1 is the largest displacement in the
training data, and give newtons (dampers N s/m).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from importlib import import_module
from itertools import product
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from identification.errors import IdentificationError
from identification.storage import stored
from vibrolock.arrays import Float


class Transform(NamedTuple):
    """How a fit moves a number: to a number without limits, and back."""

    to: Callable[[Float], Float]
    back: Callable[[Float], Float]
    allowed: str
    least: float = -np.inf
    """Least value of what the fit moves."""
    span: float = np.inf
    """Largest distance of what the fit moves from its initial value."""
    size: float | None = None
    """Width of an interval from which on the number is not identified; None for the number itself. Of a number whose zero means
    nothing, such as an exponent: half of its range."""


def between(low: float, high: float) -> Transform:
    """Return how a fit moves a number that stays between two."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return Transform(
        lambda y: np.arctanh((y - middle) / half),
        lambda v: middle + half * np.tanh(np.clip(v, -8.0, 8.0)),
        f"between {low:g} and {high:g}",
        span=4.0,
        size=half,
    )


PLAIN = Transform(lambda y: y, lambda v: v, "finite numbers")
POSITIVE = Transform(np.log, lambda v: np.exp(np.clip(v, -60.0, 60.0)), "numbers above 0", span=np.log(1e3))
FROM_ZERO = Transform(lambda y: np.where(y >= 0.0, y, np.nan), lambda v: np.maximum(v, 0.0), "numbers from 0", 1e-12)
"""A fit goes down to 1e-12: at 0 itself the derivatives by a slider would be those of one that never slips."""


@stored(kinds=lambda: import_module("identification.models.structured.laws").LAWS)
@dataclass(frozen=True, eq=False)
class Law:
    """A law of force."""

    kind: ClassVar[str]
    """Name of the law in files and commands."""
    free: ClassVar[Mapping[str, Transform]]
    """Numbers that a fit moves, and how."""
    linear: ClassVar[str] = ""
    """Those in which the law is linear. A regression finds their initial values."""
    tried: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """Values of other numbers that the regression tries."""

    def __post_init__(self) -> None:
        for name, transform in self.free.items():
            values = np.atleast_1d(np.asarray(getattr(self, name), dtype=np.float64))
            with np.errstate(all="ignore"):
                allowed = np.all(np.isfinite(transform.to(values)))
            if not allowed:
                raise IdentificationError(f"{name} is {values.tolist()}", field=self.kind, allowed=transform.allowed)
            if isinstance(getattr(self, name), (list, np.ndarray)):
                object.__setattr__(self, name, tuple(values.tolist()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers that a fit moves."""
        out: list[str] = []
        for name in self.free:
            value = getattr(self, name)
            ends = [f"[{k}]" for k in range(len(value))] if isinstance(value, tuple) else [""]
            out += [f"{self.kind} {name}{end}" for end in ends]
        return tuple(out)

    @property
    def transforms(self) -> tuple[Transform, ...]:
        """How a fit moves each of `names`."""
        return tuple(transform for name, transform in self.free.items() for _ in range(np.size(getattr(self, name))))

    @property
    def n_linear(self) -> int:
        """Number of the numbers in which the law is linear."""
        return np.size(getattr(self, self.linear)) if self.linear else 0

    @property
    def least_linear(self) -> float:
        """Least value of these."""
        return 0.0 if self.linear and self.free[self.linear] in (POSITIVE, FROM_ZERO) else -np.inf

    @property
    def vector(self) -> Float:
        """float[P], the numbers as a fit moves them."""
        parts = [
            transform.to(np.atleast_1d(np.asarray(getattr(self, name), float))) for name, transform in self.free.items()
        ]
        return np.concatenate(parts)

    @property
    def bounds(self) -> Float:
        """float[2, P], least and largest values of `vector` in a fit that begins at these numbers."""
        least, span = (np.array([getattr(one, of) for one in self.transforms]) for of in ("least", "span"))
        return np.array([np.maximum(self.vector - span, least), self.vector + span])

    def moved(self, vector: Float) -> Self:
        """Invert `vector`."""
        at, changes = 0, {}
        for name, transform in self.free.items():
            value = getattr(self, name)
            count = len(value) if isinstance(value, tuple) else 1
            found = transform.back(np.asarray(vector[at : at + count], dtype=np.float64))
            changes[name] = tuple(found.tolist()) if isinstance(value, tuple) else float(found[0])
            at += count
        return replace(self, **changes)

    def candidates(self) -> list[Self]:
        """Return the law with all combinations of the numbers that a regression tries."""
        choices = [[(name, value) for value in values] for name, values in self.tried.items()]
        return [replace(self, **dict(choice)) for choice in product(*choices)]

    def basis(self) -> list[Self]:
        """Return the law with one of its linear numbers at 1 and the others at 0, for each; none without such numbers."""
        if not self.linear:
            return []
        value = getattr(self, self.linear)
        if not isinstance(value, tuple):
            return [replace(self, **{self.linear: 1.0})]
        return [replace(self, **{self.linear: tuple(row)}) for row in np.eye(len(value)).tolist()]

    def as_dict(self) -> dict[str, Any]:
        """Return what a file holds."""
        return {"kind": self.kind} | {field.name: getattr(self, field.name) for field in fields(self)}
