"""What a study is asked for, and where in its folder everything is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification import FitSettings
from rig.bench import Bench
from rig.errors import ConfigurationError
from rig.reproduce.specimens import Specimen

__all__ = ["INPUTS", "PAPER", "PARTS", "Options"]

PAPER = "paper"
"""In place of a number of models: as many as the paper has."""
_SATURATING = 60
"""Iterations that saturating features need at least: their weights begin at random."""
INPUTS = ("force", "voltage")
PARTS = ("steady", "sweeps")
"""What a study can do without."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """A study of one specimen."""

    specimen: Specimen
    """What the paper did with it."""
    bench: Bench
    """The virtual bench that is tested, without scatter."""
    folder: Path
    """Where everything is kept."""
    models: int | str = 5
    """Models of each training set, or ``paper``."""
    scatter: float = 0.0
    """Relative standard deviation of modal frequencies from run to run; above 0 each realisation is a run of its own."""
    input: str = "force"
    """What goes into the models."""
    with_backbone: bool = False
    """Whether points of a backbone are fitted beside the multisines."""
    saturating: int = 0
    """Number of saturating features of each equation, in place of the monomials."""
    states: int | None = None
    """States of the models; None for the paper's number."""
    realisations: int | None = None
    """Realisations of each level that a model is fitted to, at most; None for all but the two that choose and test."""
    iterations: int | None = None
    """Iterations of a fit, at most; None for the usual number."""
    levels: int | None = None
    """How many of the specimen's levels, from the lowest; None for all."""
    channel: str = "drive"
    """Output whose errors the tables have."""
    jobs: int = 1
    """Models that are identified at the same time."""
    seed: int = 0
    """Seed of noise, scatter and phases."""
    without: frozenset[str] = frozenset()
    """What is left out."""

    def __post_init__(self) -> None:
        if self.bench.driver.name != "virtual":
            raise ConfigurationError(
                f"driver.name = {self.bench.driver.name!r} in bench {self.bench.name}: allowed is 'virtual'; a study "
                "holds predictions against the truth, which only a virtual bench tells"
            )
        if self.input not in INPUTS:
            raise ConfigurationError(f"`input` {self.input}: allowed is {', '.join(INPUTS)}")
        wrong = self.without - set(PARTS)
        if wrong:
            raise ConfigurationError(f"`without` {min(wrong)}: allowed is {', '.join(PARTS)}")
        if self.models != PAPER and not (isinstance(self.models, int) and self.models > 0):
            raise ConfigurationError(f"`models` {self.models}: allowed is a number from 1, or {PAPER}")
        if not 0.0 <= self.scatter <= 0.05:
            raise ConfigurationError(f"`scatter` {self.scatter:g}: allowed is 0 to 0.05")
        if self.channel not in self.specimen.outputs:
            raise ConfigurationError(f"`channel` {self.channel}: allowed is {', '.join(self.specimen.outputs)}")
        for name, value in (("states", self.states), ("realisations", self.realisations)):
            if value is not None and value < 1:
                raise ConfigurationError(f"`{name}` {value}: allowed is 1 and above")
        if self.levels is not None and not 1 <= self.levels <= len(self.specimen.levels):
            raise ConfigurationError(f"`levels` {self.levels}: allowed is 1 to {len(self.specimen.levels)}")

    @property
    def plans(self) -> dict[str, str]:
        """Multisine plans by level, those that are used."""
        return dict(list(self.specimen.levels.items())[: self.levels])

    @property
    def counts(self) -> int | Mapping[str, int]:
        """Models of every training set."""
        if isinstance(self.models, int):
            return self.models
        sets = (*self.plans, *(("mixed",) if self.mixed else ()))
        return {name: self.specimen.paper_models[name] for name in sets}

    @property
    def mixed(self) -> bool:
        """Whether there is a set of all levels: of one alone there is none."""
        return len(self.plans) > 1

    @property
    def model_states(self) -> int:
        """States of the models."""
        return self.specimen.states if self.states is None else self.states

    @property
    def fit_settings(self) -> FitSettings:
        """Of every fit."""
        of = self.specimen
        usual = max(of.iterations, _SATURATING) if self.saturating else of.iterations
        most = usual if self.iterations is None else self.iterations
        # From random weights, steps of a part of the samples end in poor places: 7 % in place of 1 % at the same level.
        every = 1 if self.saturating else of.every
        return FitSettings(iterations=most, patience=of.patience, every=every)

    @property
    def variant(self) -> str:
        """What tells these models from others of the same recordings: the name of their folder."""
        backbone = "-backbone" if self.with_backbone else ""
        saturating = f"-tanh{self.saturating}" if self.saturating else ""
        states = f"-n{self.model_states}" if self.model_states != self.specimen.states else ""
        fitted = f"-r{self.realisations}" if self.realisations is not None else ""
        return f"{self.input}{backbone}{saturating}{states}{fitted}"

    @property
    def recordings(self) -> Path:
        """Folder of the recordings."""
        return self.folder / "recordings"

    @property
    def models_folder(self) -> Path:
        """Folder of the models."""
        return self.folder / self.variant / "models"

    def result(self, name: str) -> Path:
        """A file of results."""
        return self.folder / self.variant / name

    @property
    def of_the_recordings(self) -> dict[str, Any]:
        """What may not change while the recordings stay."""
        return {
            "specimen": self.specimen.name,
            "bench": self.bench.model_dump(mode="json"),
            "scatter": self.scatter,
            "seed": self.seed,
        }

    @property
    def of_the_models(self) -> dict[str, Any]:
        """What may not change while the models stay; their number may."""
        return {"variant": self.variant, "iterations": self.fit_settings.iterations, "levels": list(self.plans)}
