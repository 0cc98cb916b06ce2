"""What a study is asked for, and where in its folder everything is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.bench import Bench
from rig.errors import ConfigurationError
from rig.reproduce.specimens import Specimen

__all__ = ["INPUTS", "PAPER", "PARTS", "Options"]

PAPER = "paper"
"""In place of a number of models: as many as the paper has."""
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
    """Number of saturating features beside the monomials."""
    iterations: int = 60
    """Iterations of a fit, at most."""
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
            raise ConfigurationError(f"--input {self.input}: allowed is {', '.join(INPUTS)}")
        wrong = self.without - set(PARTS)
        if wrong:
            raise ConfigurationError(f"--without {min(wrong)}: allowed is {', '.join(PARTS)}")
        if self.models != PAPER and not (isinstance(self.models, int) and self.models > 0):
            raise ConfigurationError(f"--models {self.models}: allowed is a number from 1, or {PAPER}")
        if not 0.0 <= self.scatter <= 0.05:
            raise ConfigurationError(f"--scatter {self.scatter:g}: allowed is 0 to 0.05")
        if self.channel not in self.specimen.outputs:
            raise ConfigurationError(f"--channel {self.channel}: allowed is {', '.join(self.specimen.outputs)}")
        if self.levels is not None and not 1 <= self.levels <= len(self.specimen.levels):
            raise ConfigurationError(f"--levels {self.levels}: allowed is 1 to {len(self.specimen.levels)}")

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
    def variant(self) -> str:
        """What tells these models from others of the same recordings: the name of their folder."""
        backbone = "-backbone" if self.with_backbone else ""
        return f"{self.input}{backbone}" + (f"-tanh{self.saturating}" if self.saturating else "")

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
        return {"variant": self.variant, "iterations": self.iterations, "levels": list(self.plans)}
