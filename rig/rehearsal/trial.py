"""Trial of a rehearsal: the plan on one virtual rig, by the same runner, loop and evaluation as a test."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from itertools import count

import numpy as np

from rig.arming.run_options import Silent
from rig.bench import Bench
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.stored_point import point_from, value_of
from rig.campaigns.planning.plan import Plan
from rig.campaigns.running.attempts import MeasuredBefore
from rig.campaigns.running.execution import Execution
from rig.campaigns.running.settings import tick_settings
from rig.errors import RigError
from rig.loop.loop import Loop
from rig.loop.session import open_session
from rig.rehearsal.peaks import Peaks, Rows
from vibrolock.described import Described

FURTHER_PART = 1 << 32
"""Difference between the seeds of the parts of a run, so that each has other noise; chosen: above all numbers of draws."""
CHUNK_S = 2.5
"""Chunks of a twin's rows, s: a run that its campaign stops ends up to that much later. Chosen: what is done once a chunk costs
2 % of a twin; with the loop's own chunks it would be 10 %."""
REFUSED = "REFUSED"
"""End of a trial whose plan the bench refuses before anything moves."""
NOT_COMPUTED = "NOT_COMPUTED"
"""End of a trial whose twin could not be built or simulated."""


@dataclass(frozen=True, kw_only=True)
class TrialPoint:
    """One point of the plan as a trial measured it."""

    number: int
    """Number in the plan, from 0."""
    level: float
    """Level in the plan's unit."""
    quality: str
    """Quality of the point (`rig.campaigns.evaluation.point.Quality`)."""
    reason: str
    """Why it is not accepted; empty if it is."""
    frequency_hz: float = np.nan
    """Frequency of the vibration, Hz."""
    force_n: float = np.nan
    """Peak of the force's fundamental, N."""
    amplitude_m: float = np.nan
    """Peak of the drive point's fundamental displacement, m."""
    voltage_v: float = np.nan
    """Amplitude of the output, V."""
    modal_frequency_hz: float = np.nan
    """Frequency at phase resonance, Hz."""
    damping_ratio: float = np.nan
    """Modal damping ratio as reported."""
    frequency_std_hz: float = np.nan
    """Its standard error as reported, Hz."""
    damping_ratio_std: float = np.nan
    """Its standard error as reported."""
    phase_error_deg: float = np.nan
    """Wanted minus measured lag, deg."""
    settle_periods: float = np.nan
    """Periods until it settled or failed."""
    refused_before: int = 0
    """Attempts that were refused for something that passes, before this result."""

    @property
    def accepted(self) -> bool:
        """Whether the point is used."""
        return self.quality in ("good", "warned")


