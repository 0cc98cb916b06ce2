"""Verdict of a rehearsal: probability of each end, margins, accuracy, and the unknowns that matter most."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import scipy
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

from rig.rehearsal.forecast import QUANTITIES
from rig.rehearsal.rehearsal import Draw, Rehearsal
from rig.rehearsal.sequential import interval, unbiased


class Statistic(BaseModel):
    """Base of all parts of a verdict; JSON has the names of its fields or their aliases."""

    model_config = ConfigDict(frozen=True, populate_by_name=True)


class Proportion(Statistic):
    """Probability estimated from a number of draws, with its 95 % interval (Wilson's score interval)."""

    count: int
    """Number of draws in which it happened."""
    of: int
    """Number of draws."""
    stopped: bool = False
    """Whether the draws ended by what they showed: the interval is then one that holds all the same
    (`rig.rehearsal.sequential`)."""
    without_bias: float | None = None
    """The estimate where draws that ended by what they showed bias the share of them."""

    @property
    def value(self) -> float:
        """The estimate; NaN without draws."""
        if self.without_bias is not None:
            return self.without_bias
        return self.count / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        if not self.of:
            return 0.0, 1.0
        if self.stopped:
            return interval(self.count, self.of)
        found = scipy.stats.binomtest(self.count, self.of).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)

    @model_serializer(mode="wrap")
    def _with_interval(self, fields: SerializerFunctionWrapHandler) -> dict[str, object]:
        low, high = self.interval
        return {**fields(self), "value": self.value, "low": low, "high": high}


class Quantiles(Statistic):
    """Quantiles of a quantity over the draws: 5 %, 50 % and 95 %, and the largest; NaN if no draw has one."""

    low: float = Field(float("nan"), alias="5 %")
    middle: float = Field(float("nan"), alias="50 %")
    high: float = Field(float("nan"), alias="95 %")
    largest: float = float("nan")
    n: int = 0

    @classmethod
    def of(cls, values: Iterable[float]) -> "Quantiles":
        """Return the quantiles of the finite values."""
        finite = np.array([v for v in values if np.isfinite(v)])
        if not finite.size:
            return cls()
        low, middle, high = np.quantile(finite, [0.05, 0.5, 0.95]).tolist()
        return cls(low=low, middle=middle, high=high, largest=float(finite.max()), n=finite.size)


SIGNIFICANCE = 0.01  # probability, over all tests together, that an influence is found by chance; chosen
MIN_DRAWS = 8  # least number of draws with a finite value for which an influence is tested; chosen
BACKBONE = "a backbone up to 80 % of the highest level would settle it: run that, and give its recording with --from"
ADVICE = {
    "frequency_hz": "measure the frequency again just before the test (`rig check`)",
    "damping_ratio": "measure the damping with finer lines (`rig tune`)",
    "drive_shape": "measure the mode shape at the drive point (`rig tune` or a modal test)",
    "moving_mass_kg": "identify the exciter over a wider band",
    "gain_factor": "check the amplifier's gain just before the test (`rig check`)",
    "shift": BACKBONE,
    "hardening_power": BACKBONE,
    "damping_growth": BACKBONE,
    "joint_shift": BACKBONE,
    "joint_slip": BACKBONE,
    "stop_gap": f"look for rattling parts; {BACKBONE}",
    "stop_stiffness": f"look for rattling parts; {BACKBONE}",
    "second_mode": "measure the neighbourhood of the mode with a finer multisine",
}
"""Measurement that narrows an unknown, by the unknown."""


class LevelCount(Statistic):
    """Number of draws that tripped at a level."""

    level: float
    count: int


class TripVerdict(Proportion):
    """One cause of a trip, and the proportion of draws that it ends."""

    cause: str
    """Name of the `rig.tick.safety.layout.EndReason`."""
    channel: str
    """Channel; empty for none."""
    levels: tuple[LevelCount, ...]
    """Number of draws by the level at which it happened, the lowest level first."""


