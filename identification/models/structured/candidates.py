"""Laws among which one is chosen for an element. A further law joins by one entry."""

import math
from typing import NamedTuple

from identification.models.structured.element_trials import names_of
from identification.models.structured.laws import (
    BoucWen,
    Coulomb,
    Iwan,
    Jenkins,
    Law,
    MagnetSpring,
    Masing,
    PolynomialDamper,
    PolynomialSpring,
    SplineSpring,
    Stop,
    Stribeck,
)

AUTO = "auto"
"""In place of laws: they are chosen."""
LINEAR = "linear"
"""Name of the candidate without a law."""


class Candidate(NamedTuple):
    """Laws that are tried."""

    laws: tuple[Law, ...]
    """With their initial numbers; none for a linear structure."""
    family: str
    """``spring``, ``damper`` or ``joint``: of two families one each is tried together (`PAIRS`)."""
    reason: str
    """What it is tried for."""
    held: int = 0
    """Number of the first laws that keep the numbers in which they are not linear until they are fitted."""
    late: bool = False
    """Whether it is tried alone, and only if no other explains the data: its steps take many times as long as others."""
    refines: str = ""
    """Kind of the law that a late one refines: it is tried only if that one is kept."""

    @property
    def numbers(self) -> int:
        """Number of the numbers that a fit moves: of two that fit alike, the smaller wins."""
        return sum(law.vector.size for law in self.laws)

    @property
    def name(self) -> str:
        """Kinds of its laws, as in ``stop below``."""
        return names_of(self.laws) or LINEAR

    def beside(self, laws: tuple[Law, ...]) -> "Candidate":
        """Return it together with other laws, which a regression has found."""
        return Candidate((*laws, *self.laws), "", f"beside {names_of(laws)}: {self.reason}", len(laws))

    @property
    def tried(self) -> int:
        """Number of combinations that its regression tries."""
        return math.prod(len(law.candidates()) for law in self.laws)


NO_LAW = Candidate((), "", "a structure that is linear needs no law")
CANDIDATES = (
    Candidate((PolynomialSpring(),), "spring", "smooth stiffness: large bending, softening"),
    Candidate((SplineSpring(),), "spring", "stiffness of any form"),
    Candidate((Stop(),), "spring", "contact on the side above"),
    Candidate((Stop(sides="below"),), "spring", "contact on the side below"),
    Candidate((Stop(sides="both"),), "spring", "play: contact on both sides"),
    Candidate((MagnetSpring(),), "spring", "magnets, with two numbers where a spring has five"),
    Candidate((PolynomialDamper(),), "damper", "damping that grows with the amplitude"),
    Candidate((Jenkins(),), "joint", "dry friction behind a spring"),
    Candidate((Coulomb(),), "joint", "dry friction without a spring"),
    Candidate((Iwan(),), "joint", "a bolted joint: micro-slip by four numbers"),
    Candidate((Masing(),), "joint", "a joint with any distribution of slips"),
    Candidate((BoucWen(),), "joint", "hysteresis that bends smoothly, or hardens", late=True),
    Candidate((Stribeck(),), "joint", "dry friction that is larger at rest", late=True, refines=Coulomb.kind),
)
"""Laws that need nothing from the user, in no order: their numbers and errors decide. A regression does not tell `Stribeck`
from `Coulomb`."""
PAIRS = (("spring", "damper"), ("spring", "joint"))
"""Families of laws that are tried together, the best of the first with each of the second. A joint is also a damper."""
