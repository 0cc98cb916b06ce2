"""Laws of nonlinear elements: springs, dampers, and joints with memory, each one declaration.

All take the displacement without unit, ``x = z / scale_m`` of their element, at which 1 is the largest displacement in the
training data, and give newtons (dampers N s/m). What a law declares: its numbers, how a fit moves them (`free`), and a function
of x.
"""

import importlib
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from identification.errors import IdentificationError
from identification.storage import stored
from vibrolock.arrays import Float
from vibrolock.iwan import iwan_sliders

_LARGEST_SLIP = 0.9
"""Largest slip x of a joint's sliders: one that the training data hardly reach is a spring to them, of any stiffness."""
_LARGEST_ELASTIC = 30.0
"""Largest force of a hysteresis that hardens, as the displacement x at which the stiffness at rest would reach it. Chosen, far
beyond the data: the bound of the motion needs one."""
_CREEP = 1e-8
"""Displacement x by which a step of dry friction creeps if it just holds. Chosen: little over all steps of a record, far above
rounding."""
_LEAST_EXPONENT = 0.75
"""Least exponent of a hysteresis. Chosen: below 1 the bend at zero force is a corner."""
_MAGNET_REACH = 0.8
"""Share of a magnet's gap beyond which its force goes on as a straight line."""


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


def _between(low: float, high: float) -> Transform:
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

_EXPONENT = Transform(
    lambda y: np.log(np.where(y >= _LEAST_EXPONENT, y, np.nan)),
    lambda v: np.maximum(np.exp(np.clip(v, -60.0, 60.0)), _LEAST_EXPONENT),
    f"numbers from {_LEAST_EXPONENT}",
    least=float(np.log(_LEAST_EXPONENT)),
    span=float(np.log(6.0)),
)
_RATIO = Transform(lambda y: y, lambda v: v, "finite numbers", span=10.0, size=2.0)
"""Its zero means nothing: what is not identified has an interval from softening, 1, to hardening, -1."""


@stored(kinds=lambda: LAWS)
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


class Spring(Law):
    """A force without memory that depends on the displacement."""

    @abstractmethod
    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""


class Damper(Law):
    """A damping that depends on the displacement."""

    @abstractmethod
    def damping(self, x: Float) -> Float:
        """Return the damping at ``x``, N s/m, nowhere below zero."""


class Joint(Law):
    """A force with memory: Jenkins sliders, or hystereses that bend, side by side.

    They stand beside the linear part, which is that of the structure with all sliders slipping.
    """

    sticks: ClassVar[bool] = True
    """Whether the joint sticks in small vibrations."""

    @abstractmethod
    def sliders(self) -> Float:
        """float[2, n]: stiffness (N per unit of x) and largest force (N) of each slider."""

    def bends(self) -> Float:
        """float[3, n]: yield force (N), exponent and ratio gamma of each hysteresis (`hysteresis`).

        Zeros for a slider; an exponent of -1 for dry friction.
        """
        return np.zeros((3, self.sliders().shape[1]))


@dataclass(frozen=True, eq=False)
class PolynomialSpring(Spring):
    """``sum_k c_k x^(k+2)``."""

    kind = "polynomial-spring"
    free: ClassVar = {"coefficients_n": PLAIN}
    linear = "coefficients_n"

    coefficients_n: tuple[float, ...] = (0.0,) * 5
    """Coefficients of the square, the cube, ..., N."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        return np.asarray(np.polynomial.polynomial.polyval(x, [0.0, 0.0, *self.coefficients_n]))


@dataclass(frozen=True, eq=False)
class SplineSpring(Spring):
    """A cubic spline, given by its second derivative at knots; force and slope are zero at rest."""

    kind = "spline-spring"
    free: ClassVar = {"curvatures_n": PLAIN}
    linear = "curvatures_n"

    curvatures_n: tuple[float, ...] = (0.0,) * 7
    """Second derivative by x at the knots, N."""
    knots: tuple[float, ...] = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
    """Displacements x, rising. Beyond the first and the last one the curvature stays."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        from scipy.interpolate import make_interp_spline  # only on use: it takes long to load

        far = 10.0 * max(map(abs, self.knots))
        knots = np.array([-far, *self.knots, far])
        curvatures = np.array([self.curvatures_n[0], *self.curvatures_n, self.curvatures_n[-1]])
        slope = make_interp_spline(knots, curvatures, k=1).antiderivative()
        integral = slope.antiderivative()
        return np.asarray(integral(x) - integral(0.0) - slope(0.0) * x)


