"""Summary of a rehearsal: its content as JSON and as lines for the terminal."""

import math

from pydantic import JsonValue

from rig.rehearsal.rehearsal import Effect, Rehearsal
from rig.rehearsal.sequential import GOOD
from rig.rehearsal.verdict import Proportion, Statistic, Verdict, verdict_of
from rig.text.levels import in_shown_unit, level_text

MAX_LIMITS, MAX_REASONS, MAX_INFLUENCES = 5, 3, 6
"""Limits, reasons of one refusal, and influences that are printed; chosen: the page fits on a screen."""
RELIABLE_MISSING = 0.05  # proportion of twins that could not be computed above which the verdict is unreliable; chosen
LEVEL_UNITS = {"levels_v": "V", "levels_n": "N", "levels_rms_n": "N RMS", "levels_m": "m"}
"""Unit of a plan's levels, by the key that gives them."""


class Summary(Statistic):
    """What was rehearsed, on what knowledge, and the verdict: the content of ``rig show --json``."""

    specimen: str
    bench: str
    plan: str
    plan_kind: str
    level_unit: str
    draws: int
    at_most: int | None = None
    exact: bool
    sources: tuple[str, ...]
    determined: float | None
    hypotheses: dict[str, JsonValue] | None
    seed: int
    software_version: str
    finished: str
    digest: str
    tests: str
    verdict: Verdict
    tried: tuple[Effect, ...]
    notes: tuple[str, ...] = ()


def summary(rehearsal: Rehearsal) -> Summary:
    """Return what was rehearsed, on what knowledge, and the verdict."""
    facts = rehearsal.facts
    return Summary(
        specimen=facts.specimen,
        bench=facts.bench_name,
        plan=facts.plan_text,
        plan_kind=facts.plan_kind,
        level_unit=next((unit for key, unit in LEVEL_UNITS.items() if facts.plan.get(key) is not None), "V"),
        draws=len(rehearsal.draws),
        at_most=rehearsal.at_most,
        exact=facts.hypotheses is None,
        sources=facts.sources,
        determined=facts.determined,
        hypotheses=facts.hypotheses,
        seed=facts.seed,
        software_version=facts.software_version,
        finished=rehearsal.finished,
        digest=rehearsal.digest,
        tests=facts.tests,
        verdict=verdict_of(rehearsal),
        tried=rehearsal.tried,
    )


def verdict_in_one_line(found: Summary) -> str:
    """Return how probably the plan ends well and trips, on how many twins, and what to do if that is not enough."""
    well, trips = found.verdict.ends_well, found.verdict.trips
    out = (
        f"on {_number(found)} twins of what was measured, by the default hypotheses, it ends well in {_proportion(well)} and "
        f"trips in {_proportion(trips)}"
    )
    if missing := not_computed_in_one_line(found.verdict):
        out += f"; {missing}"
    if well.value < GOOD or trips.count:
        out += "; rig rehearse --improve tries what would help"
    return out


def _number(found: Summary) -> str:
    early = found.at_most is not None and found.draws < found.at_most
    return f"{found.draws} of at most {found.at_most}" if early else str(found.draws)


def not_computed_in_one_line(verdict: Verdict) -> str:
    """Return how many twins could not be computed, why, and what that means for the verdict; empty for none."""
    missing = verdict.not_computed
    if not missing.count:
        return ""
    why = "; ".join(f"{count} x {text}" for text, count in list(verdict.why_not_computed.items())[:MAX_REASONS])
    out = f"{missing.count} of {missing.of} twins could not be computed ({why}); all shares are of the others"
    if missing.value > RELIABLE_MISSING:
        out += "; these are too many to rely on the verdict: give more measurements of the rig (--from) or narrower hypotheses"
    return out


