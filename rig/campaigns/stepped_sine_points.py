"""From the recorded rows of a stepped-sine point to its result, and from the results to frequency responses in memory."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from identification import FrequencyResponse, IdentificationError
from rig.bench import Bench
from rig.campaigns.evaluate import (
    as_complex,
    as_pairs,
    drift_objection,
    head,
    recorded_vibration,
    within_periods,
)
from rig.campaigns.plan import Column, Target
from rig.campaigns.quality import PURITY_COLUMNS, purity, quality_warnings
from rig.campaigns.stepped_sine import SteppedSinePlan

__all__ = ["STEPPED_SINE_COLUMNS", "frequency_responses_of", "measure_stepped_sine_point"]

STEPPED_SINE_COLUMNS = (
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("phase_lag_deg", "phase lag", "deg", ".2f"),
    *PURITY_COLUMNS,
)


def measure_stepped_sine_point(
    bench: Bench, plan: SteppedSinePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment."""
    point = head(plan, target)
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics)
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": True, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    reason = drift_objection(bench, vibration, plan.accepted_drift)
    return {
        **point,
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "amplitude_m": vibration.amplitude_m,
        "phase_lag_deg": vibration.phase_lag_deg,
        "voltage_v": float(np.abs(rows["command_v"]).mean()),
        **purity(vibration),
        "periods": vibration.periods,
        "settle_periods": float(settling["periods"]),
        "amplitude_drift": float(settling["drift"]),
        "harmonics": as_pairs(vibration.harmonics),
        "harmonics_std": None if vibration.harmonics_std is None else vibration.harmonics_std.tolist(),
        "residual_rms": vibration.residual_rms.tolist(),
        "warnings": quality_warnings(bench, vibration, rows),
    }


def frequency_responses_of(
    points: Iterable[Mapping[str, Any]], channels: Sequence[Mapping[str, Any]], specimen: str
) -> tuple[FrequencyResponse, ...]:
    """The accepted points of a recording, one frequency response per level; raises `IdentificationError` without any."""
    roles = [channel["role"] for channel in channels]
    force, drive = roles.index("force"), roles.index("drive")
    levels: dict[float, list[Mapping[str, Any]]] = {}
    for point in points:
        if point["accepted"]:
            levels.setdefault(point["level"], []).append(point)
    if not levels:
        raise IdentificationError("points: none of the recording was accepted")
    out = []
    for level, accepted in levels.items():
        fundamentals = np.array([as_complex(point["harmonics"])[:, 1] for point in accepted])
        out.append(
            FrequencyResponse(
                frequency_hz=np.array([point["frequency_hz"] for point in accepted]),
                force=fundamentals[:, force],
                response=fundamentals[:, drive],
                kind="acceleration",
                controlled="voltage",
                level=level,
                label=f"{level:g} V",
                specimen=specimen,
            )
        )
    return tuple(out)
