"""The verdict of a rehearsal: how probable each end is, what it takes, how accurate it is, and what matters most for that."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from rig.rehearsal.rehearsal import Draw, Rehearsal

SIGNIFICANT = 0.01  # probability, over all that is tested, with which an influence may be chance
FEW = 8  # draws with a finite value below which nothing is said of an influence
ADVICE = {
    "frequency_hz": "measure the frequency again just before the test (`rig check`)",
    "damping_ratio": "measure the damping with finer lines (`rig tune`)",
    "drive_shape": "measure the mode shape at the drive point (`rig tune` or a modal test)",
    "moving_mass_kg": "identify the exciter over a wider band",
    "gain_factor": "check the amplifier's gain just before the test (`rig check`)",
    "shift": "run the lowest levels first and look how far the frequency moves",
    "damping_growth": "run the lowest levels first and look how the damping grows",
    "joint_shift": "run the lowest levels first: a joint that slips shows in the damping",
    "joint_slip": "run the lowest levels first: a joint that slips shows in the damping",
    "stop_gap": "look for stops and rattling parts within the motion that the plan asks for",
    "stop_stiffness": "look for stops and rattling parts within the motion that the plan asks for",
    "second_mode": "measure the neighbourhood of the mode with a finer multisine",
}
"""What to measure where an unknown matters most."""


@dataclass(frozen=True)
class Share:
    """A probability estimated from n draws, with its 95 % interval (Wilson's score interval)."""

    count: int
    n: int

    @property
    def value(self) -> float:
        """The estimate."""
        return self.count / self.n if self.n else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        if not self.n:
            return 0.0, 1.0
        found = scipy.stats.binomtest(self.count, self.n).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)

    def to_dict(self) -> dict[str, Any]:
        """Return value and interval as plain data."""
        return {
            "value": self.value,
            "low": self.interval[0],
            "high": self.interval[1],
            "count": self.count,
            "of": self.n,
        }


@dataclass(frozen=True)
class Band:
    """Quantiles of a quantity over the draws: 5 %, 50 % and 95 %, and the largest; NaN if no draw has one."""

    low: float
    middle: float
    high: float
    largest: float
    n: int

    @classmethod
    def of(cls, values: Sequence[float]) -> "Band":
        """Return the band of the finite values."""
        finite = np.array([v for v in values if np.isfinite(v)])
        if not finite.size:
            nothing = float("nan")
            return cls(nothing, nothing, nothing, nothing, 0)
        low, middle, high = np.quantile(finite, [0.05, 0.5, 0.95])
        return cls(float(low), float(middle), float(high), float(finite.max()), finite.size)

    def to_dict(self) -> dict[str, Any]:
        """Return the quantiles as plain data."""
        return {"5 %": self.low, "50 %": self.middle, "95 %": self.high, "largest": self.largest, "n": self.n}


@dataclass(frozen=True)
class TripVerdict:
    """One way to trip."""

    cause: str
    """Name of the `rig.tick.safety.layout.EndReason`."""
    channel: str
    """Channel; empty for none."""
    levels: dict[float, int]
    """Number of draws by the level at which it happened."""
    share: Share
    """Share of the draws."""


@dataclass(frozen=True)
class PointVerdict:
    """One point of the plan over all draws."""

    number: int
    """Number in the plan, from 0."""
    level: float
    """Its level."""
    accepted: Share
    """Share of the draws in which it is accepted."""
    qualities: dict[str, int]
    """Number of draws by the quality of the point; ``not begun`` where the run ended before."""
    reasons: dict[str, int]
    """Why it is refused, without numbers, and how often; the most frequent first."""
    bands: dict[str, Band]
    """Bands of ``frequency_hz``, ``force_n``, ``amplitude_m``, ``voltage_v`` and ``damping_ratio`` where it is accepted."""


