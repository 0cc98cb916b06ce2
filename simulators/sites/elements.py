"""Local nonlinear elements without memory: magnets, springs, stops, tables, and functions of the user's own.

Each acts on a coordinate z of the structure: the deflection of a named point, or of one point relative to another, or
its rate. The force on the structure is along z. What is linear in it belongs to the linear plant.
"""

from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_serializer, field_validator, model_validator

from simulators.layout import N_NODE, N_PARAMETER
from simulators.part import Part, Positive, Several
from simulators.sites.functions import loaded, named, portable
from vibrolock.errors import InputError

VALID_SHARE_OF_GAP = 0.7  # largest deflection for which a magnet's law counts as valid, over the gap; chosen
LARGEST_FORCE_AT_REST_N = 1e-9  # N; a user's force at rest that still counts as zero; chosen


class LocalElement(Part):
    """What all local elements have in common."""

    at: str
    """Name of the point it acts on."""
    to: str | None = None
    """Name of the point at its other end; without it, the ground."""

    @property
    def stiffness_n_m(self) -> float:
        """Linear part at rest, which the linear plant holds."""
        return 0.0

    @property
    def steepest_n_m(self) -> float:
        """Largest size of the slope of the force that is left to the integrator, within the range of the element."""
        return 0.0

    @property
    def moves_with(self) -> Literal["deflection", "velocity"]:
        """Whether z is the deflection or its rate."""
        return "deflection"


class Magnet(LocalElement):
    """A magnet on the structure facing a fixed one, or two fixed ones on either side (Scheel et al.).

    Force at deflection z from the installed equilibrium: ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 +
    K0/(d0+z)^4`` symmetric. Valid for ``|z| < 0.7 d0``.
    """

    kind: Literal["magnet-one-sided", "magnet-symmetric"]
    """One fixed magnet, or a pair on either side."""
    strength_n_m4: Positive
    """Magnet constant K0 (N m^4)."""
    gap_m: Positive
    """Gap d0 at rest."""

    @property
    def one_sided(self) -> bool:
        """True with one fixed magnet."""
        return self.kind == "magnet-one-sided"

    @property
    def stiffness_n_m(self) -> float:
        """Linear part, ``4 K0/d0^5`` one-sided and ``8 K0/d0^5`` symmetric."""
        return (4.0 if self.one_sided else 8.0) * self.strength_n_m4 / self.gap_m**5

    @property
    def limit_m(self) -> float:
        """Largest deflection for which the force law holds."""
        return VALID_SHARE_OF_GAP * self.gap_m

    @property
    def steepest_n_m(self) -> float:
        """Slope at the limit of validity, less the linear part."""
        near, far = (
            4.0 * self.strength_n_m4 / gap**5 for gap in (self.gap_m - self.limit_m, self.gap_m + self.limit_m)
        )
        return near - self.stiffness_n_m + (0.0 if self.one_sided else far)


class Cubic(LocalElement):
    """A polynomial spring, ``f = -(k1 z + k2 z^2 + k3 z^3)``; k1 is part of the linear plant."""

    kind: Literal["cubic"]
    """This kind of element."""
    stiffness_n_m3: Annotated[float, Field(ge=-1e15, le=1e15)]
    """Cubic stiffness k3 (N/m^3); negative softens."""
    quadratic_n_m2: Annotated[float, Field(ge=-1e12, le=1e12)] = 0.0
    """Quadratic stiffness k2 (N/m^2)."""
    linear_n_m: float = 0.0
    """Linear stiffness k1 (N/m)."""

    @property
    def stiffness_n_m(self) -> float:
        """Linear part k1."""
        return self.linear_n_m


class Clearance(LocalElement):
    """Stops that the structure meets after a clearance: unilateral elastic contact on one side, or on both.

    ``f = -k (z - g)`` beyond the gap g, ``f = -k (z + g')`` beyond the gap g' on the other side, none between. Not
    modelled: loss of energy in the contact.
    """

    kind: Literal["clearance"]
    """This kind of element."""
    gap_m: Annotated[float, Field(ge=0.0)]
    """Clearance g at rest, in the positive direction."""
    other_gap_m: Annotated[float, Field(ge=0.0)] | None = None
    """Clearance g' in the negative direction; none without a stop there."""
    contact_stiffness_n_m: Positive
    """Stiffness k of the stop and its contact."""

    @property
    def steepest_n_m(self) -> float:
        """Stiffness of the contact."""
        return self.contact_stiffness_n_m


