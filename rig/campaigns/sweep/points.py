"""Points of a sweep test: their contents, their evaluation from recorded rows, and fundamentals over time."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from controller import AmplitudeLaw
from identification import ForceDropOut, Transient, demodulate, force_drop_out
from rig.bench import Bench
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.lost_samples import bridged, lost_rows, rms_of, too_many_lost, windows
from rig.campaigns.evaluation.point import PART, Point, Quality, planned_point
from rig.campaigns.evaluation.recorded import accepted_points, bench_of_recording, point_rows
from rig.campaigns.evaluation.vibrations import VOLTAGE, channel_factors, channels_of
from rig.campaigns.planning.plan import Target
from rig.campaigns.sweep.plan import SweepPlan
from rig.recording.reader import Recording
from rig.text.column import Column
from rig.tick.layout import SATURATED

NOT_HELD = 0.05  # of its level: a larger deviation is reported
USUAL = 0.75  # of a sweep: the part over which the level has to be held

SWEEP_COLUMNS = (
    Column("off_resonance_n", "force off resonance", "N", ".4f"),
    Column("minimum_ratio", "smallest", "%", ".2f", 100.0),
    Column("minimum_frequency_hz", "at", "Hz", ".3f"),
    Column("overshoot_ratio", "then up to", "%", ".1f", 100.0),
    Column("held_least", "held from", "%", ".1f", 100.0, optional=True),
    Column("held_most", "to", "%", ".1f", 100.0, optional=True),
    Column("peak_m", "peak", "mm", ".4f", 1e3),
    Column("peak_frequency_hz", "at", "Hz", ".3f"),
)


@dataclass(frozen=True, kw_only=True)
class HeldCourse:
    """The held quantity over a sweep."""

    held_least: float
    """Smallest value of the held quantity over its level."""
    held_least_frequency_hz: float
    """Frequency of the smallest value, Hz."""
    held_most: float
    """Largest value of the held quantity over its level."""
    held_most_frequency_hz: float
    """Frequency of the largest value, Hz."""
    held_rms_error: float
    """RMS of the relative deviation from the level."""
    held_usual_error: float
    """Relative deviation that is not exceeded in three quarters of the sweep."""
    saturated_share: float
    """Part of the sweep in which the output was at its limit."""


@dataclass(frozen=True, kw_only=True)
class SweepResult:
    """Results of a sweep."""

    drop_out: ForceDropOut = field(metadata=PART)
    """Drop-out of the force's fundamental at the resonance."""
    minimum_ratio: float
    """Smallest force over the force off resonance."""
    overshoot_ratio: float
    """Largest force after the minimum over the force off resonance."""
    duration_s: float
    """Length of the sweep, s."""
    held: HeldCourse | None = field(default=None, metadata=PART)
    """The held quantity; None with levels in volts."""


def measure_sweep(bench: Bench, plan: SweepPlan, target: Target, rows: np.ndarray, settling: np.void) -> Point[object]:
    """Evaluate a recorded sweep: a transient vibration, which does not have to settle."""
    transient = transient_of(bench, rows)
    drop_out = force_drop_out(transient, off_resonance_hz=plan.off_resonance_hz)
    held, warnings = _held(bench, plan, target, rows, transient)
    reason = "" if held is None else _level_objection(plan, held.held_usual_error)
    return replace(
        planned_point(plan, target),
        reason=reason,
        quality=Quality.of(reason),
        warnings=(*warnings, *_gaps(transient, rows)),
        channel_rms=tuple(rms_of(rows)),
        result=SweepResult(
            drop_out=drop_out,
            minimum_ratio=drop_out.minimum_ratio,
            overshoot_ratio=drop_out.overshoot_ratio,
            duration_s=rows.size / bench.sample_rate_hz,
            held=held,
        ),
    )


def _gaps(transient: Transient, rows: np.ndarray) -> list[str]:
    """Warn of gaps in a sweep: what happened there, perhaps the smallest force, is unknown."""
    steps_s = np.diff(transient.time_s)
    if not lost_rows(rows).any() or not steps_s.size:
        return []
    holes = np.flatnonzero(steps_s > 1.5 * float(np.median(steps_s)))
    where = ", ".join(f"{transient.frequency_hz[hole]:.3f}" for hole in holes[:5])
    more = " Hz and more" if holes.size > 5 else " Hz"
    return [f"not measured at {where}{more}: samples were lost"] if where else []


def _level_objection(plan: SweepPlan, error: float) -> str:
    """Object if the held quantity was too far from its level in a large part of the sweep; no loop holds it through a jump."""
    if error <= plan.accepted_level_error:
        return ""
    held = "displacement" if plan.level_unit == "m" else "force"
    return (
        f"the {held} is more than {100.0 * error:.3g} % off its level in {100.0 * (1.0 - USUAL):.0f} % of the sweep, "
        f"accepted up to {100.0 * plan.accepted_level_error:g} %"
    )