@dataclass(frozen=True)
class Influence:
    """How strongly an outcome depends on an unknown."""

    outcome: str
    """The outcome."""
    unknown: str
    """The unknown."""
    correlation: float
    """Spearman's rank correlation."""
    p_value: float
    """Probability of one as large by chance."""
    advice: str
    """What to measure."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The verdict on the twins that could be computed; all shares are of these."""

    not_computed: Share
    """Share of all draws whose twin could not be built or simulated."""
    why_not_computed: dict[str, int]
    """Why not, without numbers, and how often; the most frequent first."""
    ends_well: Share
    """Every point accepted."""
    trips: Share
    """The run trips, or the bench refuses the plan."""
    lost_lock: Share
    """The lock is lost, or never gained, at a point at least."""
    ways_to_trip: tuple[TripVerdict, ...]
    """Causes, the most frequent first."""
    points: tuple[PointVerdict, ...]
    """Points by number."""
    duration_s: Band
    """Time on the rig."""
    margins: dict[str, Band]
    """Largest value over its limit, by limit, the closest first."""
    frequency_error: Band
    """Size of the relative error of the modal frequency against harmonic balance."""
    damping_error: Band
    """Size of the relative error of the damping ratio as reported."""
    influences: tuple[Influence, ...]
    """What matters most, the strongest first."""

    @property
    def trips_at_most(self) -> float:
        """Upper end of the 95 % interval of a trip's probability, if each twin that could not be computed trips."""
        missing = self.not_computed.count
        return Share(self.trips.count + missing, self.trips.n + missing).interval[1]

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as plain data."""
        return {
            "not_computed": self.not_computed.to_dict(),
            "why_not_computed": self.why_not_computed,
            "ends_well": self.ends_well.to_dict(),
            "trips": self.trips.to_dict(),
            "lost_lock": self.lost_lock.to_dict(),
            "ways_to_trip": [
                {
                    "cause": way.cause,
                    "channel": way.channel,
                    "levels": [{"level": level, "count": count} for level, count in way.levels.items()],
                    **way.share.to_dict(),
                }
                for way in self.ways_to_trip
            ],
            "points": [
                {
                    "number": point.number,
                    "level": point.level,
                    "accepted": point.accepted.to_dict(),
                    "qualities": point.qualities,
                    "reasons": point.reasons,
                    "bands": {name: band.to_dict() for name, band in point.bands.items()},
                }
                for point in self.points
            ],
            "duration_s": self.duration_s.to_dict(),
            "margins": {name: band.to_dict() for name, band in self.margins.items()},
            "frequency_error": self.frequency_error.to_dict(),
            "damping_error": self.damping_error.to_dict(),
            "influences": [vars(one) for one in self.influences],
        }


def verdict_of(rehearsal: Rehearsal) -> Verdict:
    """Evaluate the draws of a rehearsal."""
    draws = [draw for draw in rehearsal.draws if draw.trial.computed]
    missing = [draw.trial.text for draw in rehearsal.draws if not draw.trial.computed]
    n = len(draws)
    errors = [_errors(draw) for draw in draws]
    return Verdict(
        not_computed=Share(len(missing), len(rehearsal.draws)),
        why_not_computed=dict(Counter(map(without_numbers, missing)).most_common()),
        ends_well=Share(sum(d.trial.completed for d in draws), n),
        trips=Share(sum(d.trial.tripped for d in draws), n),
        lost_lock=Share(sum(d.trial.lost_lock for d in draws), n),
        ways_to_trip=_ways(draws),
        points=_points(draws),
        duration_s=Band.of([d.trial.duration_s for d in draws]),
        margins=_margins(draws),
        frequency_error=Band.of([e for found in errors for e in found[0]]),
        damping_error=Band.of([e for found in errors for e in found[1]]),
        influences=_influences(draws),
    )


def _errors(draw: Draw) -> tuple[list[float], list[float]]:
    """Sizes of the relative errors of frequency and damping of a draw's points."""
    by_number = {point.number: point for point in draw.trial.points}
    truth = draw.truth
    frequency, damping = [], []
    for number, hertz, ratio in zip(truth.numbers, truth.frequency_hz, truth.damping_ratio, strict=True):
        frequency.append(abs(by_number[number].modal_frequency_hz / hertz - 1.0))
        damping.append(abs(by_number[number].damping_ratio / ratio - 1.0))
    return frequency, damping


