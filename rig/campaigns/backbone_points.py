"""From the recorded rows of a backbone's point to its result, and from the results to a backbone in memory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from identification import Backbone, Channel, IdentificationError, PeriodicVibration, nonlinear_mode
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.evaluate import (
    as_complex,
    as_pairs,
    drift_objection,
    head,
    quantisation_warnings,
    recorded_vibration,
    within_periods,
)
from rig.campaigns.plan import Column, Target

__all__ = ["BACKBONE_COLUMNS", "backbone_of", "frequency_scatter", "measure_backbone_point"]

BACKBONE_COLUMNS = (
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("amplitude_m", "amplitude", "mm", ".4f", 1e3, plain=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
)


def measure_backbone_point(
    bench: Bench, plan: BackbonePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment.

    A point whose recorded fundamental is too far from the wanted phase is kept, marked as not accepted.
    """
    point = head(plan, target)
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(
            bench, rows, plan.harmonics, phase_lag_target_deg=plan.controller.phase_lag_deg + 180.0
        )
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": True, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    error_deg = vibration.phase_error_deg
    hunting = frequency_scatter(rows["theta_rad"])
    reason = _objection(plan, bench, vibration, hunting)
    damping = float(mode.damping_ratio[0])
    scatter = rows["phase_error_rad"][np.isfinite(rows["phase_error_rad"])].astype(float)
    return {
        **point,
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "force_n": vibration.force_n,
        "frequency_hz": vibration.frequency_hz,
        "modal_frequency_hz": float(mode.modal_frequency_hz[0]),
        "damping_ratio": damping if math.isfinite(damping) else None,
        "amplitude_m": vibration.amplitude_m,
        "phase_error_deg": error_deg,
        "frequency_scatter": hunting,
        "phase_scatter_deg": math.degrees(float(scatter.std())),
        "voltage_v": float(np.abs(rows["command_v"]).mean()),
        "force_purity": float(mode.force_purity[0]),
        "response_purity": float(mode.response_purity[0]),
        "periods": vibration.periods,
        "settle_periods": float(settling["periods"]),
        "amplitude_drift": float(settling["drift"]),
        "harmonics": as_pairs(vibration.harmonics),
        "harmonics_std": None if vibration.harmonics_std is None else vibration.harmonics_std.tolist(),
        "residual_rms": vibration.residual_rms.tolist(),
        "drift": None if vibration.drift is None else as_pairs(vibration.drift),
        "warnings": [*vibration.warnings, *quantisation_warnings(vibration, bench)],
    }


def _objection(plan: BackbonePlan, bench: Bench, vibration: PeriodicVibration, hunting: float) -> str:
    """Why a recorded point is not accepted; empty where it is."""
    error_deg = vibration.phase_error_deg
    if abs(error_deg) > plan.accepted_phase_error_deg:
        return f"phase error {error_deg:.2f} deg, accepted up to {plan.accepted_phase_error_deg:g} deg"
    if hunting > plan.accepted_frequency_scatter:
        return (
            f"the loop hunts: the frequency scatters by {100.0 * hunting:.2f} % from period to period, "
            f"accepted up to {100.0 * plan.accepted_frequency_scatter:g} %"
        )
    return drift_objection(bench, vibration, plan.accepted_drift)


def frequency_scatter(theta_rad: np.ndarray) -> float:
    """Standard deviation of the frequency of single periods, relative to its mean."""
    turned = np.unwrap(theta_rad.astype(float))
    turns = (turned - turned[0]) / (2.0 * math.pi)
    ends = np.interp(np.arange(int(turns[-1]) + 1), turns, np.arange(turns.size))
    lengths = np.diff(ends)
    return float(lengths.std() / lengths.mean()) if lengths.size > 1 else 0.0


def backbone_of(
    points: Iterable[Mapping[str, Any]],
    channels: Sequence[Mapping[str, Any]],
    specimen: str,
    drive_mode_shape: float | None,
    phase_lag_target_deg: float,
) -> Backbone:
    """The accepted points of a recording as measurements; raises `IdentificationError` where there is none."""
    accepted = [point for point in points if point["accepted"]]
    if not accepted:
        raise IdentificationError("points: none of the recording was accepted")
    kinds = tuple(Channel(c["name"], c["role"], c["unit"]) for c in channels)
    vibrations = tuple(
        PeriodicVibration(
            kinds,
            point["frequency_hz"],
            as_complex(point["harmonics"]),
            point["periods"],
            np.asarray(point["residual_rms"], float),
            None if point["harmonics_std"] is None else np.asarray(point["harmonics_std"], float),
            None if point["drift"] is None else as_complex(point["drift"]),
            phase_lag_target_deg=phase_lag_target_deg,
            warnings=tuple(point["warnings"]),
        )
        for point in accepted
    )
    return Backbone(
        vibrations,
        specimen,
        drive_mode_shape,
        tuple(point["direction"] for point in accepted),
        tuple(point["repeat"] for point in accepted),
    )