@dataclass(frozen=True, eq=False)
class Stop(Spring):
    """An elastic stop beyond a gap, on one side or on both: ``k (x - gap)``."""

    kind = "stop"
    free: ClassVar = {"stiffness_n": POSITIVE, "gap": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"gap": (0.1, 0.2, 0.35, 0.5, 0.65, 0.8)}

    stiffness_n: float = 1.0
    """Stiffness of the contact, N per unit of x."""
    gap: float = 0.5
    """Displacement x at which contact begins."""
    sides: str = "above"
    """``above``, ``below`` or ``both``."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        above = np.maximum(x - self.gap, 0.0) if self.sides != "below" else 0.0
        below = np.minimum(x + self.gap, 0.0) if self.sides != "above" else 0.0
        return np.asarray(self.stiffness_n * (above + below))


@dataclass(frozen=True, eq=False)
class MagnetSpring(Spring):
    """A magnet that faces another one: ``a ((1 - x/gap)^-4 - 1 - 4 x/gap)``, without its linear part.

    Beyond 0.8 of the gap the force goes on as a straight line. A positive gap lies above, a negative one below.
    """

    kind = "magnet"
    free: ClassVar = {"strength_n": PLAIN, "gap": PLAIN}
    linear = "strength_n"
    tried: ClassVar = {"gap": (-8.0, -4.0, -2.0, -1.4, 1.4, 2.0, 4.0, 8.0)}

    strength_n: float = 0.1
    """Force a between the magnets at rest, N; above zero they repel each other."""
    gap: float = 4.0
    """Gap at rest, in units of x."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        share = x / self.gap
        near = np.minimum(share, _MAGNET_REACH)
        open_ = 1.0 - near
        along = open_**-4.0 + 4.0 * open_**-5.0 * (share - near)
        return np.asarray(np.sign(self.gap) * self.strength_n * (along - 1.0 - 4.0 * share))


@dataclass(frozen=True, eq=False)
class UserSpring(Spring):
    """A function of the user's own, ``function(x, numbers)``, of arrays."""

    kind = "user-spring"
    free: ClassVar = {"numbers": PLAIN}

    function: str
    """``"module:name"``."""
    numbers: tuple[float, ...]
    """What the function is given, and what a fit moves."""

    def force(self, x: Float) -> Float:
        """Return the force at ``x``, N."""
        module, _, name = self.function.partition(":")
        try:
            function = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError, ValueError) as error:
            raise IdentificationError(
                f"user-spring: function is '{self.function}', allowed is 'module:name' of one that can be imported ({error})"
            ) from None
        found = np.asarray(function(x, np.array(self.numbers)), dtype=np.float64)
        if found.shape != np.shape(x) or not np.all(np.isfinite(found)):
            raise IdentificationError(
                f"user-spring: '{self.function}' gives {found.shape} values, allowed are finite ones, one for each x"
            )
        return found


