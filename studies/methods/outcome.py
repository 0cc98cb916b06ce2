"""What came of a run: points, periods of vibration, errors against harmonic balance, coverage of the intervals."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

import rig
from identification import IdentificationError, nonlinear_mode
from rig.campaigns.evaluation.recorded import points_of, recorded_drive_shape
from rig.campaigns.evaluation.vibrations import channels_from, vibration_from
from rig.errors import RigError
from simulators.analysis import NotConvergedError
from studies.methods.plans import plan_of
from studies.methods.rigs import bench_of, levels_of, truth_at
from vibrolock.arrays import Float

UNKNOWN = math.nan


@dataclass(frozen=True)
class Measured:
    """A backbone as measured, one entry a level; standard errors are NaN where the method states none."""

    amplitude_m: Float
    frequency_hz: Float
    damping_ratio: Float
    frequency_std_hz: Float
    damping_std: Float


@dataclass(frozen=True)
class Outcome:
    """One run. Errors are relative; lists have one entry for each level that was accepted."""

    rig: str
    method: str
    pure: bool
    condition: str
    knob: float
    seed: int
    levels: int
    """Levels that the backbone should have."""
    asked_points: int = 0
    """Points that the plan asks for."""
    refused: int = 0
    """Points that were not accepted."""
    seconds: float = UNKNOWN
    """From the first driven sample to 0 V."""
    periods: float = UNKNOWN
    """Periods of vibration in this time."""
    frequency_errors: list[float] = field(default_factory=list)
    damping_errors: list[float] = field(default_factory=list)
    frequency_covered: list[bool] = field(default_factory=list)
    """Whether the stated 95 % interval holds the truth; empty if the method states none."""
    damping_covered: list[bool] = field(default_factory=list)
    reason: str = ""
    """How the run ended early, or why the first of the refused points was refused."""
    failed: str = ""
    """Why there is no backbone; empty if there is one."""

    def row(self) -> dict[str, Any]:
        """Return it as JSON."""
        return asdict(self)


def turns(theta_rad: Float) -> float:
    """Return the periods that an oscillator phase, wrapped to a period, passes through."""
    return float(np.sum(np.mod(np.diff(theta_rad), 2.0 * np.pi)) / (2.0 * np.pi)) if theta_rad.size else 0.0


def driven(output_v: Float) -> slice:
    """Return the rows from the first driven sample to the last, with those at 0 V between them."""
    on = np.flatnonzero(output_v)
    return slice(int(on[0]), int(on[-1]) + 1) if on.size else slice(0, 0)


def covered(errors: Float, stds: Float) -> list[bool]:
    """Return whether 1.96 standard errors hold each error; nothing where none is stated."""
    return [bool(abs(e) <= 1.96 * s) for e, s in zip(errors, stds, strict=True) if math.isfinite(s)]


def carried_out(name: str, method: str, pure: bool, condition: str, knob: float, seed: int) -> Outcome:
    """Run a method once, and compare what it found with the truth."""
    fixed: dict[str, Any] = {
        **{"rig": name, "method": method, "pure": pure, "condition": condition, "knob": knob, "seed": seed},
        "levels": len(levels_of(name, pure)[0]),
    }
    try:
        plan = plan_of(method, name, pure, condition, knob)
        run = rig.run(plan, bench=bench_of(name, condition), seed=seed)
    except (RigError, ValueError) as error:  # a tune that fails, a plan that the bench refuses
        return Outcome(**fixed, failed=f"{type(error).__name__}: {error}"[:300])
    with run:
        effort = _effort(run.recording, bench_of(name).sample_rate_hz)
        asked = len(plan.targets())
        points = points_of(run.recording)
        accepted = sum(point.accepted for point in points)
        end = run.recording.parts[-1].end or {"reason": "none", "text": "the recording was cut short"}
        early = "" if end["reason"] == "completed" else str(end["text"])
        reason = early or next((point.reason for point in points if not point.accepted), "")
        counts: dict[str, Any] = effort | {"asked_points": asked, "refused": asked - accepted, "reason": reason[:300]}
        try:
            found = measured(run)
            return Outcome(**fixed, **counts | _compared(name, pure, found))
        except (IdentificationError, NotConvergedError, RigError) as error:
            return Outcome(**fixed, **counts, failed=f"{type(error).__name__}: {error}"[:300])


def _effort(recording: Any, sample_rate_hz: float) -> dict[str, float]:
    """Return seconds and periods from the first driven sample to 0 V, over all parts."""
    seconds, periods = 0.0, 0.0
    for part in recording.parts:
        rows = driven(part.rows("output_v"))
        theta = part.rows("theta_rad")[rows].astype(float)
        seconds += theta.size / sample_rate_hz
        periods += turns(theta)
    return {"seconds": seconds, "periods": periods}


def _compared(name: str, pure: bool, found: Measured) -> dict[str, Any]:
    frequency, damping = truth_at(name, pure, found.amplitude_m)
    errors = found.frequency_hz / frequency - 1.0, found.damping_ratio / damping - 1.0
    stds = found.frequency_std_hz / frequency, found.damping_std / damping
    return {
        "frequency_errors": errors[0].tolist(),
        "damping_errors": errors[1].tolist(),
        "frequency_covered": covered(errors[0], stds[0]),
        "damping_covered": covered(errors[1], stds[1]),
    }


def measured(run: rig.Run) -> Measured:
    """Return the backbone of a run of any kind. Raises `IdentificationError` if there is none."""
    kind = run.recording.kind
    if kind == "sweep":
        return _from_sweeps(run)
    if kind == "response-controlled":
        return _from_surface(run)
    if kind == "stepped-phase":
        return _from_vibrations(run)
    points = [point for point in points_of(run.recording) if point.accepted and point.modal and point.vibration]
    if not points:
        raise IdentificationError("points: none was accepted")
    if any(point.modal.modal_frequency_std_hz is None for point in points if point.modal):
        return _from_vibrations(run)
    columns = [
        (
            point.vibration.amplitude_m,
            point.modal.modal_frequency_hz,
            point.modal.damping_ratio or UNKNOWN,
            point.modal.modal_frequency_std_hz or UNKNOWN,
            point.modal.damping_ratio_std or UNKNOWN,
        )
        for point in points
        if point.modal and point.vibration
    ]
    return Measured(*np.array(columns, float).T)


def _from_vibrations(run: rig.Run) -> Measured:
    """Settled vibrations at resonance, as `identification.nonlinear_mode` takes them."""
    points = [point for point in points_of(run.recording) if point.accepted]
    if not points:
        raise IdentificationError("points: none was accepted")
    channels = channels_from(run.recording.channels)
    vibrations = [vibration_from(point, channels) for point in points]
    mode = nonlinear_mode(recorded_drive_shape(run.recording, points).backbone(vibrations))
    errors = mode.modal_frequency_std_hz, mode.damping_ratio_std
    return Measured(mode.amplitude_m, mode.modal_frequency_hz, mode.damping_ratio, *errors)


def _from_surface(run: rig.Run) -> Measured:
    """The force surface at phase resonance, where ``phi_d^2 F = 2 z w^2 X``."""
    shape = recorded_drive_shape(run.recording, points_of(run.recording))
    section = run.force_surface().section(90.0)
    amplitude, force = np.exp(section.log_amplitude), np.exp(section.log_force)
    damping = (shape.value or UNKNOWN) ** 2 * force / (2.0 * section.omega**2 * amplitude)
    by_omega = -2.0 / section.omega  # d ln(damping) / d omega
    spread = (
        section.covariance[:, 1, 1]
        + 2.0 * by_omega * section.covariance[:, 0, 1]
        + by_omega**2 * section.covariance[:, 0, 0]
    )
    by_shape = 2.0 * (shape.std or 0.0) / (shape.value or math.inf)
    return Measured(
        amplitude,
        section.omega / (2.0 * np.pi),
        damping,
        np.sqrt(section.covariance[:, 0, 0]) / (2.0 * np.pi),
        damping * np.sqrt(spread + by_shape**2),
    )


def _from_sweeps(run: rig.Run) -> Measured:
    """Sweeps at a held response where the force leads the displacement by 90 deg; they state no standard errors."""
    found = []
    shape = recorded_drive_shape(run.recording, points_of(run.recording)).value or UNKNOWN
    for sweep in run.sweeps().values():
        roles = [channel.role for channel in sweep.channels]
        force, drive = (sweep.fundamentals[roles.index(role)] for role in ("force", "drive"))
        lag = np.angle(-force * np.conj(drive))  # the displacement is opposite to the acceleration
        past = np.flatnonzero((lag[:-1] < 0.5 * np.pi) & (lag[1:] >= 0.5 * np.pi))
        if not past.size:
            continue
        first = int(past[np.argmax(np.abs(drive[past]))])  # noise passes it, too, where there is hardly a response
        part = (0.5 * np.pi - lag[first]) / (lag[first + 1] - lag[first])
        omega, force_n, drive_m_s2 = (
            float(values[first] + part * (values[first + 1] - values[first]))
            for values in (2.0 * np.pi * sweep.frequency_hz, np.abs(force), np.abs(drive))
        )
        amplitude = drive_m_s2 / omega**2
        found.append((amplitude, omega / (2.0 * np.pi), shape**2 * force_n / (2.0 * drive_m_s2), UNKNOWN, UNKNOWN))
    if not found:
        raise IdentificationError("sweeps: none passed resonance")
    return Measured(*np.array(found, float).T)
