"""Local nonlinear sites without memory: magnets."""

from typing import Literal

from simulators.part import Part, Positive

__all__ = ["Magnet"]

VALID_SHARE_OF_GAP = 0.7


class Magnet(Part):
    """A magnet on the structure facing a fixed one, or two fixed ones on either side (Scheel et al.).

    Force at deflection z from the installed equilibrium: ``-K0/(d0-z)^4 + K0/d0^4`` one-sided, ``-K0/(d0-z)^4 +
    K0/(d0+z)^4`` symmetric. Valid for ``|z| < 0.7 d0``.
    """

    kind: Literal["one_sided", "symmetric"]
    """One fixed magnet, or a pair on either side."""
    at: str
    """Name of the point it sits on."""
    strength_n_m4: Positive
    """Magnet constant K0 (N m^4)."""
    gap_m: Positive
    """Gap d0 at rest."""

    @property
    def stiffness_n_m(self) -> float:
        """Linear part, ``4 K0/d0^5`` one-sided and ``8 K0/d0^5`` symmetric; it belongs to the linear plant."""
        return (4.0 if self.kind == "one_sided" else 8.0) * self.strength_n_m4 / self.gap_m**5

    @property
    def limit_m(self) -> float:
        """Largest deflection for which the force law holds."""
        return VALID_SHARE_OF_GAP * self.gap_m
