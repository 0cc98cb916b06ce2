"""Evaluation shared by all campaigns: failed points, channels, periodic vibrations."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, cast

import numpy as np

from identification import Channel, PeriodicVibration, nonlinear_mode
from identification.signals import vibration_in
from rig.bench import Bench
from rig.campaigns.evaluation.device_faults import DISTURBED, DeviceFaults, why_disturbed
from rig.campaigns.evaluation.lost_samples import lost_rows
from rig.campaigns.evaluation.point import Modal, Point, Quality, planned_point, spectrum_of, vibration_of
from rig.campaigns.evaluation.rows import Rows, phases
from rig.campaigns.planning.drive_shape import DriveShape
from rig.campaigns.planning.plan import OpenLoopPlan, Plan, Target
from rig.recording.stored import StoredTable
from rig.tick.safety.layout import POLARITY_HINT
from rig.tick.sequencer.layout import Outcome
from rig.tick.sequencer.repetition import LARGEST_CONTINUED, LARGEST_HELD, LARGEST_LOST

VOLTAGE = Channel("voltage", "monitor", "V")
"""The output measured at the converter, as a channel beside the inputs."""

WHY = {
    Outcome.NOT_SETTLED: "not settled within {longest:g} periods",
    Outcome.DISTURBED: DISTURBED,
    Outcome.LOST_LOCK: "phase lock lost",
    Outcome.TOO_STEEP: "on the way the backbone becomes steeper than the gains bear (controller.steepest_backbone)",
    Outcome.NEAR_LIMIT: "on the way force or motion comes near a limit of the bench (`near_limits` of the plan)",
    Outcome.UNREACHABLE: "out of reach: the output was at its voltage limit",
    Outcome.OUTSIDE_WINDOW: "the frequency was at an end of its window: another mode, or a resonance outside",
    Outcome.NOT_LOCKED: "the lock was lost and did not return",
    Outcome.INTERRUPTED: "interrupted",
}

SPOILT_BY_THE_DEVICE = {Outcome.NOT_SETTLED, Outcome.LOST_LOCK, Outcome.NOT_LOCKED, Outcome.OUTSIDE_WINDOW}
"""Outcomes that late outputs or lost samples may explain."""

ALLOWED = {
    Outcome.OUTPUT_HELD: LARGEST_HELD,
    Outcome.OUTPUT_CONTINUED: LARGEST_CONTINUED,
    Outcome.SAMPLES_LOST: LARGEST_LOST,
}
"""Outcomes of records that were given up for late outputs or lost samples, and the part of the samples that may be such."""

POLARITY_DEG = 60.0  # a larger phase error does not come from a settling time that is too short
FEW_BITS = 20.0  # below this, quantisation may change the damping by a percent unless noise dithers it


def not_evaluated(plan: Plan, target: Target, error: Exception, settled: bool = True) -> Point[object]:
    """Return a point whose rows contain no vibration that can be evaluated."""
    return replace(planned_point(plan, target), settled=settled).refused(f"cannot be evaluated: {error}")


def failed_point(
    plan: Plan, target: Target, outcome: np.void, *, at_start: bool = False, locked: bool = False
) -> Point[object]:
    """Return a point that was not measured, with the reason: late outputs and lost samples before anything else.

    ``at_start``: no lock was gained at the start voltage. ``locked``: a lock had been gained before, so the polarity is right.
    """
    code = Outcome(int(outcome["outcome"]))
    error, drift = math.degrees(float(outcome["mean_error_rad"])), float(outcome["drift"])
    faults = DeviceFaults.of(outcome)
    why = WHY.get(code, code.name.lower()).format(longest=plan.settle_rule.longest_periods)
    if code is Outcome.DISTURBED:
        why = why_disturbed(faults)
    elif code in ALLOWED:
        why = f"{faults.text()}; allowed is up to {ALLOWED[code]:.0%}"
    elif code in SPOILT_BY_THE_DEVICE and (said := faults.text()):
        why = f"{why}; {said}"
    if at_start:
        why = f"no lock at the start voltage: {why}"
    if target.frequency_hz is not None:
        why = f"at {target.frequency_hz:.6g} Hz: {why}"
    if not math.isfinite(error) and code in (Outcome.NOT_SETTLED, Outcome.DISTURBED):
        why += ": force or drive signal is too small for its phase to be read"
    if math.isfinite(error) and code is not Outcome.INTERRUPTED:
        phase = "" if isinstance(plan, OpenLoopPlan) else f"averaged phase error {error:.2f} deg, "
        why += f" ({phase}amplitude drift {100.0 * drift:.3g} %)"
    distortion = float(outcome["distortion"]) if code is Outcome.NOT_SETTLED else 0.0  # over the tolerance of the loop
    if distortion == math.inf:
        why += "; the harmonics loop could not measure its plant, or the voltage limit left no room for it"
    elif distortion > 1.0:
        why += f"; controlled harmonics are {distortion:.3g} times their tolerance off (controller.harmonics.largest, voltage?)"
    if not locked and (code in (Outcome.OUTSIDE_WINDOW, Outcome.NOT_LOCKED) or abs(error) > POLARITY_DEG):
        why += f"; {POLARITY_HINT}"
    failed = replace(planned_point(plan, target), settled=False, settle_periods=float(outcome["periods"]))
    return failed.refused(why, Quality.REJECTED if code in ALLOWED else Quality(code.name.lower().replace("_", "-")))


def recorded_vibration(
    bench: Bench, rows: Rows, harmonics: int, phase_lag_target_deg: float = 90.0
) -> PeriodicVibration:
    """Return the periodic vibration in recorded rows, with the skew and the high-pass of the channels removed.

    Lost rows are left out. Raises `identification.IdentificationError` if the rows contain no vibration.
    """
    vibration = vibration_in(
        _Record(rows),
        channels_of(bench),
        sample_rate_hz=bench.sample_rate_hz,
        harmonics=harmonics,
        resolution=[channel.resolution_in_unit for channel in bench.channels],
        noise_rms=[channel.noise_rms for channel in bench.channels],
        phase_lag_target_deg=phase_lag_target_deg,
    )
    factors = channel_factors(bench, vibration.frequency_hz * np.arange(vibration.harmonics.shape[1]))
    std, rounding = vibration.harmonics_std, vibration.rounding_std
    return replace(
        vibration,
        harmonics=vibration.harmonics * factors,
        harmonics_std=None if std is None else std * np.abs(factors),
        rounding_std=None if rounding is None else rounding * np.abs(factors),
    )


class _Record:
    """Rows as a record that is read in chunks."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        self.size = rows.size

    def theta_rad(self, start: int, stop: int) -> np.ndarray:
        """Phase of a stretch."""
        return np.asarray(self._rows[start:stop]["theta_rad"].astype(float))

    def samples(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Inputs of a stretch, and which of them were lost."""
        rows = self._rows[start:stop]
        return rows["inputs"].astype(float).T, lost_rows(rows)


def modal_part(vibration: PeriodicVibration, shape: DriveShape) -> Modal:
    """Identify modal properties from one settled vibration alone, evaluated with this mode shape at the drive point.

    The standard error of the damping is given if that of the mode shape is known. Raises `identification.IdentificationError`
    if there are no such properties.
    """
    backbone = shape.backbone((vibration,))
    mode = nonlinear_mode(backbone) if shape.std is not None else nonlinear_mode(backbone, draws=0)  # no error is used
    damping, std = float(mode.damping_ratio[0]), float(mode.damping_ratio_std[0])
    return Modal(
        modal_frequency_hz=float(mode.modal_frequency_hz[0]),
        damping_ratio=damping if math.isfinite(damping) else None,
        damping_ratio_std=std if shape.std is not None and math.isfinite(std) else None,
        **measured_with(shape),
    )


def measured_with(shape: DriveShape) -> dict[str, float | None]:
    """Return the fields of `Modal` that say with which measured mode shape it was evaluated; empty for that of the bench."""
    return {"drive_mode_shape": shape.value, "drive_mode_shape_std": shape.std} if shape.measured else {}


def channels_from(rows: Sequence[StoredTable]) -> tuple[Channel, ...]:
    """Convert a recording's table of channels to the channels of measurements."""
    return tuple(Channel(row["name"], row["role"], row["unit"]) for row in rows)


def vibration_from(
    point: Point[object], channels: tuple[Channel, ...], phase_lag_target_deg: float = 90.0
) -> PeriodicVibration:
    """Return the vibration of a recorded point as a measurement."""
    vibration, spectrum = vibration_of(point), spectrum_of(point)
    return PeriodicVibration(
        channels,
        vibration.frequency_hz,
        spectrum.harmonics,
        vibration.periods,
        spectrum.residual_rms,
        spectrum.harmonics_std,
        spectrum.drift,
        phase_lag_target_deg=phase_lag_target_deg,
        warnings=point.warnings or (),
        rounding_std=spectrum.rounding_std,
    )


def within_periods(rows: Rows, periods: int) -> slice:
    """Return the slice of rows that holds the first ``periods`` periods and one more sample."""
    first = math.nan
    for start, theta in phases(rows):
        first = first if start else float(theta[0])
        if theta[-1] - first >= 2.0 * math.pi * periods:
            return slice(0, start + int(np.searchsorted(theta - first, 2.0 * math.pi * periods)) + 1)
    return slice(0, rows.size + 1)


def frequency_scatter(rows: Rows) -> float:
    """Standard deviation of the frequency of single periods, relative to the mean frequency."""
    first, ends = math.nan, []
    for start, theta in phases(rows):
        first = first if start else float(theta[0])
        turns = (theta - first) / (2.0 * math.pi)
        begun = np.arange(math.floor(turns[0]) + 1 if start else 0, int(turns[-1]) + 1)
        ends.append(np.interp(begun, turns, np.arange(start, start + turns.size)))
    lengths = np.diff(np.concatenate(ends))
    return float(lengths.std() / lengths.mean()) if lengths.size > 1 else 0.0


def quantisation_warnings(vibration: PeriodicVibration, bench: Bench) -> list[str]:
    """Warn where the fundamental of force or drive uses only a few bits of its converter."""
    out = []
    for channel, harmonics in zip(bench.channels, vibration.harmonics, strict=True):
        bits = abs(harmonics[1]) / channel.resolution_in_unit
        if channel.role in ("force", "drive") and bits < FEW_BITS:
            out.append(
                f"{channel.name} of {bits:.1f} converter steps: that is little for an amplitude, and rounding is most of "
                "the error bounds"
            )
    return out


def channel_factors(bench: Bench, frequency_hz: np.ndarray) -> np.ndarray:
    """Return factors that remove each channel's skew and the first-order high-passes of its sensor and input.

    A high-pass is ``1 / (1 - i f_c / f)``. At 0 Hz, which it does not pass, its factor is 1. The result is
    complex[n_channels, n].
    """
    corners_hz = np.array([(channel.high_pass_hz, channel.input_high_pass_hz) for channel in bench.channels])
    over = np.divide(1.0, frequency_hz, out=np.zeros(np.shape(frequency_hz)), where=np.asarray(frequency_hz) != 0.0)
    return np.asarray(
        skew_turn(bench, frequency_hz) * np.prod(1.0 - 1j * corners_hz[:, :, None] * np.ravel(over), axis=1)
    )


def skew_turn(bench: Bench, frequency_hz: np.ndarray) -> np.ndarray:
    """Return factors ``exp(2 pi i f tau)``, complex[n_channels, n], which remove each channel's skew tau at frequency f."""
    delay_s = np.array([channel.skew_samples for channel in bench.channels]) / bench.sample_rate_hz
    return np.asarray(np.exp(2j * math.pi * np.outer(delay_s, frequency_hz)))


def channels_of(bench: Bench) -> tuple[Channel, ...]:
    """Convert the channels of a bench to the channels of measurements."""
    return tuple(
        Channel(c.name, cast(Literal["force", "drive", "response", "monitor"], c.role), c.unit) for c in bench.channels
    )
