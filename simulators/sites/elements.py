"""Local nonlinear elements without memory: magnets, polynomial springs, stops, and functions of the user's own.

Each acts on a coordinate z of the structure: the deflection of a named point, or of one point relative to another, or
its rate. The force on the structure is along z. What is linear in it belongs to the linear plant.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, field_serializer, field_validator, model_validator

from simulators.layout import N_PARAMETER
from simulators.part import Part, Positive, Several
from simulators.sites.functions import loaded, named, portable

__all__ = ["Clearance", "Cubic", "Element", "LocalElement", "Magnet", "User"]

VALID_SHARE_OF_GAP = 0.7
LARGEST_FORCE_AT_REST_N = 1e-9


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
            raise ValueError(f"linear_n_m = {self.linear_n_m!r}: allowed is 0 where the element is of velocity")
        function = loaded(self.function)
        for z in (0.0, 1e-6, -1e-6):
            force_n = function(z, self.padded_parameters)
            if not abs(force_n) < float("inf"):
                raise ValueError(
                    f"function = {named(self.function)!r}: gives {force_n} at {z:g}, allowed is a finite force"
                )
        at_rest_n = function(0.0, self.padded_parameters)
        if abs(at_rest_n) > LARGEST_FORCE_AT_REST_N:
            raise ValueError(
                f"function = {named(self.function)!r}: gives {at_rest_n:g} N at rest, allowed is 0: z counts from equilibrium"
            )
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


Element = Annotated[Magnet | Cubic | Clearance | User, Field(discriminator="kind")]
"""Any local element."""