class PointVerdict(Statistic):
    """One point of the plan over all draws."""

    number: int
    """Number in the plan, from 0."""
    level: float
    """Its level."""
    accepted: Proportion
    """Share of the draws in which it is accepted."""
    qualities: dict[str, int]
    """Number of draws by the quality of the point; ``not begun`` where the run ended before."""
    reasons: dict[str, int]
    """Why it is refused, without numbers, and how often; the most frequent first."""
    quantiles: dict[str, Quantiles] = Field(alias="bands")
    """Quantiles of ``frequency_hz``, ``force_n``, ``amplitude_m``, ``voltage_v`` and ``damping_ratio`` where it is accepted."""


class Influence(Statistic):
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


class Verdict(Statistic):
    """The verdict on the twins that could be computed; all proportions are of these."""

    not_computed: Proportion
    """Proportion of all draws whose twin could not be built or simulated."""
    why_not_computed: dict[str, int]
    """Why not, without numbers, and how often; the most frequent first."""
    ends_well: Proportion
    """Every point accepted."""
    trips: Proportion
    """The run trips, or the bench refuses the plan."""
    lost_lock: Proportion
    """The lock is lost, or never gained, at a point at least."""
    ways_to_trip: tuple[TripVerdict, ...]
    """Causes, the most frequent first."""
    points: tuple[PointVerdict, ...]
    """Points by number."""
    duration_s: Quantiles
    """Time on the rig."""
    margins: dict[str, Quantiles]
    """Largest value over its limit, by limit, the closest first."""
    frequency_error: Quantiles
    """Size of the relative error of the modal frequency against harmonic balance."""
    damping_error: Quantiles
    """Size of the relative error of the damping ratio as reported."""
    influences: tuple[Influence, ...]
    """What matters most, the strongest first."""

    @property
    def trips_at_most(self) -> float:
        """Upper end of the 95 % interval of a trip's probability, if each twin that could not be computed trips."""
        missing = self.not_computed.count
        trips = self.trips
        return Proportion(count=trips.count + missing, of=trips.of + missing, stopped=trips.stopped).interval[1]


def verdict_of(rehearsal: Rehearsal) -> Verdict:
    """Evaluate the draws of a rehearsal."""
    draws = [draw for draw in rehearsal.draws if draw.trial.computed]
    missing = [draw.trial.text for draw in rehearsal.draws if not draw.trial.computed]
    n = len(draws)
    errors = [_errors(draw) for draw in draws]
    stopped = rehearsal.at_most is not None
    well, tripped, lost = (
        sum(getattr(draw.trial, name) for draw in draws) for name in ("completed", "tripped", "lost_lock")
    )
    estimates: tuple[float | None, float | None] = (None, None)
    if stopped and n:
        estimate = unbiased(well, n)
        estimates = estimate, (1.0 - estimate) * tripped / (n - well) if tripped else 0.0
    levels = {point.number: point.level for draw in draws for point in draw.trial.points}
    limits = {name for draw in draws for name in draw.trial.shares}
    margins = {name: Quantiles.of(d.trial.shares[name] for d in draws if name in d.trial.shares) for name in limits}
    return Verdict(
        not_computed=Proportion(count=len(missing), of=len(rehearsal.draws)),
        why_not_computed=dict(Counter(map(without_numbers, missing)).most_common()),
        ends_well=Proportion(count=well, of=n, stopped=stopped, without_bias=estimates[0]),
        trips=Proportion(count=tripped, of=n, stopped=stopped, without_bias=estimates[1]),
        lost_lock=Proportion(count=lost, of=n, stopped=stopped),
        ways_to_trip=_ways(draws),
        points=tuple(_point(number, levels[number], draws) for number in sorted(levels)),
        duration_s=Quantiles.of(d.trial.duration_s for d in draws),
        margins=dict(sorted(margins.items(), key=lambda entry: (-entry[1].high, entry[0]))),
        frequency_error=Quantiles.of(e for found in errors for e in found[0]),
        damping_error=Quantiles.of(e for found in errors for e in found[1]),
        influences=_influences(draws),
    )


