"""Options of a study, and the places of all files in its folder."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification import FitSettings
from rig.bench import Bench
from rig.errors import ConfigurationError
from studies.reproduce.specimens import Specimen

PAPER = "paper"
"""Value of ``models`` that selects the numbers of models in the paper."""
_SATURATING = 60
"""Fewest default iterations with saturating features, because their weights begin at random."""
INPUTS = ("force", "voltage")
MODELS = ("pnlss", "structured")
PARTS = ("steady", "sweeps")
"""Parts of a study that can be left out."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a study of one specimen."""

    specimen: Specimen
    """The specimen, with the settings of the paper."""
    bench: Bench
    """The virtual bench that is tested, without scatter."""
    folder: Path
    """Folder for all files."""
    models: int | str = 5
    """Number of models of each training set, or ``paper``."""
    scatter: float = 0.0
    """Relative standard deviation of modal frequencies from run to run; above 0 each realisation is a separate run."""
    model: str = "pnlss"
    """Kind of the models: ``pnlss`` or ``structured``."""
    shifts: bool = False
    """Whether the modes of every run have shifts of their own in the fit (`identification.fit_with_scatter`)."""
    input: str = "force"
    """Input of the models: ``force`` or ``voltage``."""
    beside: tuple[str, ...] = ()
    """Plans of the specimen whose points are fitted together with the multisines."""
    saturating: int = 0
    """Number of saturating features of each equation, which replace the monomials."""
    states: int | None = None
    """Number of states of the models; None for that of the paper."""
    realisations: int | None = None
    """Largest number of realisations of each level to which a model is fitted; None for all but the two for validation and
    test."""
    iterations: int | None = None
    """Largest number of iterations of a fit; None for the default."""
    levels: int | None = None
    """Number of the specimen's levels to use, from the lowest; None for all."""
    channel: str = "drive"
    """Output whose errors are listed in the tables."""
    jobs: int = 1
    """Number of models that are identified in parallel."""
    seed: int = 0
    """Seed of noise, scatter and phases."""
    without: frozenset[str] = frozenset()
    """Parts that are left out."""

    def __post_init__(self) -> None:
        if self.bench.driver.name != "virtual":
            raise ConfigurationError(
                f"driver.name = {self.bench.driver.name!r} in bench {self.bench.name}: allowed is 'virtual'; a study "
                "holds predictions against the truth, which only a virtual bench tells"
            )
        if self.model not in MODELS:
            raise ConfigurationError(f"`model` {self.model}: allowed is {', '.join(MODELS)}")
        if self.model == "structured":
            for name, given in (
                ("input", self.input != "force"),
                ("beside", self.beside),
                ("saturating", self.saturating),
                ("states", self.states),
                ("iterations", self.iterations),
            ):
                if given:
                    raise ConfigurationError(f"`{name}` {getattr(self, name)}: is of PNLSS models; leave it out")
        if self.shifts and not self.scatter:
            raise ConfigurationError("is for runs that differ", field="shifts", hint="add `scatter`, or leave it out")
        if self.input not in INPUTS:
            raise ConfigurationError(f"`input` {self.input}: allowed is {', '.join(INPUTS)}")
        for name in self.beside:
            if name not in self.specimen.beside:
                raise ConfigurationError(f"`beside` {name}: allowed is {', '.join(self.specimen.beside)}")
        numbers = isinstance(self.models, int) and self.models > 0
        for name, text, right, allowed in (
            ("without", min(self.without - set(PARTS), default=""), self.without <= set(PARTS), ", ".join(PARTS)),
            ("models", str(self.models), self.models == PAPER or numbers, f"a number from 1, or {PAPER}"),
            ("scatter", f"{self.scatter:g}", 0.0 <= self.scatter <= 0.05, "0 to 0.05"),
            ("channel", self.channel, self.channel in self.specimen.outputs, ", ".join(self.specimen.outputs)),
        ):
            if not right:
                raise ConfigurationError(f"`{name}` {text}: allowed is {allowed}")
        for name, value in (("states", self.states), ("realisations", self.realisations)):
            if value is not None and value < 1:
                raise ConfigurationError(f"`{name}` {value}: allowed is 1 and above")
        if self.levels is not None and not 1 <= self.levels <= len(self.specimen.levels):
            raise ConfigurationError(f"`levels` {self.levels}: allowed is 1 to {len(self.specimen.levels)}")

    @property
    def plans(self) -> dict[str, str]:
        """Multisine plans of the levels used, by level."""
        return dict(list(self.specimen.levels.items())[: self.levels])

    @property
    def counts(self) -> int | Mapping[str, int]:
        """Number of models of every training set."""
        if isinstance(self.models, int):
            return self.models
        sets = (*self.plans, *(("mixed",) if self.mixed else ()))
        return {name: self.specimen.paper_models[name] for name in sets}

    @property
    def mixed(self) -> bool:
        """Whether there is a training set of all levels, which needs more than one level."""
        return len(self.plans) > 1

    @property
    def model_states(self) -> int:
        """Number of states of the models."""
        return self.specimen.states if self.states is None else self.states

    @property
    def fit_settings(self) -> FitSettings:
        """Settings of every fit."""
        of = self.specimen
        usual = max(of.iterations, _SATURATING) if self.saturating else of.iterations
        most = usual if self.iterations is None else self.iterations
        return FitSettings(iterations=most, patience=of.patience, least_gain=0.0)

    @property
    def variant(self) -> str:
        """Name of the models' folder, which distinguishes them from other models of the same recordings."""
        beside = "".join(f"-{name}" for name in self.beside)
        saturating = f"-tanh{self.saturating}" if self.saturating else ""
        states = f"-n{self.model_states}" if self.model_states != self.specimen.states else ""
        fitted = f"-r{self.realisations}" if self.realisations is not None else ""
        shifts = "-shifts" if self.shifts else ""
        if self.model == "structured":
            return f"structured{fitted}{shifts}"
        return f"{self.input}{beside}{saturating}{states}{fitted}{shifts}"

    @property
    def recordings(self) -> Path:
        """Folder of the recordings."""
        return self.folder / "recordings"

    @property
    def models_folder(self) -> Path:
        """Folder of the models."""
        return self.folder / self.variant / "models"

    def result(self, name: str) -> Path:
        """Return the path of a result file."""
        return self.folder / self.variant / name

    @property
    def of_the_recordings(self) -> dict[str, Any]:
        """Settings that must not change while the recordings are kept."""
        return {
            "specimen": self.specimen.name,
            "bench": self.bench.model_dump(mode="json"),
            "scatter": self.scatter,
            "seed": self.seed,
        }

    @property
    def of_the_models(self) -> dict[str, Any]:
        """Settings that must not change while the models are kept. The number of models may change."""
        return {"variant": self.variant, "iterations": self.fit_settings.iterations, "levels": list(self.plans)}
