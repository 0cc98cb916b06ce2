"""Decide whether a recorded point is accepted.

An objection is a line that says why a point is not accepted. It is empty if there is no objection.
"""

import math
from dataclasses import replace

import numpy as np

from controller import AmplitudeLaw
from identification import PeriodicVibration
from rig.bench import Bench
from rig.campaigns.evaluation.nonharmonic_force import nonharmonic_force
from rig.campaigns.evaluation.point import Lock, Point, Quality, planned_point
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import damping_bias, lag_scatter_deg, quality_warnings, vibration_part
from rig.campaigns.evaluation.vibrations import frequency_scatter, modal_part
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import Target

MOTIONS = ("drive", "response")
FEW_OUTPUT_BITS = 250.0  # amplitude: above, rounding amplified by 40 off resonance stays below 7 % of the force's RMS
FAILING = 0.25  # of the largest motion: sensor noise drifts far less, a sensor that dies within a record more


def phase_objection(error_deg: float, accepted_deg: float) -> str:
    """Object if the recorded fundamental is too far from the wanted phase."""
    if abs(error_deg) <= accepted_deg:
        return ""
    return f"phase error {error_deg:.2f} deg, accepted up to {accepted_deg:g} deg"


def level_error(
    law: AmplitudeLaw, level: float, vibration: PeriodicVibration, force_rms_n: float, accepted: float
) -> tuple[float | None, str]:
    """Return the relative error of the held quantity over the record, and the objection if it is above ``accepted``.

    The error is None if the level is a voltage, which no loop holds.
    """
    measured = {
        AmplitudeLaw.FORCE: vibration.force_n,
        AmplitudeLaw.FORCE_RMS: force_rms_n,
        AmplitudeLaw.RESPONSE: vibration.amplitude_m,
    }.get(law)
    if measured is None:
        return None, ""
    error = float(measured / level - 1.0)
    held = "displacement" if law is AmplitudeLaw.RESPONSE else "force"
    text = f"the {held} is {100.0 * error:+.2f} % off its level, accepted up to {100.0 * accepted:g} %"
    return error, text if abs(error) > accepted else ""


def nonharmonic_objection(nonharmonic: float, accepted: float, output_bits: float = math.inf) -> str:
    """Object if too much of the force is neither a harmonic nor noise. If that part is unknown (NaN), there is no objection.

    ``output_bits`` is the amplitude of the output in steps of its converter.
    """
    if not nonharmonic > accepted:
        return ""
    cause = "another mode, or a loop that oscillates"
    if output_bits < FEW_OUTPUT_BITS:
        cause = (
            f"the output has an amplitude of {output_bits:.3g} steps of its converter, whose rounding is amplified off "
            f"resonance (less gain behind the converter, or a higher level, helps); else {cause}"
        )
    return f"{100.0 * nonharmonic:.1f} % of the force's RMS is not harmonic, accepted up to {100.0 * accepted:g} %: {cause}"


def hunting_objection(scatter: float, accepted: float) -> str:
    """Object if the frequency scatters too much from period to period."""
    if scatter <= accepted:
        return ""
    return (
        f"the loop hunts: the frequency scatters by {100.0 * scatter:.2f} % from period to period, "
        f"accepted up to {100.0 * accepted:g} %"
    )


def drift_objection(bench: Bench, vibration: PeriodicVibration, accepted: float) -> str:
    """Object if force or drive drifts over the record, or a response drifts by a large part of the largest motion.

    A response that drifts that much while the drive does not has a failing sensor.
    """
    if vibration.drift is None:
        return ""
    drifts, sizes = np.abs(vibration.drift), np.abs(vibration.harmonics[:, 1])
    motion = max(size for channel, size in zip(bench.channels, sizes, strict=True) if channel.role in MOTIONS)
    for channel, drift, size in zip(bench.channels, drifts, sizes, strict=True):
        if channel.role in ("force", "drive") and drift > accepted:
            return (
                f"channel {channel.name} changed by {100.0 * drift:.1f} % over the record, "
                f"accepted up to {100.0 * accepted:g} %"
            )
        if channel.role == "response" and drift * size > max(accepted, FAILING) * motion:
            return (
                f"channel {channel.name} changed by {100.0 * drift:.1f} % over the record, which the drive channel did not: "
                "look at its sensor and cable"
            )
    return ""


def std_objection(frequency: float, accepted_frequency: float, damping: float, accepted_damping: float) -> str:
    """Object if the relative standard error of modal frequency or damping is too large."""
    for name, std, accepted in (
        ("modal frequency", frequency, accepted_frequency),
        ("damping", damping, accepted_damping),
    ):
        if not std <= accepted:
            return f"standard error of the {name} {100.0 * std:.2g} %, accepted up to {100.0 * accepted:g} %"
    return ""


def settled_point(
    plan: SettledPlan, target: Target, bench: Bench, vibration: PeriodicVibration, rows: Rows, level: str = ""
) -> Point[object]:
    """Judge a point that was settled and then recorded at a held lag; ``level`` is the objection to the held level.

    What concerns damping only is a note.
    """
    scatter, nonharmonic = frequency_scatter(rows), nonharmonic_force(bench, [rows])
    vibrating = vibration_part(vibration, rows)
    bits = vibrating.voltage_v / bench.output_bit_v
    reason = (
        phase_objection(vibration.phase_error_deg, plan.accepted_phase_error_deg)
        or level
        or nonharmonic_objection(nonharmonic, plan.accepted_nonharmonic_force, bits)
        or hunting_objection(scatter, plan.accepted_frequency_scatter)
        or drift_objection(bench, vibration, plan.accepted_drift)
    )
    return replace(
        planned_point(plan, target),
        settled=True,
        reason=reason,
        quality=Quality.of(reason),
        warnings=quality_warnings(bench, vibration, rows),
        notes=damping_bias(vibration),
        nonharmonic_force=nonharmonic,
        vibration=vibrating,
        lock=Lock(
            phase_error_deg=vibration.phase_error_deg,
            phase_scatter_deg=lag_scatter_deg(rows),
            frequency_scatter=scatter,
        ),
    )


def modal_point(
    plan: SettledPlan, target: Target, bench: Bench, vibration: PeriodicVibration, rows: Rows, level: str = ""
) -> Point[object]:
    """Judge a point as `settled_point` does, and add the modal properties of its vibration."""
    modal = modal_part(vibration, drive_shape(bench, plan.plant))
    return replace(settled_point(plan, target, bench, vibration, rows, level), modal=modal)


def damping_point(
    plan: SettledPlan, target: Target, bench: Bench, vibration: PeriodicVibration, rows: Rows, level: str = ""
) -> Point[object]:
    """Judge a point as `modal_point` does, of a test that asks for damping: what concerns it is a warning."""
    point = modal_point(plan, target, bench, vibration, rows, level)
    return replace(point, notes=()).warned(*point.notes)


def with_settling(point: Point[object], settling: np.void) -> Point[object]:
    """Add the settling time and the amplitude drift to a point, from the outcome record of its settle segment."""
    return replace(point, settle_periods=float(settling["periods"]), amplitude_drift=float(settling["drift"]))