def _errors(draw: Draw) -> tuple[list[float], list[float]]:
    """Sizes of the relative errors of frequency and damping of a draw's points."""
    truth, by_number = draw.truth, {point.number: point for point in draw.trial.points}
    points = [by_number[number] for number in truth.numbers]
    return (
        [abs(point.modal_frequency_hz / hertz - 1.0) for point, hertz in zip(points, truth.frequency_hz, strict=True)],
        [abs(point.damping_ratio / ratio - 1.0) for point, ratio in zip(points, truth.damping_ratio, strict=True)],
    )


def _ways(draws: Sequence[Draw]) -> tuple[TripVerdict, ...]:
    found: dict[tuple[str, str], list[float]] = {}
    for draw in draws:
        if draw.trial.tripped:
            found.setdefault((draw.trial.end, draw.trial.channel), []).append(draw.trial.level)
    ways = [
        TripVerdict(
            cause=cause,
            channel=channel,
            levels=tuple(LevelCount(level=level, count=n) for level, n in sorted(Counter(levels).items())),
            count=len(levels),
            of=len(draws),
        )
        for (cause, channel), levels in found.items()
    ]
    return tuple(sorted(ways, key=lambda way: -way.count))


def _point(number: int, level: float, draws: Sequence[Draw]) -> PointVerdict:
    found = [point for draw in draws for point in draw.trial.points if point.number == number]
    accepted = [point for point in found if point.accepted]
    qualities = Counter(point.quality for point in found)
    if len(found) < len(draws):
        qualities["not begun"] = len(draws) - len(found)
    reasons = Counter(without_numbers(point.reason) for point in found if point.reason)
    return PointVerdict(
        number=number,
        level=level,
        accepted=Proportion(count=len(accepted), of=len(draws)),
        qualities=dict(qualities.most_common()),
        reasons=dict(reasons.most_common()),
        quantiles={name: Quantiles.of(getattr(point, name) for point in accepted) for name in QUANTITIES},
    )


def without_numbers(text: str) -> str:
    """Return a reason with every number replaced by an ellipsis, so that equal reasons count together."""
    return re.sub(r"(?<![A-Za-z_])[-+]?\d[\d.]*(?:e[-+]?\d+)?", "…", text)


OUTCOMES: dict[str, Callable[[Draw], float]] = {
    "ends well": lambda draw: float(draw.trial.completed),
    "trip": lambda draw: float(draw.trial.tripped),
    "lost lock": lambda draw: float(draw.trial.lost_lock),
    "test time": lambda draw: draw.trial.duration_s,
    "closest limit": lambda draw: max(draw.trial.shares.values(), default=float("nan")),
    "damping error": lambda draw: float(np.mean(_errors(draw)[1])) if draw.truth.numbers else float("nan"),
}
"""Outcomes whose dependence on the unknowns is tested."""


def _influences(draws: Sequence[Draw]) -> tuple[Influence, ...]:
    """Return the rank correlations that are not chance, with the bound shared by all that are tested (Bonferroni)."""
    names = sorted({name for draw in draws for name in draw.unknowns})
    tested = max(1, len(names) * len(OUTCOMES))
    out = []
    for outcome, value in OUTCOMES.items():
        values = np.array([value(draw) for draw in draws])
        for name in names:
            drawn = np.array([draw.unknowns.get(name, np.nan) for draw in draws])
            tests = [(name, drawn), (f"size of {name}", np.abs(drawn))] if name == "shift" else [(name, drawn)]
            for of, x in tests:
                kept = np.isfinite(values) & np.isfinite(x)
                if kept.sum() < MIN_DRAWS or np.ptp(values[kept]) == 0.0 or np.ptp(x[kept]) == 0.0:
                    continue
                found = scipy.stats.spearmanr(x[kept], values[kept])
                correlation, p_value = float(found.statistic), float(found.pvalue)
                if p_value < SIGNIFICANCE / tested:
                    advice = ADVICE.get(name, "")
                    out.append(
                        Influence(outcome=outcome, unknown=of, correlation=correlation, p_value=p_value, advice=advice)
                    )
    return tuple(sorted(out, key=lambda one: -abs(one.correlation)))