MEASURED = tuple(one.name for one in fields(TrialPoint) if one.type is float and one.default is not MISSING)
"""Names of the measured quantities of a point."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """How the plan ended on one rig."""

    end: str
    """Name of the `rig.tick.safety.layout.EndReason`, ``REFUSED`` if the bench refuses the plan, or ``NOT_COMPUTED`` if the
    twin could not be built or simulated."""
    text: str
    """The same in a sentence."""
    tripped: bool = False
    """Whether the run tripped."""
    completed: bool = False
    """Whether every point was accepted."""
    channel: str = ""
    """Channel of a trip; empty for none."""
    level: float = float("nan")
    """Level at which it tripped; NaN otherwise."""
    duration_s: float
    """Time on the rig, s."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """Largest value over its limit, by limit: ``voltage``, and force or acceleration, displacement and range of channels."""
    points: tuple[TrialPoint, ...] = ()
    """Points that were measured or failed, in the order of measurement."""

    @property
    def computed(self) -> bool:
        """Whether the twin could be built and simulated; otherwise ``text`` says why not, and nothing else is known."""
        return self.end != NOT_COMPUTED

    @property
    def lost_lock(self) -> bool:
        """Whether the lock was lost, or never gained, at any point."""
        lost = {"lost-lock", "too-steep", "not-locked", "outside-window"}
        return self.end in ("LOST_LOCK", "NO_LOCK", "NO_LOCK_IN_WINDOW") or any(p.quality in lost for p in self.points)


class _MemoryJournal:
    """Journal of a run in memory, which keeps the points and the end."""

    def __init__(self) -> None:
        self.points: list[Mapping[str, object]] = []
        self.ended: Mapping[str, object] = {}
        self.peaks: Peaks | None = None

    def part(self, information: Mapping[str, object]) -> None:
        """Ignore the beginning of a part."""

    def rows(self, rows: Rows) -> None:
        """Update the peaks by telemetry rows."""
        if self.peaks is not None and rows.size:
            self.peaks.update(rows)

    def event(self, event: Mapping[str, object]) -> None:
        """Ignore an event."""

    def point(self, point: Mapping[str, object]) -> None:
        """Keep a point."""
        self.points.append(point)

    def end(self, end: Mapping[str, object]) -> None:
        """Keep the end of the run."""
        self.ended = end


def run_trial(plan: Plan, bench: Bench, seed: int = 0, *, images_known: bool = True) -> Trial:
    """Run a plan on a virtual bench and return how it ended. Nothing is written to a disk.

    A plan that the bench refuses is a result too, with ``end`` = ``REFUSED``. What a plan knows of its plant at the force's
    harmonics is left out, for a twin is like the rig near its mode only: the loop measures it by its step. ``images_known``:
    points are judged by the images of the held output, as where the driver knows them.
    """
    plan = _without_harmonic_plant(plan)
    try:
        plan.check(bench)
    except RigError as error:
        return Trial(end=REFUSED, text=str(error), duration_s=0.0)
    journal, samples, before = _MemoryJournal(), 0, MeasuredBefore()
    for number in count():
        execution, more = _part(plan, bench, seed + number * FURTHER_PART, journal, before, images_known)
        samples += more
        if not execution.to_repeat:
            break
        before = execution.measured_before_repeat(journal.points)
    return _trial(bench, execution, samples, journal)


def _without_harmonic_plant(plan: Plan) -> Plan:
    law, loop = plan.law, plan.law.harmonics
    if loop is None or not loop.force_per_v or not isinstance(law, Described):
        return plan
    unknown = loop.model_copy(update={"force_per_v": {}})
    return plan.model_copy(update={"controller": law.model_copy(update={"harmonics": unknown})})


def _part(
    plan: Plan, bench: Bench, seed: int, journal: _MemoryJournal, before: MeasuredBefore, images_known: bool
) -> tuple[Execution, int]:
    """Run what ``before`` has left of a plan; return its execution and the number of samples."""
    with open_session(bench, seed) as session:
        segments = plan.segments(bench.sample_rate_hz, before.done | before.given_up)
        settings = tick_settings(plan, bench, segments)
        loop = session.start(settings)
        if isinstance(loop, Loop):
            loop.chunk_s = CHUNK_S
        journal.peaks = journal.peaks or Peaks(bench, loop.tick.arrays.limits)
        images = loop.images if images_known else ()
        execution = Execution(plan, bench, loop, journal, Silent(), before, images=images)
        execution.run({})
        return execution, loop.statistics.samples


def _trial(bench: Bench, execution: Execution, samples: int, journal: _MemoryJournal) -> Trial:
    end, tripped = journal.ended, bool(journal.ended["tripped"])
    at, channel = end.get("tripped_at"), int(execution.tick.guard["channel"][0])
    latest = {table["number"]: table for table in journal.points}
    return Trial(
        end=str(end["reason"]).upper(),
        text=str(end["text"]),
        tripped=tripped,
        completed=bool(end["completed"]),
        channel=bench.channels[channel].name if tripped and channel >= 0 else "",
        level=float(at["level"]) if isinstance(at, Mapping) else float("nan"),
        duration_s=samples / bench.sample_rate_hz,
        shares=journal.peaks.shares() if journal.peaks is not None else {},
        points=tuple(_point(point_from(table, execution.kind.result)) for table in latest.values()),
    )


def not_computed(error: Exception) -> Trial:
    """Return the trial of a twin whose computation failed."""
    text = str(error) if isinstance(error, RigError) else f"{type(error).__name__}: {error}"
    return Trial(end=NOT_COMPUTED, text=text, duration_s=float("nan"))


def _point(point: Point[object]) -> TrialPoint:
    values = {
        name: value_of(point, {"frequency_std_hz": "modal_frequency_std_hz"}.get(name, name)) for name in MEASURED
    }
    return TrialPoint(
        number=point.number,
        level=point.level,
        quality=str(point.quality),
        reason=point.reason,
        refused_before=len(point.refused_before),
        **{name: float(value) for name, value in values.items() if value is not None},
    )