def _ways(draws: Sequence[Draw]) -> tuple[TripVerdict, ...]:
    found: dict[tuple[str, str], list[float]] = {}
    for draw in draws:
        if draw.trial.tripped:
            found.setdefault((draw.trial.end, draw.trial.channel), []).append(draw.trial.level)
    ways = [
        TripVerdict(cause, channel, dict(sorted(Counter(levels).items())), Share(len(levels), len(draws)))
        for (cause, channel), levels in found.items()
    ]
    return tuple(sorted(ways, key=lambda way: -way.share.count))


def _points(draws: Sequence[Draw]) -> tuple[PointVerdict, ...]:
    levels: dict[int, float] = {}
    for draw in draws:
        levels |= {point.number: point.level for point in draw.trial.points}
    return tuple(_point(number, levels[number], draws) for number in sorted(levels))


def _point(number: int, level: float, draws: Sequence[Draw]) -> PointVerdict:
    found = [point for draw in draws for point in draw.trial.points if point.number == number]
    accepted = [point for point in found if point.accepted]
    qualities = Counter(point.quality for point in found)
    if len(found) < len(draws):
        qualities["not begun"] = len(draws) - len(found)
    reasons = Counter(without_numbers(point.reason) for point in found if point.reason)
    names = ("frequency_hz", "force_n", "amplitude_m", "voltage_v", "damping_ratio")
    return PointVerdict(
        number,
        level,
        Share(len(accepted), len(draws)),
        dict(qualities.most_common()),
        dict(reasons.most_common()),
        {name: Band.of([getattr(point, name) for point in accepted]) for name in names},
    )


def without_numbers(text: str) -> str:
    """Return a reason with every number replaced by an ellipsis, so that equal reasons count together."""
    return re.sub(r"(?<![A-Za-z_])[-+]?\d[\d.]*(?:e[-+]?\d+)?", "…", text)


def _margins(draws: Sequence[Draw]) -> dict[str, Band]:
    names = {name for draw in draws for name in draw.trial.shares}
    bands = {name: Band.of([d.trial.shares[name] for d in draws if name in d.trial.shares]) for name in names}
    return dict(sorted(bands.items(), key=lambda entry: (-entry[1].high, entry[0])))


OUTCOMES: dict[str, Callable[[Draw], float]] = {
    "ends well": lambda draw: float(draw.trial.completed),
    "trip": lambda draw: float(draw.trial.tripped),
    "lost lock": lambda draw: float(draw.trial.lost_lock),
    "test time": lambda draw: draw.trial.duration_s,
    "closest limit": lambda draw: max(draw.trial.shares.values(), default=float("nan")),
    "damping error": lambda draw: float(np.mean(_errors(draw)[1])) if draw.truth.numbers else float("nan"),
}
"""What an influence may be on."""


def _influences(draws: Sequence[Draw]) -> tuple[Influence, ...]:
    """Return the rank correlations that are not chance, with the bound shared by all that are tested (Bonferroni)."""
    names = sorted({name for draw in draws for name in draw.unknowns})
    tested = max(1, len(names) * len(OUTCOMES))
    out = []
    for outcome, value in OUTCOMES.items():
        values = np.array([value(draw) for draw in draws])
        for name in names:
            drawn = np.array([draw.unknowns.get(name, np.nan) for draw in draws])
            for of, x in _views(name, drawn):
                kept = np.isfinite(values) & np.isfinite(x)
                if kept.sum() < FEW or np.ptp(values[kept]) == 0.0 or np.ptp(x[kept]) == 0.0:
                    continue
                found = scipy.stats.spearmanr(x[kept], values[kept])
                if found.pvalue < SIGNIFICANT / tested:
                    out.append(
                        Influence(outcome, of, float(found.statistic), float(found.pvalue), ADVICE.get(name, ""))
                    )
    return tuple(sorted(out, key=lambda one: -abs(one.correlation)))


def _views(name: str, drawn: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return the forms of an unknown that may matter: a shift by its value and by its size."""
    return [(name, drawn), (f"size of {name}", np.abs(drawn))] if name == "shift" else [(name, drawn)]