@dataclass(frozen=True, eq=False)
class PolynomialDamper(Damper):
    """``sum_j c_j |x|^(j+1)``."""

    kind = "polynomial-damper"
    free: ClassVar = {"coefficients_n_s_m": FROM_ZERO}
    linear = "coefficients_n_s_m"

    coefficients_n_s_m: tuple[float, ...] = (0.0, 0.0)
    """Coefficients of the size, its square, ..., N s/m, none below zero."""

    def damping(self, x: Float) -> Float:
        """Return the damping at ``x``, N s/m."""
        return np.asarray(np.polynomial.polynomial.polyval(np.abs(x), [0.0, *self.coefficients_n_s_m]))


@dataclass(frozen=True, eq=False)
class Jenkins(Joint):
    """One slider: a spring in series with dry friction."""

    kind = "jenkins"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.05, 0.1, 0.2, 0.4, 0.7)}

    stiffness_n: float = 1.0
    """Stiffness, N per unit of x."""
    slip: float = 0.5
    """Displacement x at which it slips."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        return np.array([[self.stiffness_n], [self.stiffness_n * self.slip]])


@dataclass(frozen=True, eq=False)
class Coulomb(Joint):
    """Dry friction: a force of one size against the motion, and any smaller one at rest.

    The step of the simulation makes it a number: over a step it is the whole force against the mean velocity, or, if the
    element would turn round, what holds it. A step that holds may creep by a hundred-millionth of the largest displacement in
    the training data; what a model does, does not depend on it. Harmonic balance has no steps: there dry friction slips at a
    thousandth. In small vibrations it slips: those of the linear part are of a modal test of which friction takes little.
    """

    kind = "coulomb"
    free: ClassVar = {"friction_n": POSITIVE}
    linear = "friction_n"
    sticks = False

    friction_n: float = 1.0
    """Friction force, N."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        return np.array([[self.friction_n / _CREEP], [self.friction_n]])

    def bends(self) -> Float:
        """float[3, 1]: an exponent of -1 for dry friction."""
        return np.array([[0.0], [-1.0], [0.0]])


def _slips(count: int, largest: float = _LARGEST_SLIP) -> tuple[float, ...]:
    """Return slips that grow with the power 1.5 of their number."""
    return tuple((largest * (np.arange(1, count + 1) / count) ** 1.5).round(4).tolist())


@dataclass(frozen=True, eq=False)
class Masing(Joint):
    """Sliders that slip at given displacements, with free stiffnesses: any joint that follows Masing's rule, in steps.

    What slips beyond the training data is not seen there. Such a joint stays stuck in the model.
    """

    kind = "masing"
    free: ClassVar = {"stiffness_n": FROM_ZERO}
    linear = "stiffness_n"

    stiffness_n: tuple[float, ...] = (1.0,) * 18
    """Stiffness of each slider, N per unit of x, none below zero."""
    slips: tuple[float, ...] = _slips(18)
    """Displacements x at which they slip, growing with the power 1.5 of their number: close together where a joint slips
    little, and where most of its stiffness is. With equal ratios in their place, fits of the friction beam depended on the
    ratio."""

    @classmethod
    def spaced(cls, count: int, largest: float = _LARGEST_SLIP) -> Self:
        """Return a joint of ``count`` sliders with slips up to ``largest``."""
        return cls(stiffness_n=(1.0,) * count, slips=_slips(count, largest))

    def sliders(self) -> Float:
        """float[2, n]: stiffness and largest force."""
        return np.asarray(np.array(self.stiffness_n) * np.array([np.ones(len(self.slips)), self.slips]))


