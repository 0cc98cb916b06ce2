"""The page of a rehearsal: its verdict as one dictionary and as lines for the terminal."""

import math
from typing import Any

from rig.rehearsal.rehearsal import Rehearsal
from rig.rehearsal.verdict import verdict_of

CLOSE = 5  # limits that are shown
MOST_REASONS = 3
MOST_INFLUENCES = 6
FEW_MISSING = 0.05  # share of twins that could not be computed above which the verdict is not to be relied on
ENOUGH = 0.9  # share of twins on which a plan ends well without further advice


def summary(rehearsal: Rehearsal) -> dict[str, Any]:
    """Return what was rehearsed, on what knowledge, and the verdict, as a dictionary for JSON."""
    facts = rehearsal.facts
    return {
        "specimen": facts["bench"]["specimen"]["name"],
        "bench": facts["bench"]["name"],
        "plan": facts["plan"]["description"] or facts["plan"]["kind"],
        "plan_kind": facts["plan"]["kind"],
        "level_unit": _unit(facts["plan"]),
        "draws": len(rehearsal.draws),
        "exact": facts["hypotheses"] is None,
        "sources": list(facts["sources"]),
        "determined": facts["determined"],
        "hypotheses": facts["hypotheses"],
        "seed": facts["seed"],
        "software_version": facts["software_version"],
        "finished": rehearsal.finished,
        "digest": rehearsal.digest,
        "tests": rehearsal.tests,
        "verdict": verdict_of(rehearsal).to_dict(),
        "tried": [dict(one) for one in rehearsal.tried],
        "notes": [],
    }


def verdict_in_one_line(found: dict[str, Any]) -> str:
    """Return how probably the plan ends well and trips, on how many twins, and what to do if that is not enough."""
    verdict = found["verdict"]
    well, trips = verdict["ends_well"], verdict["trips"]
    out = (
        f"on {found['draws']} twins of what was measured, by the default hypotheses, it ends well in {_share(well)} and "
        f"trips in {_share(trips)}"
    )
    if missing := not_computed_in_one_line(verdict):
        out += f"; {missing}"
    if well["value"] < ENOUGH or trips["count"]:
        out += "; rig rehearse --improve tries what would help"
    return out


def not_computed_in_one_line(verdict: dict[str, Any]) -> str:
    """Return how many twins could not be computed, why, and what that means for the verdict; empty for none."""
    missing = verdict["not_computed"]
    if not missing["count"]:
        return ""
    why = "; ".join(f"{count} x {text}" for text, count in list(verdict["why_not_computed"].items())[:MOST_REASONS])
    out = f"{missing['count']} of {missing['of']} twins could not be computed ({why}), all shares are of the others"
    if missing["value"] > FEW_MISSING:
        out += "; these are too many to rely on the verdict: tell more of the rig (--from), or narrower hypotheses"
    return out


def _unit(plan: dict[str, Any]) -> str:
    units = {"levels_v": "V", "levels_n": "N", "levels_rms_n": "N RMS", "levels_m": "m"}
    return next((unit for key, unit in units.items() if plan.get(key) is not None), "V")


def lines(found: dict[str, Any]) -> list[str]:
    """Return lines of text for a `summary`."""
    verdict = found["verdict"]
    twins = "seeds of the virtual bench itself" if found["exact"] else "twins"
    out = [
        f"{found['specimen']} (bench {found['bench']}): {found['plan']}, rehearsed on {found['draws']} {twins}",
        *(f"known from      {source}" for source in found["sources"]),
        *(f"not computed    {text}" for text in (not_computed_in_one_line(verdict),) if text),
        f"ends well       {_share(verdict['ends_well'])}",
        f"trips           {_share(verdict['trips'])}",
    ]
    for way in verdict["ways_to_trip"]:
        levels = ", ".join(f"{one['count']} at {one['level']:.4g}" for one in way["levels"] if not _nan(one["level"]))
        on = f" on channel {way['channel']}" if way["channel"] else ""
        at = f" ({levels} {found['level_unit']})" if levels else ""
        out.append(f"                {_cause(way['cause'])}{on}: {way['count']} of {way['of']}{at}")
    out.append(f"loses the lock  {_share(verdict['lost_lock'])}")
    out += _point_lines(found)
    time = verdict["duration_s"]
    out.append(f"test time       {_time(time['50 %'])}, nine in ten {_time(time['5 %'])} to {_time(time['95 %'])}")
    for name, band in list(verdict["margins"].items())[:CLOSE]:
        most = f"95 % below {_percent(band['95 %'])}, most {_percent(band['largest'])}"
        out.append(f"of its limit    {name}: {_percent(band['50 %'])}, {most}")
    out += _accuracy(verdict)
    for one in verdict["influences"][:MOST_INFLUENCES]:
        advice = f"; {one['advice']}" if one["advice"] else ""
        out.append(
            f"matters         {one['unknown']} for {one['outcome']} (rank correlation {one['correlation']:+.2f}){advice}"
        )
    out += [_tried(one) for one in found["tried"]]
    out.append(f"digest          {found['digest']}, plan and bench {found['tests']}, {found['finished']}")
    return out


def _point_lines(found: dict[str, Any]) -> list[str]:
    points = found["verdict"]["points"]
    if not points:
        return []
    refused = [point for point in points if point["accepted"]["count"] < point["accepted"]["of"]]
    if not refused:
        return [f"points          all {len(points)} accepted in every draw"]
    out = [f"points          {len(points) - len(refused)} of {len(points)} accepted in every draw"]
    for point in refused:
        reasons = [f"{count} x {text}" for text, count in list(point["reasons"].items())[:MOST_REASONS]]
        if missing := point["qualities"].get("not begun"):
            reasons.append(f"{missing} x the run had ended before")
        head = f"point {point['number'] + 1} at {point['level']:.4g} {found['level_unit']}"
        out.append(f"                {head}: {_percent(point['accepted']['value'])} accepted; {'; '.join(reasons)}")
    return out


def _accuracy(verdict: dict[str, Any]) -> list[str]:
    frequency, damping = verdict["frequency_error"], verdict["damping_error"]
    if not frequency["n"]:
        return []
    text = f"accuracy        against harmonic balance ({frequency['n']} points): frequency {_ppm(frequency['50 %'])}"
    text += f", 95 % below {_ppm(frequency['95 %'])}"
    if damping["n"]:
        text += f"; damping {_percent(damping['50 %'])}, 95 % below {_percent(damping['95 %'])}"
    return [text]


def _tried(one: dict[str, Any]) -> str:
    (well, then), (trips, later) = one["ends_well"], one["trips"]
    taken = "taken          " if one["taken"] else "tried          "
    return (
        f"{taken} {one['name']}: ends well {_percent(well)} -> {_percent(then)}, trips {_percent(trips)} -> {_percent(later)} "
        f"({one['draws']} twins)"
    )


def _share(share: dict[str, Any]) -> str:
    interval = f"{_percent(share['low'])} to {_percent(share['high'])}"
    return f"{_percent(share['value'])} ({interval}; {share['count']} of {share['of']})"


def _percent(value: float) -> str:
    return "-" if _nan(value) else f"{100.0 * value:.3g} %"


def _ppm(value: float) -> str:
    return f"{1e6 * value:.2g} ppm"


def _time(seconds: float) -> str:
    return "-" if _nan(seconds) else f"{seconds:.3g} s" if seconds < 120.0 else f"{seconds / 60.0:.3g} min"


def _cause(name: str) -> str:
    return name.lower().replace("_", " ")


def _nan(value: float) -> bool:
    return value is None or math.isnan(value)
