"""Effect of a remedy on the twins on which it was tried."""

from dataclasses import dataclass

from pydantic import JsonValue


@dataclass(frozen=True)
class Effect:
    """What a remedy did on the twins on which it was tried."""

    name: str
    """The remedy."""
    changes: dict[str, JsonValue]
    """Keys of the plan with their new values."""
    ends_well: tuple[float, float]
    """Probability that the plan ends well, without and with it."""
    trips: tuple[float, float]
    """Probability of a trip, without and with it."""
    points: tuple[float, float]
    """Accepted points over those of the plan as it was given, in the mean, without and with it; at most 1."""
    draws: int
    """Number of twins on which it was tried."""
    taken: bool = False
    """Whether it is part of the improved plan."""
