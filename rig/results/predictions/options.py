"""Options of predictions that all kinds of models have in common."""

import math
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from identification import FrequencyResponse
from identification.models import HeldForce
from identification.prediction import Over
from rig.errors import ConfigurationError
from rig.results.options import Option, Options

_ASKED = ("forces_n", "voltages_v", "sweeps", "planned", "multisines", "planned_multisines", "references")
"""Fields that ask for a prediction."""
_FILES = ("sweeps", "multisines", "references")
"""Fields of which each file may be given once."""

Levels = tuple[Annotated[float, Field(gt=0.0)], ...]
Crossings = Literal["half-periods", "periods"]
"""Zero crossings between which a force is read: all of them, or only those in the same direction."""


class PredictionOptions(Options):
    """What to predict."""

    forces_n: Annotated[
        Levels, Option(flag="--frequency-response", metavar="FORCE_N", allowed="is any number above 0, N")
    ] = ()
    """Predict the frequency response at this constant force; may be repeated."""
    held: Annotated[HeldForce | None, Option(flag="--force")] = None
    """What is constant: fundamental (peak), rms, or pure-sine."""
    references: Annotated[tuple[Path, ...], Option(flag="--reference")] = ()
    """Stepped sines to compare with (recorded or imported); may be repeated."""
    over: Over | None = None
    """Compare over frequency or phase; by default phase if the measured frequency turns back."""

    @model_validator(mode="after")
    def _check_what_is_asked(self) -> Self:
        asks = [name for name in _ASKED if name in type(self).model_fields]
        if not any(getattr(self, name) for name in asks):
            *some, last = (f"`{name}`" for name in _ASKED)
            raise ConfigurationError(f"nothing to predict: give {', '.join(some)} or {last}")
        for name in (name for name in _FILES if name in asks):
            for one, other in combinations(getattr(self, name), 2):
                if one.exists() and other.exists() and one.samefile(other):
                    raise ConfigurationError(f"`{name}` = {other}: is given twice; each file once")
        return self

    def forces_without_reference(self, references: Iterable[FrequencyResponse], held: str) -> tuple[float, ...]:
        """Return the requested forces, N, at which no reference was held: the others are predicted with their reference.

        ``held`` is the quantity at which references of constant force are predicted.
        """
        if (self.held or held) != held:
            return self.forces_n
        known = [reference.level for reference in references if reference.controlled == "force"]
        return tuple(
            force for force in self.forces_n if not any(math.isclose(force, level, rel_tol=1e-6) for level in known)
        )


Sweeps = Annotated[tuple[Path, ...], Option(flag="--sweep")]
Planned = Annotated[tuple[str, ...], Option(flag="--planned-sweep", metavar="PLAN")]
