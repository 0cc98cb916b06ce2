"""From the recorded rows of a stepped-phase point to its result, and from the results to frequency responses in memory."""

import math
from typing import Any

import numpy as np

from controller import AmplitudeLaw
from identification import Backbone, IdentificationError, PeriodicVibration, nonlinear_mode
from identification.frequency_responses import Controlled
from rig.bench import Bench
from rig.campaigns.backbone_points import frequency_scatter
from rig.campaigns.evaluate import (
    as_pairs,
    drift_objection,
    head,
    quantisation_warnings,
    recorded_vibration,
    within_periods,
)
from rig.campaigns.plan import Column, Target
from rig.campaigns.stepped_phase import SteppedPhasePlan

__all__ = ["STEPPED_PHASE_COLUMNS", "measure_stepped_phase_point"]

STEPPED_PHASE_COLUMNS = (
    Column("phase_lag_deg", "phase lag", "deg", ".2f"),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("force_rms_n", "force RMS", "N", ".4f"),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("level_error", "level error", "%", ".2f", 100.0),
)

CONTROLLED: dict[AmplitudeLaw, Controlled] = {
    AmplitudeLaw.VOLTAGE: "voltage",
    AmplitudeLaw.FORCE: "force",
    AmplitudeLaw.FORCE_RMS: "force",
    AmplitudeLaw.RESPONSE: "response",
}


def measure_stepped_phase_point(
    bench: Bench, plan: SteppedPhasePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment.

    The RMS of the force is that of its samples without their mean, whatever harmonics they hold.
    """
    point = head(plan, target)
    lag_deg = target.phase_lag_deg or 0.0
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics, phase_lag_target_deg=lag_deg + 180.0)
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": True, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    force_rms_n = float(rows["inputs"][:-1, bench.index_of("force")].astype(float).std())
    alien = _alien_share(vibration, bench, force_rms_n)
    missed = level_error(plan, target, vibration, force_rms_n)
    hunting = frequency_scatter(rows["theta_rad"])
    reason = _objection(plan, bench, vibration, hunting, missed, alien)
    damping = float(mode.damping_ratio[0])
    return {
        **point,
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "force_rms_n": force_rms_n,
        "amplitude_m": vibration.amplitude_m,
        "phase_lag_deg": lag_deg - vibration.phase_error_deg,
        "phase_error_deg": vibration.phase_error_deg,
        "level_error": missed,
        "modal_frequency_hz": float(mode.modal_frequency_hz[0]),
        "damping_ratio": damping if math.isfinite(damping) else None,
        "frequency_scatter": hunting,
        "alien_force": alien,
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


def level_error(
    plan: SteppedPhasePlan, target: Target, vibration: PeriodicVibration, force_rms_n: float
) -> float | None:
    """Relative error of what was held over the record; None where the level is a voltage, which nothing holds."""
    measured = {
        AmplitudeLaw.FORCE: vibration.force_n,
        AmplitudeLaw.FORCE_RMS: force_rms_n,
        AmplitudeLaw.RESPONSE: vibration.amplitude_m,
    }.get(plan.amplitude_law)
    return None if measured is None else float(measured / target.level - 1.0)


def _alien_share(vibration: PeriodicVibration, bench: Bench, force_rms_n: float) -> float:
    """Part of the force's RMS that the evaluated harmonics do not hold."""
    harmonics = vibration.harmonics[bench.index_of("force"), 1:]
    rest = force_rms_n**2 - 0.5 * float(np.sum(np.abs(harmonics) ** 2))
    return math.sqrt(max(rest, 0.0)) / force_rms_n


def _objection(
    plan: SteppedPhasePlan,
    bench: Bench,
    vibration: PeriodicVibration,
    hunting: float,
    missed: float | None,
    alien: float,
) -> str:
    """Why a recorded point is not accepted; empty where it is."""
    error_deg = vibration.phase_error_deg
    if abs(error_deg) > plan.accepted_phase_error_deg:
        return f"phase error {error_deg:.2f} deg, accepted up to {plan.accepted_phase_error_deg:g} deg"
    if missed is not None and abs(missed) > plan.accepted_level_error:
        return f"level missed by {100.0 * missed:.2f} %, accepted up to {100.0 * plan.accepted_level_error:g} %"
    if alien > plan.accepted_alien_force:
        return (
            f"{100.0 * alien:.1f} % of the force's RMS are no harmonics up to {plan.harmonics}, accepted up to "
            f"{100.0 * plan.accepted_alien_force:g} %: another mode, or a loop that swings"
        )
    if hunting > plan.accepted_frequency_scatter:
        return (
            f"the loop hunts: the frequency scatters by {100.0 * hunting:.2f} % from period to period, "
            f"accepted up to {100.0 * plan.accepted_frequency_scatter:g} %"
        )
    return drift_objection(bench, vibration, plan.accepted_drift)
