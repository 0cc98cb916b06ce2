"""Laws of nonlinear elements: springs, dampers, and joints with memory, each one declaration (`laws.law`)."""

from identification.models.structured.laws.dampers import Damper as Damper, PolynomialDamper as PolynomialDamper
from identification.models.structured.laws.friction import Coulomb as Coulomb, Stribeck as Stribeck
from identification.models.structured.laws.joints import (
    BoucWen as BoucWen,
    Iwan as Iwan,
    Jenkins as Jenkins,
    Joint as Joint,
    Masing as Masing,
)
from identification.models.structured.laws.law import (
    FROM_ZERO as FROM_ZERO,
    PLAIN as PLAIN,
    POSITIVE as POSITIVE,
    Law as Law,
    Transform as Transform,
)
from identification.models.structured.laws.springs import (
    MagnetSpring as MagnetSpring,
    PolynomialSpring as PolynomialSpring,
    SplineSpring as SplineSpring,
    Spring as Spring,
    Stop as Stop,
    UserSpring as UserSpring,
)

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
        Stribeck,
    )
}
"""All laws by their names."""