def lines(found: Summary) -> list[str]:
    """Return lines of text for a `summary`."""
    verdict = found.verdict
    twins = "seeds of the virtual bench itself" if found.exact else "twins"
    out = [
        f"{found.specimen} (bench {found.bench}): {found.plan}, rehearsed on {_number(found)} {twins}",
        *(f"known from      {source}" for source in found.sources),
        *(f"not computed    {text}" for text in (not_computed_in_one_line(verdict),) if text),
        f"ends well       {_proportion(verdict.ends_well)}",
        f"trips           {_proportion(verdict.trips)}",
    ]
    for way in verdict.ways_to_trip:
        levels = ", ".join(
            f"{one.count} at {in_shown_unit(one.level, found.level_unit)[0]:.4g}"
            for one in way.levels
            if not math.isnan(one.level)
        )
        on = f" on channel {way.channel}" if way.channel else ""
        at = f" ({levels} {in_shown_unit(0.0, found.level_unit)[1]})" if levels else ""
        out.append(f"                {way.cause.lower().replace('_', ' ')}{on}: {way.count} of {way.of}{at}")
    out.append(f"loses the lock  {_proportion(verdict.lost_lock)}")
    out += _point_lines(found)
    time = verdict.duration_s
    out.append(f"test time       {_time(time.middle)}, nine in ten {_time(time.low)} to {_time(time.high)}")
    for name, quantiles in list(verdict.margins.items())[:MAX_LIMITS]:
        most = f"95 % below {_percent(quantiles.high)}, most {_percent(quantiles.largest)}"
        out.append(f"of its limit    {name}: {_percent(quantiles.middle)}, {most}")
    frequency, damping = verdict.frequency_error, verdict.damping_error
    if frequency.n:
        text = f"accuracy        against harmonic balance ({frequency.n} points): frequency {_ppm(frequency.middle)}"
        text += f", 95 % below {_ppm(frequency.high)}"
        if damping.n:
            text += f"; damping {_percent(damping.middle)}, 95 % below {_percent(damping.high)}"
        out.append(text)
    for one in verdict.influences[:MAX_INFLUENCES]:
        advice = f"; {one.advice}" if one.advice else ""
        out.append(f"matters         {one.unknown} for {one.outcome} (rank correlation {one.correlation:+.2f}){advice}")
    for tried in found.tried:
        (well, then), (trips, later) = tried.ends_well, tried.trips
        out.append(
            f"{'taken' if tried.taken else 'tried'}           {tried.name}: ends well {_percent(well)} -> {_percent(then)}, "
            f"trips {_percent(trips)} -> {_percent(later)} ({tried.draws} twins)"
        )
    out.append(f"digest          {found.digest}, plan and bench {found.tests}, {found.finished}")
    return out


def _point_lines(found: Summary) -> list[str]:
    points = found.verdict.points
    if not points:
        return []
    refused = [point for point in points if point.accepted.count < point.accepted.of]
    if not refused:
        return [f"points          all {len(points)} accepted in every draw"]
    out = [f"points          {len(points) - len(refused)} of {len(points)} accepted in every draw"]
    for point in refused:
        reasons = [f"{count} x {text}" for text, count in list(point.reasons.items())[:MAX_REASONS]]
        if missing := point.qualities.get("not begun"):
            reasons.append(f"{missing} x the run had ended before")
        head = f"point {point.number + 1} at {level_text(point.level, found.level_unit)}"
        out.append(f"                {head}: {_percent(point.accepted.value)} accepted; {'; '.join(reasons)}")
    return out


def _proportion(found: Proportion) -> str:
    interval = f"{_percent(found.interval[0])} to {_percent(found.interval[1])}"
    return f"{_percent(found.value)} ({interval}; {found.count} of {found.of})"


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{100.0 * value:.3g} %"


def _ppm(value: float) -> str:
    return f"{1e6 * value:.2g} ppm"


def _time(seconds: float) -> str:
    return "-" if math.isnan(seconds) else f"{seconds:.3g} s" if seconds < 120.0 else f"{seconds / 60.0:.3g} min"