class _Table(LocalElement):
    """What elements given by numbers over the deflection have in common."""

    deflection_m: Annotated[Several[float], Field(min_length=5)]
    """Deflections z at which it is given, rising, from below 0 to above 0, with 0 itself."""

    @model_validator(mode="after")
    def _over_both_sides(self) -> "_Table":
        z = np.array(self.deflection_m)
        if not (z[0] < 0.0 < z[-1] and 0.0 in self.deflection_m and np.all(np.diff(z) > 0.0)):
            shown = f"{z[0]:g} to {z[-1]:g}"
            allowed = "rising numbers from below 0 to above 0, with 0 itself"
            raise InputError(field="deflection_m", value=shown, allowed=allowed)
        return self

    def _check_length(self, name: str) -> None:
        values = getattr(self, name)
        if len(values) != len(self.deflection_m):
            reason = f"has {len(values)} values"
            raise InputError(reason, field=name, allowed=f"{len(self.deflection_m)}, one per deflection_m")

    @property
    def nodes_m(self) -> NDArray[np.float64]:
        """Evenly spaced deflections [`simulators.layout.N_NODE`] of the table that the integrator reads."""
        return np.linspace(self.deflection_m[0], self.deflection_m[-1], N_NODE)


class ForceTable(_Table):
    """A spring whose force is given at some deflections: measured, computed elsewhere, or of an identified model.

    Between them the force follows a cubic spline (not-a-knot; C. de Boor, A Practical Guide to Splines, 1978), beyond them
    straight lines; a sample beyond them is flagged. The integrator reads the spline at 513 even deflections with cubics
    between, which is exact where the given ones are 513, 257, 129, ... even ones.
    """

    kind: Literal["force-table"]
    """This kind of element."""
    force_n: Several[float]
    """Restoring force at each deflection; 0 at deflection 0."""
    beyond_n_m: float | None = None
    """Slope of the force beyond the first and the last deflection (N/m); if left out, that of the spline at each end."""

    @model_validator(mode="after")
    def _rests(self) -> "ForceTable":
        self._check_length("force_n")
        at_rest_n = self.force_n[self.deflection_m.index(0.0)]
        if at_rest_n != 0.0:
            raise ValueError(f"force_n = {at_rest_n:g} at deflection 0: allowed is 0, z counts from equilibrium")
        return self

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Force (N), and its slope times the distance of the nodes (N), at the nodes [2, N_NODE]."""
        z = self.nodes_m
        return np.array([self._spline(z), self._spline(z, 1) * (z[1] - z[0])])

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline  # only on use: it takes long to load

        return CubicSpline(self.deflection_m, self.force_n)

    @property
    def ends_n_m(self) -> tuple[float, float]:
        """Slopes below the first and above the last deflection."""
        if self.beyond_n_m is not None:
            return self.beyond_n_m, self.beyond_n_m
        first, last = self._spline(np.array([self.deflection_m[0], self.deflection_m[-1]]), 1).tolist()
        return first, last

    @property
    def limit_m(self) -> float:
        """Smallest size of deflection that the table does not show to both sides."""
        return min(-self.deflection_m[0], self.deflection_m[-1])

    @cached_property
    def stiffness_n_m(self) -> float:
        """Slope at rest."""
        return float(self._spline(0.0, 1))

    @property
    def steepest_n_m(self) -> float:
        """Largest slope, less that at rest."""
        slopes = self._spline(self.nodes_m, 1)
        return float(np.max(np.abs(np.array([*slopes, *self.ends_n_m]) - self.stiffness_n_m)))


class DampingTable(_Table):
    """A damper whose damping depends on the deflection, ``f = -c(z) dz/dt``, and is given at some deflections.

    Between them the damping is a straight line, beyond them constant.
    """

    kind: Literal["damping-table"]
    """This kind of element."""
    damping_n_s_m: Several[Annotated[float, Field(ge=0.0)]]
    """Damping c at each deflection."""

    @model_validator(mode="after")
    def _fits(self) -> "DampingTable":
        self._check_length("damping_n_s_m")
        return self

    @property
    def table(self) -> NDArray[np.float64]:
        """Damping (N s/m) at the nodes [N_NODE]."""
        return np.interp(self.nodes_m, self.deflection_m, self.damping_n_s_m)

    @property
    def steepest_n_m(self) -> float:
        """Largest damping (N s/m)."""
        return max(self.damping_n_s_m)

    @property
    def moves_with(self) -> Literal["deflection", "velocity"]:
        """Its force goes with the velocity."""
        return "velocity"


class User(LocalElement):
    """A force law of the user's own: a compiled C function ``double f(double z, const double *parameters)``.

    For instance, in a module that can be imported::

        @numba.cfunc("float64(float64, CPointer(float64))", cache=True)
        def quadratic_drag(velocity_m_s, parameters):
            return -parameters[0] * velocity_m_s * abs(velocity_m_s)

    It is called by its address twice per integration step, with no recompilation of the plant. It must return the force
    (N) on the structure for any finite z, be a function of z and the parameters alone, and be zero at rest. It must not
    call Python, raise, keep anything from one call to the next (the predictor calls it provisionally), nor write to the
    parameters: nothing checks that while it runs.
    """

    kind: Literal["user"]
    """This kind of element."""
    function: Any
    """The function: ``"module:name"``, or a numba ``cfunc`` or ctypes function object, which becomes its name if it has one."""
    parameters: Annotated[Several[float], Field(max_length=N_PARAMETER)] = ()
    """Numbers that the function is given, at most eight; the rest of the eight are 0."""
    of: Literal["deflection", "velocity"] = "deflection"
    """Whether z is the deflection (m) or the velocity (m/s)."""
    linear_n_m: float = 0.0
    """Slope ``-df/dz`` at rest, which becomes part of the linear plant. Any value gives the same motion; the true one
    integrates most accurately."""
    largest_slope_n_m: Annotated[float, Field(ge=0.0)] = 0.0
    """Largest slope of the force to be expected (N/m, or N s/m); a step too long for it is refused. 0: not checked."""

    @field_validator("function", mode="after")
    @classmethod
    def _by_name(cls, function: Any) -> Any:
        return portable(function)

    @field_serializer("function")
    def _as_name(self, function: Any) -> str:
        return named(function)

    @model_validator(mode="after")
    def _works(self) -> "User":
        if self.of == "velocity" and self.linear_n_m != 0.0:
            raise InputError(field="linear_n_m", value=self.linear_n_m, allowed="0 where the element is of velocity")
        function = loaded(self.function)
        for z in (0.0, 1e-6, -1e-6):
            force_n = function(z, self.padded_parameters)
            if not abs(force_n) < float("inf"):
                raise InputError(
                    f"gives {force_n} at {z:g}", field="function", value=named(self.function), allowed="a finite force"
                )
        at_rest_n = function(0.0, self.padded_parameters)
        if abs(at_rest_n) > LARGEST_FORCE_AT_REST_N:
            reason = f"gives {at_rest_n:g} N at rest"
            allowed = "0: z counts from equilibrium"
            raise InputError(reason, field="function", value=named(self.function), allowed=allowed)
        return self

    @property
    def padded_parameters(self) -> tuple[float, ...]:
        """The eight numbers that the function sees."""
        return (*self.parameters, *(0.0 for _ in range(N_PARAMETER - len(self.parameters))))

    @property
    def stiffness_n_m(self) -> float:
        """Linear part that was declared."""
        return self.linear_n_m

    @property
    def steepest_n_m(self) -> float:
        """Largest slope that was declared."""
        return self.largest_slope_n_m

    @property
    def moves_with(self) -> Literal["deflection", "velocity"]:
        """As `of`."""
        return self.of


Element = Annotated[Magnet | Cubic | Clearance | ForceTable | DampingTable | User, Field(discriminator="kind")]
"""Any local element."""
