"""Request for predictions. Options that do not fit together are refused."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import get_args

from identification import FrequencyResponse
from identification.models import HeldForce
from identification.prediction import Over
from rig.errors import ConfigurationError
from rig.results.predictions.sweeps import CROSSINGS


@dataclass(frozen=True, kw_only=True)
class PredictionRequest:
    """What to predict, and with which models."""

    forces_n: tuple[float, ...] = ()
    """Constant forces for which frequency responses are predicted, N."""
    voltages_v: tuple[float, ...] = ()
    """Constant voltages for which frequency responses are predicted, V."""
    held: str | None = None
    """Constant quantity of the force: ``fundamental``, ``rms`` or ``pure-sine``; by default the first that the model allows."""
    sweeps: tuple[Path, ...] = ()
    """Recordings whose sweeps are predicted."""
    multisines: tuple[Path, ...] = ()
    """Recordings whose realisations a PNLSS or structured model simulates."""
    planned: tuple[str, ...] = ()
    """Plans of future sweeps, by name or file."""
    planned_multisines: tuple[str, ...] = ()
    """Plans of future multisines, by name or file, which a PNLSS or structured model simulates."""
    constants: tuple[str, ...] = ()
    """Inputs of a PNLSS model that are constant, as NAME=VALUE."""
    zero_crossings: str | None = None
    """Read the imposed force from its zero crossings, as in the founding paper: ``half-periods`` or ``periods``. By default the
    force is demodulated."""
    exciter: Path | None = None
    """Exciter model. With it sweeps are predicted from the voltage, otherwise from the recorded force."""
    modes: Path | None = None
    """Linear model. With it the other modes are included, and responses of the other sensors are predicted."""
    references: tuple[Path, ...] = ()
    """Stepped sines that are predicted at their own force and compared."""
    over: str | None = None
    """Quantity over which references are compared: ``frequency`` or ``phase``; by default the phase if the frequency turns
    back."""
    allow_extrapolation: bool = False
    """Whether to predict beyond twice the largest identified modal amplitude."""
    bands: bool = False
    """Whether responses of a structured model get bands from the covariance of its fit."""
    trust_code: bool = False
    """Whether to import the functions that a structured or PNLSS model names."""

    def __post_init__(self) -> None:
        asked = (self.forces_n, self.voltages_v, self.sweeps, self.multisines, self.references)
        if not any((*asked, self.planned, self.planned_multisines)):
            raise ConfigurationError(
                "nothing to predict: give `forces_n`, `voltages_v`, `sweeps`, `planned`, `multisines`, `planned_multisines` or "
                "`references`"
            )
        for name, values, unit in (
            ("forces_n", self.forces_n, "N"),
            ("voltages_v", self.voltages_v, "V"),
        ):
            for level in values:
                if not 0.0 < level < math.inf:
                    raise ConfigurationError(f"`{name}` = {level:g}: allowed is any number above 0, {unit}")
        for name, paths in (
            ("sweeps", self.sweeps),
            ("multisines", self.multisines),
            ("references", self.references),
        ):
            for one, other in combinations(paths, 2):
                if one.exists() and other.exists() and one.samefile(other):
                    raise ConfigurationError(f"`{name}` = {other}: is given twice; each file once")
        for name, value, allowed in (
            ("held", self.held, (None, *get_args(HeldForce))),
            ("over", self.over, (None, *get_args(Over))),
            ("zero_crossings", self.zero_crossings, (None, *CROSSINGS)),
        ):
            if value not in allowed:
                raise ConfigurationError(f"`{name}` = {value!r}: allowed are {', '.join(filter(None, allowed))}")
        if self.exciter is not None and self.zero_crossings is not None:
            raise ConfigurationError(
                "`zero_crossings`: are those of an imposed force; with `exciter` the voltage is imposed"
            )
        if self.zero_crossings is not None and not self.sweeps:
            raise ConfigurationError("`zero_crossings`: is for recorded sweeps; add `sweeps`, or leave it out")

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