def _held(
    bench: Bench, plan: SweepPlan, target: Target, rows: np.ndarray, transient: Transient
) -> tuple[HeldCourse | None, list[str]]:
    """Return the extremes of the held quantity over its level, with their frequencies, and warnings about them."""
    if plan.amplitude_law is AmplitudeLaw.VOLTAGE:
        return None, []
    held = _course(bench, plan, rows, transient) / target.level
    least, most = int(np.argmin(held)), int(np.argmax(held))
    share = float(np.mean((rows["flags"] & SATURATED) != 0))
    warnings = [f"the output was at its limit in {100.0 * share:.2g} % of the sweep"] if share else []
    for name, place in (("fell to", least), ("rose to", most)):
        if abs(held[place] - 1.0) > NOT_HELD:
            where = f"{100.0 * held[place]:.1f} % of its level at {transient.frequency_hz[place]:.3f} Hz"
            warnings.append(f"the {'displacement' if plan.level_unit == 'm' else 'force'} {name} {where}")
    course = HeldCourse(
        held_least=float(held[least]),
        held_least_frequency_hz=float(transient.frequency_hz[least]),
        held_most=float(held[most]),
        held_most_frequency_hz=float(transient.frequency_hz[most]),
        held_rms_error=float(np.sqrt(np.mean((held - 1.0) ** 2))),
        held_usual_error=float(np.quantile(np.abs(held - 1.0), USUAL)),
        saturated_share=share,
    )
    return course, warnings


def _course(bench: Bench, plan: SweepPlan, rows: np.ndarray, transient: Transient) -> np.ndarray:
    """Return the held quantity at the transient's instants, float[n]: force, its RMS over two periods, or displacement."""
    if plan.amplitude_law is AmplitudeLaw.FORCE:
        return np.asarray(np.abs(transient.force))
    roles = [channel.role for channel in bench.channels]
    if plan.amplitude_law is AmplitudeLaw.RESPONSE:
        acceleration = np.abs(transient.fundamentals[roles.index("drive")])
        return np.asarray(acceleration / (2.0 * np.pi * transient.frequency_hz) ** 2)
    turns = np.unwrap(rows["theta_rad"].astype(float)) / (2.0 * np.pi)
    force = bridged(rows)[:, roles.index("force")]
    sums = np.cumsum([force, force**2], axis=1)
    instants = np.interp(transient.time_s * bench.sample_rate_hz, np.arange(turns.size), turns)
    ends = np.clip(np.add.outer((-1.0, 1.0), instants), turns[0], turns[-1])
    samples = np.interp(ends, turns, np.arange(turns.size))
    mean, square = (np.diff(np.interp(ends, turns, one), axis=0)[0] / np.diff(samples, axis=0)[0] for one in sums)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def transient_of(bench: Bench, rows: np.ndarray, roles: Collection[str] | None = None) -> Transient:
    """Return the fundamentals over time of recorded rows: every input without its skew, and the output as channel ``voltage``.

    ``roles``: those of the channels that are wanted, the force's among them; all if None. There are no instants where too many
    samples were lost. Raises `identification.IdentificationError` if no instant is left.
    """
    lost = lost_rows(rows)
    inputs = bridged(rows) if lost.any() else rows["inputs"]
    all_channels = (*channels_of(bench), VOLTAGE)
    wanted = [row for row, channel in enumerate(all_channels) if roles is None or channel.role in roles]
    signals, channels = np.vstack([inputs.T, rows["output_v"]])[wanted], [all_channels[row] for row in wanted]
    transient = demodulate(rows["theta_rad"], signals, channels, sample_rate_hz=bench.sample_rate_hz)
    factors = channel_factors(bench, transient.frequency_hz)
    corrected = transient.fundamentals * np.vstack([factors, np.ones_like(factors[:1])])[wanted]
    return _without_gaps(replace(transient, fundamentals=corrected), lost, bench.sample_rate_hz)


def _without_gaps(transient: Transient, lost: np.ndarray, sample_rate_hz: float) -> Transient:
    if not lost.any():
        return transient
    half_s = 0.5 * transient.window_periods / transient.frequency_hz
    first, end = windows(transient.time_s, half_s, sample_rate_hz, lost.size)
    keep = ~too_many_lost(lost, first, end)
    return replace(
        transient,
        time_s=transient.time_s[keep],
        frequency_hz=transient.frequency_hz[keep],
        fundamentals=transient.fundamentals[:, keep],
    )


def recorded_sweeps(recording: Recording, roles: Collection[str] | None = None) -> dict[int, Transient]:
    """Return the fundamentals over time of every accepted sweep, by the stored number of its point, which counts from 0.

    The output is channel ``voltage``. ``roles``: those of the channels that are wanted, the force's among them; all if None.
    """
    bench = bench_of_recording(recording)
    return {
        point.number: transient_of(bench, point_rows(recording, point.number), roles)
        for point in accepted_points(recording, SweepResult)
    }


SWEEP = Campaign(
    plan=SweepPlan,
    result=SweepResult,
    measure=measure_sweep,
    columns=SWEEP_COLUMNS,
    draw="rig.campaigns.sweep.figure:draw",
    figure_in=(9.0, 8.0),
    identity=("start_hz", "stop_hz", "rate_hz_per_s", "rate_octaves_per_min"),
    measurements={Transient: recorded_sweeps},
    exchanged=lambda recording: list(recorded_sweeps(recording).values()),
    experiments="sweeps",
)
