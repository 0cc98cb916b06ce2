"""Nonlinear features of states and inputs: monomials, and functions of weighted sums.

A model is linear in its features (`model`). Simulation and harmonic balance get values and derivatives
from the kernels `feature_values` and `feature_derivatives`. The fit needs derivatives at every sample: it gathers those of
monomials beforehand and computes those of functions in `identification.models.pnlss.fitting.kernels`.

A feature ``g(w . v + b) - g(b)`` applies a function g to a weighted sum of the variables. To add a function g, add an entry
with a new code to `FUNCTIONS`, and a branch with this code to the kernels `function_value` and `function_slope`
(`kernels`). Simulation, fit, harmonic balance, files and names then support it. A function of the user
needs neither: it is given as ``"module:name"``.

The monomials are those of Paduart et al., Automatica 46, 2010. With tanh the functions saturate, as the nonlinear feedback of
an NL-LFR model does (Schoukens and Toth, IFAC-PapersOnLine 53, 2020).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.models.pnlss.kernels import CUBE, SQUARE, TANH, Table, feature_derivatives, feature_values
from identification.models.pnlss.user_functions import UserFunction, is_users, user_function
from identification.validation import finite_array, read_only
from vibrolock.arrays import Float, Int


class FeatureFunction(NamedTuple):
    """A function g that is applied to weighted sums."""

    code: int
    """Code of the function in the kernels."""
    of: Callable[[Float], Float]
    """g evaluated on an array, for its values at rest."""
    slope: int = 0
    """Address of the derivative of a user's function."""


FUNCTIONS: dict[str, FeatureFunction] = {
    "tanh": FeatureFunction(TANH, np.tanh),
    "square": FeatureFunction(SQUARE, lambda s: s * s),
    "cube": FeatureFunction(CUBE, lambda s: s * s * s),
}
"""Functions by name; the name is used in files and in the names of features."""


def function_of(name: str) -> FeatureFunction:
    """Return a function by its name in `FUNCTIONS`, or that of a user, which is imported and compiled.

    Raises `IdentificationError` if there is no such function.
    """
    if name in FUNCTIONS:
        return FUNCTIONS[name]
    found = user_function(name)
    return FeatureFunction(found.address, found.of, found.slope_address)


