"""Points of a decay campaign: a settled vibration and its decay, evaluated side by side."""

from dataclasses import dataclass, replace

import numpy as np

from identification import Backbone, DecayBackbone, IdentificationError
from identification.common import decay_with_force
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.campaign import Campaign
from rig.campaigns.decay.plan import DecayPlan
from rig.campaigns.evaluation.acceptance import damping_point
from rig.campaigns.evaluation.point import Point, Quality
from rig.campaigns.evaluation.recorded import (
    accepted_points,
    bench_of_recording,
    point_rows,
    settled_backbone,
)
from rig.campaigns.evaluation.recorded_flow import recorded_flow
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibration_quality import PURITY_COLUMNS, shared_columns
from rig.campaigns.evaluation.vibrations import channels_of, recorded_vibration, within_periods
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.plan import Target
from rig.recording.reader import Recording
from rig.text.column import Column

_RESIDUAL_ERROR = 0.01  # of the other modes' receptance, by rig tune; twice what it is on the shipped rigs
_EARLY = 8  # instants of a decay from which its frequency is taken
_BEFORE_PERIODS = 15.0  # of the settled record that the slow flow takes in, so that its ends are away from the decay

DECAY_COLUMNS = (
    *shared_columns("force_n", "amplitude_m", "frequency_hz", "damping_ratio"),
    Column("decay_from_m", "decay from", "mm", ".4f", 1e3),
    Column("decay_to_m", "to", "mm", ".4f", 1e3),
    Column("decay_frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("decay_frequency_bound_hz", "+-", "Hz", ".4f", in_line=False),
    Column("decay_damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("decay_damping_bound", "+-", "%", ".4f", 100.0, in_line=False),
    Column("decay_ratio", "with exciter", "%", ".3f", 100.0),
    *PURITY_COLUMNS,
)


@dataclass(frozen=True, kw_only=True)
class DecayResult:
    """Results of a decay, of the structure without its exciter unless said otherwise."""

    decay_from_m: float
    """Largest amplitude at which the decay was evaluated, m."""
    decay_to_m: float
    """Smallest amplitude, m."""
    decay_frequency_hz: float
    """Modal frequency at the largest amplitude, Hz."""
    decay_frequency_bound_hz: float
    """Half width of its 95 % interval, Hz."""
    decay_damping_ratio: float
    """Damping ratio at the largest amplitude."""
    decay_damping_bound: float
    """Half width of its 95 % interval."""
    decay_ratio: float
    """Rate of decay with the exciter over the modal frequency, at the largest amplitude."""
    decay_points: int
    """Number of levels at which the decay could be evaluated."""


def measure_decay(bench: Bench, plan: DecayPlan, target: Target, rows: Rows, settling: np.void) -> Point[object]:
    """Evaluate the settled record and the decay of one point; the rows begin with the ramp to it."""
    taken = rows[0 : rows.size]
    first, release = _stretches(taken)
    held = taken[first:release]
    held = held[within_periods(held, plan.record_periods)]
    vibration = recorded_vibration(bench, held, plan.harmonics, plan.displacement_lag_deg)
    point = damping_point(plan, target, bench, vibration, held)
    try:
        mode = _decay_of(bench, plan, taken).mode()
    except (IdentificationError, ArithmeticError) as error:
        reason = point.reason or f"the decay cannot be evaluated: {error}"
        return replace(point, reason=reason, quality=Quality.of(reason))
    result = DecayResult(
        decay_from_m=float(mode.amplitude_m[0]),
        decay_to_m=float(mode.amplitude_m[-1]),
        decay_frequency_hz=float(mode.modal_frequency_hz[0]),
        decay_frequency_bound_hz=float(mode.modal_frequency_bound_95_hz[0]),
        decay_damping_ratio=float(mode.damping_ratio[0]),
        decay_damping_bound=float(mode.damping_ratio_bound_95[0]),
        decay_ratio=float(mode.decay_ratio[0]),
        decay_points=int(mode.time_s.size),
    )
    return replace(point, result=result)


def _stretches(rows: np.ndarray) -> tuple[int, int]:
    """Return the first rows of the settled record and of the decay: the last two segments among the rows."""
    segment = rows["segment"]
    release = int(np.flatnonzero(segment == segment[-1])[0])
    before = segment[release - 1] if release else segment[0]
    return int(np.flatnonzero(segment == before)[0]), release


def _decay_of(bench: Bench, plan: DecayPlan, rows: np.ndarray) -> DecayBackbone:
    """Evaluate a decay; times count from the release. The exciter's part is taken out through the measured force."""
    first, release = _stretches(rows)
    period = bench.sample_rate_hz / float(np.median(rows["frequency_hz"][release:]))
    begin = max(first, release - round(_BEFORE_PERIODS * period))
    flow = recorded_flow(bench, rows[begin:], plan.harmonics, plan.plant)
    shape = drive_shape(bench, plan.plant)
    start_s = (release - begin) / bench.sample_rate_hz
    if plan.plant is not None:
        # The exciter may have pulled the frequency to where the other modes contribute more or less.
        decaying = flow.frequency_hz[flow.time_s > start_s + 3.0 / float(np.median(flow.frequency_hz))]
        residual = plan.plant.residual_at(float(np.median(decaying[:_EARLY])))
        flow = recorded_flow(bench, rows[begin:], plan.harmonics, plan.plant, residual_m_n=residual)
    mode = decay_with_force(
        flow,
        start_s=start_s,
        number=plan.decay_levels,
        drive_mode_shape_std=shape.std or 0.0,
        residual_std_m_n=_RESIDUAL_ERROR * abs(flow.residual_m_n),
    )
    mode = replace(mode, time_s=mode.time_s - start_s, start_s=mode.start_s - start_s, stop_s=mode.stop_s - start_s)
    ratio = float(np.median(mode.decay_ratio / mode.damping_ratio))
    note = (
        f"the vibration decayed {ratio:.3g} times as fast as without the exciter, whose contribution was removed using "
        f"the measured force: 1 % more of drive_mode_shape, or 2 % more gain of the force against the motion, changes the "
        f"damping by {2.0 * abs(ratio - 1.0):.2g} %"
    )
    return DecayBackbone(modes=(mode,), channels=channels_of(bench), specimen=bench.specimen.name, notes=(note,))


def recorded_decays(recording: Recording) -> dict[int, DecayBackbone]:
    """Return the decay of every accepted point, by the stored number of its point, evaluated anew from its rows."""
    bench = bench_of_recording(recording)
    plan = validated(DecayPlan, recording.configuration["plan"], "plan of the recording")
    accepted = [point for point in accepted_points(recording, DecayResult) if point.rows is not None]
    return {point.number: _decay_of(bench, plan, point_rows(recording, point.number)) for point in accepted}


def recorded_settled(recording: Recording) -> Backbone:
    """Return the settled points from which the decays began, as a backbone."""
    plan = validated(DecayPlan, recording.configuration["plan"], "plan of the recording")
    return settled_backbone(recording, plan.displacement_lag_deg)


DECAY = Campaign(
    plan=DecayPlan,
    result=DecayResult,
    measure=measure_decay,
    columns=DECAY_COLUMNS,
    draw="rig.campaigns.decay.figure:draw",
    identity=("controller.phase_lag_deg",),
    fixed=("harmonics", "decay_levels"),
    measurements={Backbone: recorded_settled, DecayBackbone: recorded_decays},
    exchanged=lambda recording: [recorded_settled(recording)],
)
