"""Options of a run that do not depend on its plan: seed, pace, output file, progress display, arming, recorded facts."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from rig.arming.arming import Arm
from rig.arming.checked_scale import CheckedScale
from rig.arming.rehearsed import Rehearsed
from rig.arming.run_facts import About
from rig.errors import ConfigurationError

if TYPE_CHECKING:
    import numpy as np

    from rig.tick.tick import Tick

LARGEST_SEED = 2**63 - 1  # the largest whole number of TOML and HDF5


class Progress(Protocol):
    """Receives the events of a run for a display."""

    def point(self, point: Any, number: int, total: int) -> None:
        """Take note that a `rig.campaigns.evaluation.point.Point` was measured or has failed; it is ``number`` of ``total``."""

    def advance(self, rows: "np.ndarray", tick: "Tick") -> None:
        """Take note that a chunk of telemetry rows was recorded."""

    def remark(self, text: str) -> None:
        """Take note of a one-line remark of the driver or the bench."""


class Silent:
    """A `Progress` that shows nothing."""

    def point(self, point: Any, number: int, total: int) -> None:
        """Do nothing."""

    def advance(self, rows: "np.ndarray", tick: "Tick") -> None:
        """Do nothing."""

    def remark(self, text: str) -> None:
        """Do nothing."""


class RemarksOnce:
    """Passes the events of several runs on to one display: each remark the first time only, points without their total.

    What is still to come is not known, for each run decides on the next.
    """

    def __init__(self, display: Progress) -> None:
        self._display, self._known = display, set[str]()

    def point(self, point: Any, number: int, total: int) -> None:
        """Pass it on."""
        self._display.point(point, number, 0)

    def advance(self, rows: "np.ndarray", tick: "Tick") -> None:
        """Pass it on."""
        self._display.advance(rows, tick)

    def remark(self, text: str) -> None:
        """Pass it on unless it was."""
        if text not in self._known:
            self._known.add(text)
            self._display.remark(text)


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Options of a run that do not depend on its plan. Campaigns, checks and tunings take the same options.

    Raises `ConfigurationError` for a seed outside its range.
    """

    seed: int | None = None
    """Seed of a virtual rig's noise, 0 to 2**63 - 1. If None: 0 for a new recording, and for a further part a seed not used
    before."""
    realtime: bool = False
    """Whether a virtual rig runs no faster than the wall clock."""
    overwrite: bool = False
    """Whether a new recording may replace an existing file."""
    progress: Progress = field(default_factory=Silent)
    """Receives the events of the run."""
    arm: Arm = None
    """Permission to move something physical: True, a callable that asks a person, or None (`rig.arming.arming`)."""
    about: About = field(default_factory=About)
    """Operator, specimen and notes, recorded with the part."""
    check: CheckedScale | None = None
    """Scale of force and motion from a check of the bench, in place of the last one that is remembered."""
    rehearsal: Rehearsed | None = None
    """A rehearsal of the plan on this bench, recorded with the part; some benches need one (`rig.arming.rehearsed`)."""
    override_rehearsal: str = ""
    """Why the plan may run although such a bench refuses; recorded with who said so."""

    def __post_init__(self) -> None:
        if self.seed is not None and not 0 <= self.seed <= LARGEST_SEED:
            raise ConfigurationError(field="seed", value=self.seed, allowed="0 to 2**63 - 1")
        if not self.override_rehearsal.isprintable():
            raise ConfigurationError(
                field="override_rehearsal", value=self.override_rehearsal, allowed="printable text in one line"
            )