@dataclass(frozen=True, eq=False, kw_only=True)
class Features:
    """Features ``phi(v)`` of the variables ``v = (x, u)``: first monomials, then functions of weighted sums.

    Raises `IdentificationError` if shapes do not agree, powers are negative, monomials are below degree two or given twice,
    limits are not above zero, or functions are unknown.

    Parameters
    ----------
    variables
        Number of states and inputs together.
    exponents
        int[n_monomials, variables], powers of each monomial; its degree is at least two.
    weights
        float[n_functions, variables + 1]: feature ``g(w . v + b) - g(b)``, zero at rest, b in the last column.
    functions
        Name of g for every row of ``weights``, empty if all are ``tanh``: one of `FUNCTIONS`, or ``"module:name"`` of a
        function of your own, of one number. It is imported when the features are evaluated, and compiled; its derivative is
        that in ``"module:name:slope"``, or taken by finite differences.
    limits
        float[variables], magnitude at which monomials clip a variable; inf for none. Limits keep the features bounded and
        have no effect within the limits.
    """

    variables: int
    exponents: Int = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    weights: Float = field(default_factory=lambda: np.zeros((0, 0)))
    functions: tuple[str, ...] = ()
    limits: Float = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        IdentificationError.unless_at_least("variables", self.variables, 1)
        given = {"exponents": (self.exponents, self.variables), "weights": (self.weights, self.variables + 1)}
        for name, (values, width) in given.items():
            dtype = np.int64 if name == "exponents" else np.float64
            array = finite_array(name, np.reshape(values, (-1, width)) if np.size(values) == 0 else values, dtype, 2)
            if array.shape[1] != width:
                raise IdentificationError(f"shape {array.shape}", field=name, allowed=f"{width} columns")
            object.__setattr__(self, name, array)
        limits = np.full(self.variables, np.inf) if np.size(self.limits) == 0 else np.asarray(self.limits, dtype=float)
        if limits.shape != (self.variables,) or not np.all(limits > 0.0):
            raise IdentificationError(limits, field="limits", allowed=f"{self.variables} values above zero")
        object.__setattr__(self, "limits", read_only(limits, np.float64))
        functions = tuple(self.functions)
        object.__setattr__(self, "functions", () if set(functions) <= {"tanh"} else functions)
        unknown = [name for name in functions if name not in FUNCTIONS and not is_users(name)]
        if unknown or len(functions) not in (0, len(self.weights)):
            raise IdentificationError(
                f"are {', '.join(functions)} for {len(self.weights)} rows of weights",
                field="functions",
                allowed=f"one of {', '.join(FUNCTIONS)} for each, or 'module:name' of your own",
            )
        if np.any(self.exponents < 0) or np.any(self.exponents.sum(axis=1) < 2):
            raise IdentificationError(
                "have a negative power or a degree below 2, which is the linear part", field="exponents"
            )
        if len({tuple(row) for row in self.exponents.tolist()}) < len(self.exponents):
            raise IdentificationError("hold a monomial twice", field="exponents")

    @classmethod
    def monomials(
        cls, states: int, inputs: int, degrees: Iterable[int], *, of: Sequence[int] | None = None
    ) -> "Features":
        """Return all monomials of the given degrees, of all states and inputs or of the variables ``of`` alone.

        ``of=range(states)`` selects the states alone. Raises `IdentificationError` on a degree below two or an unknown
        variable.
        """
        chosen = list(range(states + inputs) if of is None else of)
        wrong = [j for j in chosen if not 0 <= j < states + inputs]
        if wrong:
            raise IdentificationError(f"variable {wrong[0]}", field="of", allowed=f"0 to {states + inputs - 1}")
        rows = []
        for degree in sorted(set(degrees)):
            if degree < 2:
                raise IdentificationError(degree, field="degrees", allowed="2 and above", hint="1 is the linear part")
            for picked in combinations_with_replacement(chosen, degree):
                rows.append(np.bincount(np.array(picked), minlength=states + inputs))
        return cls(variables=states + inputs, exponents=np.array(rows, dtype=np.int64))

    @classmethod
    def none(cls, states: int, inputs: int) -> "Features":
        """Return an empty set of features, for a linear equation."""
        return cls(variables=states + inputs)

    @classmethod
    def saturating(cls, weights: ArrayLike) -> "Features":
        """Return features ``tanh(w . v + b) - tanh(b)`` with weights float[n_functions, n_variables + 1], b last."""
        array = finite_array("weights", weights, np.float64, 2)
        return cls(variables=array.shape[1] - 1, weights=array)

    @property
    def count(self) -> int:
        """Number of features."""
        return len(self.exponents) + len(self.weights)

    @property
    def parameters(self) -> int:
        """Number of parameters inside the features: weights and biases."""
        return int(self.weights.size)

    @property
    def table(self) -> Table:
        """The features in the form that the kernels use."""
        degree = int(self.exponents.sum(axis=1).max(initial=0))
        factors = np.full((len(self.exponents), degree), -1, dtype=np.int64)
        for row, powers in zip(factors, self.exponents, strict=True):
            used = np.repeat(np.arange(self.variables), powers)
            row[: used.size] = used
        functions = [function_of(name) for name in self._functions]
        codes, slopes = (
            np.array([getattr(function, name) for function in functions], dtype=np.int64) for name in ("code", "slope")
        )
        table = Table(factors, np.array(self.limits), self.weights, np.zeros(len(codes)), codes, slopes)
        return with_weights(table, np.array(self.weights))

    @property
    def _functions(self) -> tuple[str, ...]:
        return self.functions or ("tanh",) * len(self.weights)

    def names(self, states: int) -> tuple[str, ...]:
        """Return one name per feature: ``x1^2 x2``, ``u1 x1``, ``tanh 1``."""
        variables = [f"x{j + 1}" if j < states else f"u{j + 1 - states}" for j in range(self.variables)]
        found = []
        for powers in self.exponents:
            used = [(name, power) for name, power in zip(variables, powers, strict=True) if power]
            found.append(" ".join(name if power == 1 else f"{name}^{power}" for name, power in used))
        return (*found, *(f"{name} {index + 1}" for index, name in enumerate(self._functions)))

    def values(self, v: ArrayLike) -> Float:
        """float[n_features, n] at variables float[n_variables, n]."""
        points, table = self._points(v), self.table
        found = np.empty((len(points), self.count))
        for point, row in zip(points, found, strict=True):
            feature_values(table, point, row)
        return found.T

    def derivatives(self, v: ArrayLike) -> Float:
        """float[n_features, n_variables, n]: derivatives with respect to the variables at float[n_variables, n]."""
        points, table = self._points(v), self.table
        found, steep = np.empty((len(points), self.count, self.variables)), np.empty((len(self.weights), 2))
        for point, slope in zip(points, found, strict=True):
            feature_derivatives(table, point, slope, steep)
        return np.moveaxis(found, 0, -1)

    def scaled(self, scale: ArrayLike) -> tuple["Features", Float]:
        """Return features of ``v / scale``, and factors float[n_features] from their values to the values of these features.

        Raises `IdentificationError` unless every variable has a scale above zero.
        """
        size = np.asarray(scale, dtype=float)
        if size.shape != (self.variables,) or not np.all((size > 0.0) & np.isfinite(size)):
            raise IdentificationError(size, field="scale", allowed=f"{self.variables} finite values above zero")
        weights = np.array(self.weights)
        weights[:, :-1] *= size
        factors = np.concatenate([np.prod(size**self.exponents, axis=1), np.ones(len(weights))])
        return replace(self, weights=weights, limits=self.limits / size), factors

    def with_functions(self, weights: ArrayLike, function: str = "tanh") -> "Features":
        """Return these features and further ones behind them: a function of weighted sums, float[n, n_variables + 1]."""
        more = np.reshape(np.asarray(weights, dtype=float), (-1, self.variables + 1))
        functions = (*self._functions, *[function] * len(more))
        return replace(self, weights=np.vstack([self.weights, more]), functions=functions)

    def bounded(self, limits: ArrayLike) -> "Features":
        """Return the same features with monomials that clip variables at ``limits`` (float[n_variables])."""
        return replace(self, limits=np.asarray(limits, dtype=float))

    def _points(self, v: ArrayLike) -> Float:
        array = finite_array("v", v, np.float64, 2)
        if array.shape[0] != self.variables:
            raise IdentificationError(f"shape {array.shape}", field="v", allowed=f"{self.variables} rows")
        return np.ascontiguousarray(array.T)


def with_weights(table: Table, weights: Float) -> Table:
    """Return the table with other weights (float[n_functions, n_variables + 1])."""
    at_rest = np.empty(len(weights))
    known = {function.code: function for function in FUNCTIONS.values()}
    for code in np.unique(table.codes):
        own = table.codes == code
        of = known[int(code)].of if int(code) in known else UserFunction(int(code), 0, ()).of
        at_rest[own] = of(weights[own, -1])
    return table._replace(weights=weights, at_rest=at_rest)
