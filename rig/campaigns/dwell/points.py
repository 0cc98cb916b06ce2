"""From the rows of a mean to its result, and from the means so far to changes, alarms and the end of a dwell."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification import Backbone, IdentificationError, nonlinear_mode
from rig.bench import Bench
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.evaluation.acceptance import level_error, level_objection, settled_objection, settled_quality
from rig.campaigns.evaluation.lost_samples import bridged
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, of_a_vibration
from rig.campaigns.evaluation.vibrations import head, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.plan import Column, Target

__all__ = ["DWELL_COLUMNS", "measure_mean", "watch_drift"]

DWELL_COLUMNS = (
    Column("cycles", "cycles", "", ".0f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("frequency_change", "frequency change", "%", "+.3f", 100.0),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    *PURITY_COLUMNS,
)

WATCHED = {"frequency": "frequency_change", "damping": "damping_change", "amplitude": "amplitude_change"}
"""Key of the change that each limit of a plan is about."""


def measure_mean(bench: Bench, plan: DwellPlan, target: Target, rows: np.ndarray, settling: np.void) -> dict[str, Any]:
    """Frequency, damping and amplitude of one mean, with its own quality; its whole periods are evaluated."""
    turned = np.unwrap(rows["theta_rad"].astype(float))
    cycles = float(turned[-1] - turned[0]) / (2.0 * math.pi) * rows.size / max(1, rows.size - 1)
    length = {"cycles_in_mean": cycles, "seconds_in_mean": rows.size / bench.sample_rate_hz}
    rows = rows[within_periods(rows["theta_rad"], int(cycles))]
    try:
        lag_deg = plan.controller.phase_lag_deg + 180.0
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=lag_deg)
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return {**not_evaluated(plan, target, error, settled=True), **length}
    force_rms_n = float(bridged(rows)[:-1, bench.index_of("force")].std())
    missed = level_error(plan.amplitude_law, target.level, vibration, force_rms_n)
    found = settled_quality(vibration, bench, rows)
    off_level = level_objection(plan.amplitude_law, missed, plan.accepted_level_error)
    reason = settled_objection(plan, bench, vibration, found, off_level)
    damping = float(mode.damping_ratio[0])
    return {
        **head(plan, target),
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "modal_frequency_hz": float(mode.modal_frequency_hz[0]),
        "damping_ratio": damping if math.isfinite(damping) else None,
        "amplitude_m": vibration.amplitude_m,
        "force_n": vibration.force_n,
        "force_rms_n": force_rms_n,
        "level_error": missed,
        **length,
        **found,
        **of_a_vibration(bench, vibration, rows),
    }


def watch_drift(
    plan: DwellPlan, known: Sequence[Mapping[str, Any]], point: dict[str, Any]
) -> tuple[dict[str, Any], str]:
    """The point with cycles and time at its middle and its changes from the first accepted mean; and why the test ends, if so.

    Cycles and seconds count from the first mean, over all parts of a recording; those of a mean that failed count too, but the
    ramp and the settling at the beginning of a part do not.
    """
    cycles = sum(float(one.get("cycles_in_mean", one.get("settle_periods", 0.0))) for one in known)
    seconds = sum(_seconds(one) for one in known)
    point = {
        **point,
        "cycles": cycles + 0.5 * float(point.get("cycles_in_mean", 0.0)),
        "time_s": seconds + 0.5 * _seconds(point),
    }
    if not point["accepted"]:
        return point, ""
    first = next((one for one in known if one["accepted"]), point)
    amplitude = "force_n" if plan.level_unit == "m" else "amplitude_m"  # what is held does not change
    keys = {"frequency": "modal_frequency_hz", "damping": "damping_ratio", "amplitude": amplitude}
    changes = {name: _change(first.get(key), point.get(key)) for name, key in keys.items()}
    point |= {WATCHED[name]: change for name, change in changes.items()}
    alarms = _beyond(plan, "alarm", changes)
    if alarms:
        point["warnings"] = [*point.get("warnings", []), *(f"alarm: {text}" for text in alarms)]
    aborts = _beyond(plan, "abort", changes)
    return point, f"{aborts[0]}, after {point['cycles']:.0f} cycles" if aborts else ""


def _seconds(point: Mapping[str, Any]) -> float:
    if "seconds_in_mean" in point:
        return float(point["seconds_in_mean"])
    return 0.0


def _change(first: float | None, now: float | None) -> float | None:
    return None if not first or now is None else now / first - 1.0


def _beyond(plan: DwellPlan, name: str, changes: Mapping[str, float | None]) -> list[str]:
    """A sentence for each change beyond its limit."""
    limits = getattr(plan, name)
    held = plan.level_unit == "m"
    out = []
    for quantity, change in changes.items():
        limit = getattr(limits, quantity)
        if limit is not None and change is not None and abs(change) > limit:
            said = "force" if quantity == "amplitude" and held else quantity
            out.append(
                f"the {said} has changed by {100.0 * change:+.3g} % since the first mean, "
                f"{name}.{quantity} is {100.0 * limit:g} %"
            )
    return out
