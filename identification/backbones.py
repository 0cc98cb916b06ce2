"""A measured backbone: settled periodic states near phase resonance, level by level."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.measurements import PeriodicVibration
from vibrolock.arrays import Float
from vibrolock.results import Result


@dataclass(frozen=True, eq=False)
class Backbone(Result):
    """Settled periodic states near phase resonance, in the order they were measured.

    Raises `IdentificationError` if there are no points, if their channels or numbers of harmonics differ, if the
    labels do not match the points, or if the mode shape or its standard error is not a number that is allowed.

    Parameters
    ----------
    points
        The states, all with the same channels and the same number of harmonics.
    specimen
        Name of what was tested.
    drive_mode_shape
        Mass-normalised deflection shape of the tested linear mode at the drive point, kg^-1/2; None if unknown.
    directions
        ``up`` or ``down`` for every point; empty if it was not noted.
    repeats
        Number of the pass through the levels for every point, from 1; empty if it was not noted.
    drive_mode_shape_std
        Standard error of ``drive_mode_shape``, kg^-1/2, the same error at all points; None if unknown.
    drive_mode_shape_source
        Where ``drive_mode_shape`` comes from, in words; empty if it was not noted.
    """

    points: tuple[PeriodicVibration, ...]
    specimen: str = ""
    drive_mode_shape: float | None = None
    directions: tuple[str, ...] = ()
    repeats: tuple[int, ...] = ()
    drive_mode_shape_std: float | None = None
    drive_mode_shape_source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(self.points))
        IdentificationError.raise_if(not self.points, "a backbone needs at least one", field="points")
        first = self.points[0]
        for number, point in enumerate(self.points):
            if point.channels != first.channels or point.harmonics.shape != first.harmonics.shape:
                reason = "channels or harmonics differ from those of points[0]"
                raise IdentificationError(reason, field=f"points[{number}]")
        if self.drive_mode_shape is not None and not (np.isfinite(self.drive_mode_shape) and self.drive_mode_shape):
            allowed = "finite and not zero"
            raise IdentificationError(field="drive_mode_shape", value=self.drive_mode_shape, allowed=allowed)
        std = self.drive_mode_shape_std
        if std is not None and not (np.isfinite(std) and std >= 0.0):
            raise IdentificationError(field="drive_mode_shape_std", value=std, allowed="0 or above")
        for name, labels in (("directions", self.directions), ("repeats", self.repeats)):
            if labels and len(labels) != len(self.points):
                raise IdentificationError(f"{len(labels)} given for {len(self.points)} points", field=name)
        if unknown := set(self.directions) - {"up", "down"}:
            raise IdentificationError(f"'{sorted(unknown)[0]}' given", field="directions", allowed="up and down")

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels of every point."""
        return self.points[0].channels

    @property
    def force_n(self) -> Float:
        """float[n_points]: peak of the fundamental of the force, N."""
        return np.array([point.force_n for point in self.points])

    @property
    def frequency_hz(self) -> Float:
        """float[n_points]: frequency of the vibration, Hz."""
        return np.array([point.frequency_hz for point in self.points])

    @property
    def amplitude_m(self) -> Float:
        """float[n_points]: peak of the fundamental of the drive-point displacement, m."""
        return np.array([point.amplitude_m for point in self.points])

    @property
    def phase_error_deg(self) -> Float:
        """float[n_points]: target phase lag minus measured phase lag, degrees."""
        return np.array([point.phase_error_deg for point in self.points])

    def table(self) -> list[dict[str, float | str]]:
        """Return one dictionary a point: force, frequency, amplitude, phase error, and direction and pass where noted."""
        columns: dict[str, Sequence[float | str]] = {
            "force_n": self.force_n.tolist(),
            "frequency_hz": self.frequency_hz.tolist(),
            "amplitude_m": self.amplitude_m.tolist(),
            "phase_error_deg": self.phase_error_deg.tolist(),
            **({"direction": self.directions} if self.directions else {}),
            **({"repeat": self.repeats} if self.repeats else {}),
        }
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def select(self, keep: Sequence[bool]) -> "Backbone":
        """Return the backbone of the points where ``keep`` is true, with their labels."""
        if len(keep) != len(self.points):
            raise IdentificationError(f"{len(keep)} given for {len(self.points)} points", field="keep")
        chosen = [index for index, kept in enumerate(keep) if kept]
        return replace(
            self,
            points=tuple(self.points[i] for i in chosen),
            directions=tuple(self.directions[i] for i in chosen) if self.directions else (),
            repeats=tuple(self.repeats[i] for i in chosen) if self.repeats else (),
        )

    def settled(self) -> "Backbone":
        """Return the backbone of the settled points alone."""
        return self.select([point.settled for point in self.points])

    def passes(self) -> tuple["Backbone", ...]:
        """Split into one backbone per pass (direction and repeat), in the order of their first points."""
        count = len(self.points)
        labels = list(zip(self.directions or ("",) * count, self.repeats or (0,) * count, strict=True))
        return tuple(self.select([label == one for label in labels]) for one in dict.fromkeys(labels))
