"""From the rows of ramps up and down to points at levels, and from these to continuous backbones in memory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from identification import (
    Backbone,
    Channel,
    ContinuousBackbone,
    IdentificationError,
    SlowFlow,
    continuous_backbone,
)
from rig.bench import Bench
from rig.campaigns.continuous_backbone.plan import ContinuousBackbonePlan
from rig.campaigns.continuous_backbone.ways import WAYS, Way, both_ways, rows_near
from rig.campaigns.evaluation.acceptance import alien_objection, first_of, std_objection
from rig.campaigns.evaluation.alien_force import alien_force
from rig.campaigns.evaluation.measured_together import Passage
from rig.campaigns.evaluation.plausibility import with_plausible_ways
from rig.campaigns.evaluation.recorded_flow import recorded_flow
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, of_a_vibration
from rig.campaigns.evaluation.vibrations import channels_from, head, not_evaluated, vibration_from
from rig.campaigns.planning.plan import Column, Target

__all__ = ["CONTINUOUS_BACKBONE_COLUMNS", "continuous_backbones_of", "measure_continuous_backbone"]

CONTINUOUS_BACKBONE_COLUMNS = (
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("modal_frequency_std_hz", "+-", "Hz", ".4f", 1.96),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("damping_ratio_std", "+-", "%", ".4f", 196.0),
    Column("amplitude_m", "amplitude", "mm", ".4f", 1e3, plain=True),
    Column("phase_error_deg", "phase error", "deg", ".1f"),
    *PURITY_COLUMNS,
)


def measure_continuous_backbone(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    targets: Sequence[Target],
    rows: np.ndarray,
    passages: Sequence[Passage],
    ended: str,
) -> list[dict[str, Any]]:
    """The results at all levels of a way up and a way down; ``ended`` says why the output was brought down, if it was.

    A level that was passed on one way only is shown with what was found there, marked as not accepted; one that was not
    passed at all has failed.
    """
    try:
        flow = recorded_flow(bench, rows, plan.harmonics, plan.plant)
        ways = both_ways(bench, plan, rows, passages, flow, ended)
        points = _measured(bench, plan, targets, flow, ways, rows)
    except (IdentificationError, ArithmeticError) as error:
        return [{**not_evaluated(plan, target, error, settled=False), "direction": "both"} for target in targets]
    return [points[target.number] for target in targets]


def _measured(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    targets: Sequence[Target],
    flow: SlowFlow,
    ways: Mapping[str, Way],
    rows: np.ndarray,
) -> dict[int, dict[str, Any]]:
    """Points by number: from both ways, from one, or failed."""
    groups: dict[tuple[str, ...], list[Target]] = {}
    for target in targets:
        covered = tuple(name for name in WAYS if ways[name].covers(target.level))
        groups.setdefault(covered, []).append(target)
    out: dict[int, dict[str, Any]] = {}
    for covered, some in groups.items():
        missing = _together({name: ways[name].why for name in WAYS if name not in covered})
        if not covered:
            out |= {target.number: _failed(plan, target, f"not passed: {missing}") for target in some}
            continue
        flows = [way.flow for way in map(ways.__getitem__, covered) if way.flow is not None]
        found = continuous_backbone(
            flows[0],
            flows[-1],
            levels_m=[t.level for t in some],
            bandwidth=plan.bandwidth,
            specimen=bench.specimen.name,
        )
        for index, target in enumerate(some):
            near = [rows_near(bench, rows, ways[name], target.level) for name in covered]
            out[target.number] = _point(bench, plan, target, found, index, covered, flow, near, missing)
    return out


def _together(reasons: Mapping[str, str]) -> str:
    """Reasons by way, in one line; one that both share is said once."""
    if len(reasons) == 2 and len(set(reasons.values())) == 1:
        return next(iter(reasons.values()))
    return "; ".join(f"way {name}: {why}" for name, why in reasons.items())


def _failed(plan: ContinuousBackbonePlan, target: Target, reason: str) -> dict[str, Any]:
    return {**head(plan, target), "direction": "both", "settled": False, "accepted": False, "reason": reason}


def _point(
    bench: Bench,
    plan: ContinuousBackbonePlan,
    target: Target,
    found: ContinuousBackbone,
    index: int,
    covered: Sequence[str],
    flow: SlowFlow,
    pieces: Sequence[np.ndarray],
    missing: str,
) -> dict[str, Any]:
    """One level: the mean of both ways, what each gave, and how well it is known."""
    mode = found.nonlinear_mode()
    vibration = found.backbone.points[index]
    frequency, damping = float(mode.modal_frequency_hz[index]), float(mode.damping_ratio[index])
    # One way alone stands in both places: its noise does not average out.
    alone = math.sqrt(2.0) if len(covered) == 1 else 1.0
    std = {"modal_frequency_hz": alone * float(mode.modal_frequency_std_hz[index])}
    std["damping_ratio"] = alone * float(mode.damping_ratio_std[index])
    stds = (std["modal_frequency_hz"] / frequency, std["damping_ratio"] / abs(damping))
    alien = alien_force(bench, pieces)
    reason = first_of(
        (
            f"passed on the way {covered[0]} only ({missing})" if missing else "",
            std_objection(stds[0], plan.accepted_frequency_std, stds[1], plan.accepted_damping_std),
            alien_objection(alien, plan.accepted_alien_force),
        )
    )
    near = np.abs(np.log(flow.amplitude_m / target.level)) < plan.bandwidth
    # The lag itself swings while the level is ramped; this is the one that a settled vibration so far off would have.
    lags = np.degrees(np.arctan((flow.frequency_hz[near] / frequency - 1.0) / abs(damping)))
    point = {
        **head(plan, target),
        "direction": "both" if len(covered) == 2 else covered[0],
        "settled": None,
        "accepted": not reason,
        "reason": reason,
        "force_n": vibration.force_n,
        "frequency_hz": vibration.frequency_hz,
        "modal_frequency_hz": frequency,
        "modal_frequency_std_hz": std["modal_frequency_hz"],
        "damping_ratio": damping,
        "damping_ratio_std": std["damping_ratio"],
        "amplitude_m": vibration.amplitude_m,
        "phase_error_deg": float(lags[np.argmax(np.abs(lags))]) if lags.size else None,
        **{name: _one_way(found, WAYS.index(name) if len(covered) == 2 else 0, index) for name in covered},
        "alien_force": alien,
        "periods_of_both_ways": found.periods,
        **of_a_vibration(bench, vibration, np.concatenate(pieces), held=False),
    }
    return with_plausible_ways(bench, point, pieces)


def _one_way(found: ContinuousBackbone, way: int, index: int) -> dict[str, float]:
    """What one way gave at a level."""
    return {
        "modal_frequency_hz": float(found.modal_frequency_hz[way, index]),
        "damping_ratio": float(found.damping_ratio[way, index]),
        "stiffness": float(found.stiffness[way, index]),
        "damping_1_s": float(found.damping_1_s[way, index]),
        "stiffness_std": float(found.stiffness_std[way, index]),
        "damping_std_1_s": float(found.damping_std_1_s[way, index]),
    }


def continuous_backbones_of(
    points: Iterable[Mapping[str, Any]],
    channels: Sequence[Mapping[str, Any]],
    specimen: str,
    drive_mode_shape: float | None,
) -> tuple[ContinuousBackbone, ...]:
    """The accepted points of a recording, one continuous backbone per repeat; raises `IdentificationError` without any."""
    kinds = channels_from(channels)
    repeats: dict[int, list[Mapping[str, Any]]] = {}
    for point in points:
        if point["accepted"]:
            repeats.setdefault(point["repeat"], []).append(point)
    if not repeats:
        raise IdentificationError("points: none of the recording was accepted")
    return tuple(_from_points(accepted, kinds, specimen, drive_mode_shape) for accepted in repeats.values())


def _from_points(
    points: Sequence[Mapping[str, Any]], channels: tuple[Channel, ...], specimen: str, drive_mode_shape: float | None
) -> ContinuousBackbone:
    def both(name: str) -> np.ndarray:
        return np.array([[point[way][name] for point in points] for way in WAYS])

    vibrations = tuple(vibration_from(point, channels) for point in points)
    return ContinuousBackbone(
        backbone=Backbone(vibrations, specimen, drive_mode_shape),
        amplitude_m=np.array([point["amplitude_m"] for point in points]),
        stiffness=both("stiffness"),
        damping_1_s=both("damping_1_s"),
        stiffness_std=both("stiffness_std"),
        damping_std_1_s=both("damping_std_1_s"),
        periods=points[0]["periods_of_both_ways"],
    )
