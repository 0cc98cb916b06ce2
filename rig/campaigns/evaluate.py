"""From the recorded rows of a point to its result, and from the results of a recording to measurements in memory."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np

from identification import Backbone, Channel, IdentificationError, PeriodicVibration, nonlinear_mode, periodic_vibration
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan, Target
from rig.sequencer.layout import Outcome

__all__ = ["backbone_of", "failed_point", "measured_point"]

WHY = {
    Outcome.NOT_SETTLED: "not settled within {longest:g} periods",
    Outcome.DISTURBED: "the settle rule was broken while recording",
    Outcome.LOST_LOCK: "phase lock lost",
    Outcome.UNREACHABLE: "out of reach: the output stood at its voltage limit",
    Outcome.INTERRUPTED: "interrupted",
}

POLARITY_DEG = 60.0  # a phase error that large is no matter of patience
FEW_BITS = 20.0  # below, quantisation may move the damping by a percent, without noise to dither it


def measured_point(
    bench: Bench, plan: BackbonePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment.

    A point whose recorded fundamental is too far from the wanted phase is kept, marked as not accepted.
    """
    point = _head(plan, target)
    channels = _channels(bench)
    rows = rows[_within(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = periodic_vibration(
            rows["theta_rad"].astype(float),
            rows["inputs"].astype(float).T,
            channels,
            sample_rate_hz=bench.sample_rate_hz,
            harmonics=plan.harmonics,
            phase_lag_target_deg=plan.controller.phase_lag_deg + 180.0,
        )
        vibration = _without_skew(vibration, bench)
        mode = nonlinear_mode(Backbone((vibration,), bench.specimen.name, bench.specimen.drive_mode_shape))
    except (IdentificationError, ArithmeticError) as error:
        return {**point, "settled": True, "accepted": False, "reason": f"cannot be evaluated: {error}"}
    error_deg = vibration.phase_error_deg
    hunting = _frequency_scatter(rows["theta_rad"])
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
        "harmonics": _pairs(vibration.harmonics),
        "harmonics_std": None if vibration.harmonics_std is None else vibration.harmonics_std.tolist(),
        "residual_rms": vibration.residual_rms.tolist(),
        "drift": None if vibration.drift is None else _pairs(vibration.drift),
        "warnings": [*vibration.warnings, *_coarse(vibration, bench)],
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
    for channel, drift in zip(bench.channels, () if vibration.drift is None else np.abs(vibration.drift), strict=False):
        if channel.role in ("force", "drive") and drift > plan.accepted_drift:
            return (
                f"channel {channel.name} changed by {100.0 * drift:.1f} % over the record, "
                f"accepted up to {100.0 * plan.accepted_drift:g} %"
            )
    return ""


def _within(theta_rad: np.ndarray, periods: int) -> slice:
    """The rows of the first so many periods, and one sample more."""
    turned = np.unwrap(theta_rad.astype(float))
    return slice(0, int(np.searchsorted(turned - turned[0], 2.0 * math.pi * periods)) + 1)


def _frequency_scatter(theta_rad: np.ndarray) -> float:
    """Standard deviation of the frequency of single periods, relative to its mean."""
    turned = np.unwrap(theta_rad.astype(float))
    turns = (turned - turned[0]) / (2.0 * math.pi)
    ends = np.interp(np.arange(int(turns[-1]) + 1), turns, np.arange(turns.size))
    lengths = np.diff(ends)
    return float(lengths.std() / lengths.mean()) if lengths.size > 1 else 0.0


def _coarse(vibration: PeriodicVibration, bench: Bench) -> list[str]:
    """A remark for each of force and drive whose fundamental is only some bits of its converter high."""
    out = []
    for channel, harmonics in zip(bench.channels, vibration.harmonics, strict=True):
        bits = abs(harmonics[1] * channel.sensitivity_v_per_unit) / channel.resolution_v
        if channel.role in ("force", "drive") and bits < FEW_BITS:
            out.append(
                f"channel {channel.name}: an amplitude of {bits:.1f} bits; quantisation is not in the error bounds"
            )
    return out


def _without_skew(vibration: PeriodicVibration, bench: Bench) -> PeriodicVibration:
    """The vibration with every channel's harmonics turned forward by its skew: ``Y_h exp(i h Omega tau)``."""
    omega = 2.0 * math.pi * vibration.frequency_hz
    delay_s = np.array([channel.skew_samples for channel in bench.channels]) / bench.sample_rate_hz
    turn = np.exp(1j * omega * np.outer(delay_s, np.arange(vibration.harmonics.shape[1])))
    return replace(vibration, harmonics=vibration.harmonics * turn)


def failed_point(plan: BackbonePlan, target: Target, outcome: np.void) -> dict[str, Any]:
    """The mark of a point that was not measured, with the reason; it holds no data."""
    code = Outcome(int(outcome["outcome"]))
    error, drift = math.degrees(float(outcome["mean_error_rad"])), float(outcome["drift"])
    why = WHY.get(code, code.name.lower()).format(longest=plan.settle.longest_periods)
    if not math.isfinite(error) and code in (Outcome.NOT_SETTLED, Outcome.DISTURBED):
        why += ": force or drive signal is too small for its phase to be read"
    if math.isfinite(error) and code is not Outcome.INTERRUPTED:
        why += f" (averaged phase error {error:.2f} deg, amplitude drift {100.0 * drift:.2f} %)"
        if abs(error) > POLARITY_DEG:
            why += "; is a sensor's polarity reversed, or the resonance outside the frequency window?"
    return {
        **_head(plan, target),
        "settled": False,
        "accepted": False,
        "reason": why,
        "settle_periods": float(outcome["periods"]),
    }


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
            _complex(point["harmonics"]),
            point["periods"],
            np.asarray(point["residual_rms"], float),
            None if point["harmonics_std"] is None else np.asarray(point["harmonics_std"], float),
            None if point["drift"] is None else _complex(point["drift"]),
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


def _head(plan: BackbonePlan, target: Target) -> dict[str, Any]:
    return {
        "number": target.number,
        "level": target.level,
        "level_unit": plan.level_unit,
        "direction": target.direction,
        "repeat": target.repeat,
    }


def _channels(bench: Bench) -> tuple[Channel, ...]:
    return tuple(
        Channel(c.name, cast(Literal["force", "drive", "response", "monitor"], c.role), c.unit) for c in bench.channels
    )


def _pairs(values: np.ndarray) -> Any:
    """Complex numbers as [real, imaginary]."""
    return np.stack([values.real, values.imag], axis=-1).tolist()


def _complex(pairs: Any) -> np.ndarray:
    array = np.asarray(pairs, float)
    return np.asarray(array[..., 0] + 1j * array[..., 1])
