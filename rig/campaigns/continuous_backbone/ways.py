"""The ways up and down of a continuous backbone: select their usable instants, and the rows near a level."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification import SlowFlow
from rig.bench import Bench
from rig.campaigns.continuous_backbone.plan import ContinuousBackbonePlan
from rig.campaigns.evaluation.measured_together import Passage
from rig.campaigns.evaluation.nonharmonic_force import FEWEST_PERIODS
from rig.campaigns.evaluation.recorded_flow import AT_VOLTAGE_LIMIT, flagged
from rig.campaigns.evaluation.vibrations import WHY
from rig.tick.sequencer.layout import Outcome, SegmentKind

WAYS = ("up", "down")
FEWEST_INSTANTS = 16  # of a way, for its smoothed properties; chosen
PIECE_PERIODS = FEWEST_PERIODS + 6.0  # of a piece whose force is judged: the fewest, and room at its ends; chosen


@dataclass(frozen=True)
class Way:
    """The usable instants of one way (None: there are none), and why the way contains no more of them."""

    flow: SlowFlow | None
    why: str

    def covers(self, level_m: float) -> bool:
        """Whether the way passed an amplitude."""
        if self.flow is None:
            return False
        return bool(self.flow.amplitude_m.min() <= level_m <= self.flow.amplitude_m.max())


def both_ways(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    rows: np.ndarray,
    passages: Sequence[Passage],
    flow: SlowFlow,
    ended: str,
) -> dict[str, Way]:
    """Return the usable instants of each way: up with the time at the lowest level before it, down with the time after it."""
    middle = flow.time_s * bench.sample_rate_hz
    bad = flagged(bench, rows, flow)
    detuning = np.abs(flow.frequency_hz / flow.modal_frequency_hz - 1.0)
    bad["the lock was lost"] = ~(detuning <= plan.accepted_detuning)
    # An output at its voltage limit keeps the amplitude low but the waveform intact: the instants reached are usable.
    good = ~np.any([at for reason, at in bad.items() if reason != AT_VOLTAGE_LIMIT], axis=0)
    turn = turning_point(passages)
    turn = rows.size if turn is None else turn
    out = {}
    for way in WAYS:
        of_way = [p for p in passages if p.kind is not SegmentKind.RAMP and (p.first < turn) == (way == "up")]
        inside = np.zeros(middle.size, bool)
        for passage in of_way:
            inside |= (middle >= passage.first) & (middle < passage.end)
        why = _why(of_way, ended) or next((reason for reason, at in bad.items() if np.any(at & inside)), "")
        keep = inside & good
        out[way] = Way(
            flow.select(keep) if np.count_nonzero(keep) >= FEWEST_INSTANTS else None,
            why or "the level did not come so far",
        )
    return out


def turning_point(passages: Sequence[Passage]) -> int | None:
    """Return the first row of the way down, which returns to the level at which the way up began; None if there is no way down.

    The remaining levels of a plan may be any of its levels. Therefore the lowest level is taken from the passages.
    """
    lowest = min((p.level for p in passages), default=0.0)
    return next((p.first for p in passages if p.kind is SegmentKind.LEVEL_SWEEP and p.level == lowest), None)


def _why(passages: Sequence[Passage], ended: str) -> str:
    for passage in passages:
        if passage.outcome in (Outcome.INTERRUPTED, Outcome.RUNNING):
            return ended or WHY[Outcome.INTERRUPTED]
        if passage.outcome is not Outcome.DONE:
            return WHY[passage.outcome]
    return "" if passages else ended


def rows_near(bench: Bench, rows: np.ndarray, way: Way, level_m: float) -> np.ndarray:
    """Return the rows of some 20 periods around the instant at which a way came nearest to an amplitude."""
    if way.flow is None:
        return rows[:0]
    nearest = int(np.argmin(np.abs(np.log(way.flow.amplitude_m / level_m))))
    half = 0.5 * PIECE_PERIODS / way.flow.frequency_hz[nearest] * bench.sample_rate_hz
    middle = min(max(way.flow.time_s[nearest] * bench.sample_rate_hz, half), rows.size - half)
    return rows[max(0, int(middle - half)) : int(middle + half)]