@dataclass(frozen=True, eq=False)
class Iwan(Joint):
    """Segalman's four-parameter Iwan joint (J. Appl. Mech. 72, 2005, 752), cut into sliders.

    Stiffness density over the displacement of slip ``R phi^chi`` up to ``slip``, and an end slider with ``beta`` times the
    stiffness of the density. In micro-slip the energy lost in a cycle grows with the amplitude to the power ``3 + chi``.
    """

    kind = "iwan"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE, "chi": _between(-0.95, 2.0), "beta": POSITIVE}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.3, 1.0, 3.0), "chi": (-0.5, 0.0, 0.5), "beta": (0.03, 0.3)}

    stiffness_n: float = 1.0
    """Stiffness while nothing slips, N per unit of x."""
    slip: float = 1.0
    """Displacement x at which all slips."""
    chi: float = 0.0
    """Exponent of the density."""
    beta: float = 0.1
    """Stiffness of the end slider over that of the density."""
    count: int = 20
    """Number of sliders of the density."""
    smallest: float = 0.0
    """Displacement below which nothing slips, over ``slip``, with slips above it in equal ratios. 0: slips grow with the square
    of their number. Most of the stiffness slips late, where equal ratios are coarse: fits of a joint of 40 sliders left four to
    nine times a noise of 0.1 % with 12 or 24 of them, and one to two with these 20."""

    def sliders(self) -> Float:
        """float[2, count + 1]: stiffness and largest force; exact in stuck stiffness and force at full slip."""
        edges = (np.arange(self.count + 1) / self.count) ** 2
        if self.smallest > 0.0:
            edges = np.concatenate([[0.0], np.geomspace(self.smallest, 1.0, self.count)])
        stiffness, slip = iwan_sliders(self.stiffness_n, self.chi, self.beta, edges)
        return np.array([stiffness, stiffness * self.slip * slip])


@dataclass(frozen=True, eq=False)
class BoucWen(Joint):
    """Hysteresis of Bouc and Wen: ``dr/dx = k [1 - (sgn(r dx) + gamma) |r/(k slip)|^exponent]``.

    These are all laws of Bouc and Wen that lose energy: with the usual ``dr/dx = k - (beta sgn(r dx) + gamma') |r|^n``,
    ``beta = k (k slip)^-n`` is above zero and ``gamma = gamma'/beta`` is free. Whatever its numbers, the law is passive from
    rest (`hysteresis`). From ``gamma`` -1 to 1 it is in class I of Ikhouane, Manosa and Rodellar (Systems and Control Letters
    56, 2007, 197), above 1 in class II; from -1 down it hardens. Its force is at most ``k slip (1 + gamma)^(-1/exponent)``,
    and at most 30 k, where it slips: there an element that hardens ends, far beyond the training data.
    """

    kind = "bouc-wen"
    free: ClassVar = {"stiffness_n": POSITIVE, "slip": POSITIVE, "exponent": _EXPONENT, "gamma": _RATIO}
    linear = "stiffness_n"
    tried: ClassVar = {"slip": (0.1, 0.3, 1.0, 3.0), "exponent": (1.0, 2.0), "gamma": (-1.5, 0.0, 0.8)}

    stiffness_n: float = 1.0
    """Stiffness at the turning of the force through zero, N per unit of x."""
    slip: float = 1.0
    """Displacement x with which the stiffness would reach the force at which bends are as large as the stiffness."""
    exponent: float = 1.0
    """Sharpness of the bend."""
    gamma: float = 0.0
    """Ratio of gamma to beta: bends in loading ``1 + gamma``, in unloading ``1 - gamma``."""

    def sliders(self) -> Float:
        """float[2, 1]: stiffness and largest force."""
        least = 1.0 + self.gamma
        softest = self.slip * least ** (-1.0 / self.exponent) if least > 0.0 else np.inf
        return self.stiffness_n * np.array([[1.0], [min(softest, _LARGEST_ELASTIC)]])

    def bends(self) -> Float:
        """float[3, 1]: yield force, exponent and ratio."""
        return np.array([[self.stiffness_n * self.slip], [self.exponent], [self.gamma]])


LAWS: dict[str, type[Law]] = {
    law.kind: law
    for law in (
        PolynomialSpring,
        SplineSpring,
        Stop,
        MagnetSpring,
        UserSpring,
        PolynomialDamper,
        Jenkins,
        Iwan,
        Masing,
        BoucWen,
        Coulomb,
    )
}
"""All laws by their names."""
