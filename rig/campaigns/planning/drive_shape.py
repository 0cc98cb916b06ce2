"""The mode shape at the drive point that a test is evaluated with, and where it comes from.

Damping and modal amplitude need the mass-normalised mode shape at the drive point; damping goes with its square. A plan with
``[plant]`` has it as measured on this rig, with its standard error. Else the bench's fact is used, whose error is unknown.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from identification import Backbone, PeriodicVibration
from rig.bench import Bench
from rig.campaigns.planning.plant import PlantFacts

WORTH_SAYING = 0.03  # relative difference between bench and plan; the damping's is twice as large


@dataclass(frozen=True, kw_only=True)
class DriveShape:
    """Mode shape at the drive point."""

    value: float | None
    """Mass-normalised, kg^-1/2; None if neither the plan nor the bench has it."""
    std: float | None = None
    """Standard error, kg^-1/2; None if unknown."""
    fact: float | None = None
    """The bench's, kg^-1/2; None if it has none."""
    measured: bool = False
    """Whether it is the measured one, of the plan's ``[plant]``."""
    specimen: str = ""
    """Name of the specimen."""
    source: str = ""
    """Where it comes from, with the bench's beside it if the two differ; empty if there is none."""

    def backbone(
        self, vibrations: Sequence[PeriodicVibration], directions: Sequence[str] = (), repeats: Sequence[int] = ()
    ) -> Backbone:
        """Return vibrations as a backbone with this mode shape."""
        return Backbone(
            tuple(vibrations), self.specimen, self.value, tuple(directions), tuple(repeats), self.std, self.source
        )

    def damping_std(self, damping: float, std: float) -> float:
        """Return the standard error of a damping: ``std``, and twice the relative standard error of the mode shape."""
        return math.hypot(std, 2.0 * damping * (self.std or 0.0) / (self.value or math.inf))

    def __str__(self) -> str:
        """In words, with the 95 % interval."""
        if self.value is None:
            return "mode shape at the drive point: unknown; damping needs it"
        error = "" if self.std is None else f" +- {1.96 * self.std:.2g}"
        return f"mode shape at the drive point: {self.value:.5g}{error} kg^-1/2, {self.source}"


def drive_shape(bench: Bench, plant: PlantFacts | None) -> DriveShape:
    """Return the mode shape that a test is evaluated with: as measured, of the plan's ``plant``, else the bench's fact."""
    specimen, fact = bench.specimen.name, bench.specimen.drive_mode_shape
    if plant is None:
        return DriveShape(
            value=fact, fact=fact, specimen=specimen, source="" if fact is None else f"of the bench {bench.name}"
        )
    source, ratio = "[plant] of the plan", 1.0 if fact is None else abs(fact) / plant.drive_shape
    if abs(ratio - 1.0) > WORTH_SAYING:
        source += f"; that of the bench, {fact:g}, is {ratio:.2f} times as large, damping with it {ratio**2:.2f} times"
    return DriveShape(
        value=plant.drive_shape,
        std=plant.drive_shape_std,
        fact=fact,
        measured=True,
        specimen=specimen,
        source=source,
    )
