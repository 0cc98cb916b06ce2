"""Base class of all configured parts of a virtual rig."""

from typing import Annotated, TypeVar

from pydantic import ConfigDict, Field

from vibrolock.described import Described

Item = TypeVar("Item")

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Several = Annotated[tuple[Item, ...], Field(strict=False)]
"""A tuple that may also be given as a list, as in TOML."""


class Part(Described):
    """Frozen; unknown keys, wrong types and non-finite numbers are refused. The docstring under a field describes it."""

    model_config = ConfigDict(defer_build=True, frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
