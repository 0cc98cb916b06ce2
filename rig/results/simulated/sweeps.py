"""Recorded and planned sweeps, simulated by a PNLSS or structured model from force or voltage."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

from identification import IdentificationError, PnlssModel, Transient, compare_sweep, estimated_initial_state
from identification.common import find_role
from rig.campaigns.evaluation.lost_samples import bridged, lost_rows
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.kinds import kinds_that_yield
from rig.campaigns.plans import bench_of
from rig.campaigns.sweep.plan import SweepPlan
from rig.errors import RecordingError
from rig.measurements import bench_of_recording, point_rows, sweeps
from rig.measurements.experiments.build import rows_from_rest
from rig.measurements.experiments.records import sweep_pieces
from rig.measurements.experiments.signals import Signals
from rig.measurements.points_left_out import points_left_out
from rig.recording.reader import Recording
from rig.results.predictions.references import Swept
from rig.results.predictions.sweeps import COMPARED, planned, strangers
from rig.results.simulated.driven_models import DrivenModel, check_rate, with_constants
from rig.results.simulated.sweep_models import SimulatedSweepModels, SweepGiven
from rig.tick.layout import SAMPLE_LOST
from vibrolock.arrays import Float


def recorded_simulated_sweeps(path: Path, models: SimulatedSweepModels) -> Iterator[Swept]:
    """Simulate every accepted sweep of a recording, from its force or from its voltage.

    The simulation starts from rest where the data does. Raises `RecordingError` if the file has other contents,
    `identification.IdentificationError` if channels or rate do not fit.
    """
    with Recording(path) as recording:
        if recording.kind not in kinds_that_yield(Transient):
            raise RecordingError(f"{path}: holds a {recording.kind}, expected a sweep recording")
        notes = (
            *strangers(bench_of_recording(recording), models.model.specimen, models.exciter, str(path)),
            *points_left_out(recording),
        )
        recorded = sweeps(recording, roles=COMPARED)
        for number, sweep in recorded.items():
            name = path.stem if len(recorded) == 1 else f"{path.stem} [{number + 1}]"
            given, more = _recorded(recording, number, models)
            predicted = models.predict(given)
            yield Swept(predicted, sweep, compare_sweep(predicted, sweep, name=name), (*notes, *more))


def planned_simulated_sweeps(plan_source: str, models: SimulatedSweepModels) -> Iterator[Swept]:
    """Simulate every level of a planned sweep.

    Raises `ConfigurationError` if the plan is no sweep at constant voltage, or too fast for the sample rate of the model.
    """
    plan, rate_hz = planned(plan_source), models.model.sample_rate_hz
    check_rate(plan_source, max(plan.start_hz, plan.stop_hz), rate_hz)
    notes = strangers(bench_of(plan, plan_source), models.model.specimen, models.exciter, plan_source)
    row = find_role(models.model.outputs, "drive")
    for level_v in plan.levels:
        theta, envelope, first = _waveform(plan, rate_hz)
        rate = f"{plan.rate_hz_per_s:g} Hz/s" if plan.rate_hz_per_s else f"{plan.rate_octaves_per_min:g} octaves/min"
        given = SweepGiven(
            inputs=(level_v * envelope * np.cos(theta))[None],
            first=first,
            theta=theta[first:],
            frequencies_hz=(plan.start_hz, plan.stop_hz),
            largest=_largest_in_training(models.model, row),
            initial_state=None,
            is_recorded=False,
            origin=f"planned {level_v:g} V, {plan.start_hz:g} to {plan.stop_hz:g} Hz, {rate}",
        )
        yield Swept(models.predict(given), notes=notes)


def _waveform(plan: SweepPlan, rate_hz: float) -> tuple[Float, Float, int]:
    """Return phase and envelope of a planned sweep with its ramp and hold, at the model's rate, and its first sample."""
    first = round((plan.ramp_periods + plan.hold_periods) / plan.start_hz * rate_hz)
    time_s = np.arange(first + round(plan.sweep_s * rate_hz)) / rate_hz
    swept = np.maximum(time_s - time_s[first], 0.0)
    before = 2.0 * np.pi * plan.start_hz * np.minimum(time_s, time_s[first])
    if plan.rate_hz_per_s is not None:
        way = np.sign(plan.stop_hz - plan.start_hz)
        turned = plan.start_hz * swept + 0.5 * way * plan.rate_hz_per_s * swept**2
    else:
        growth = np.log(plan.stop_hz / plan.start_hz) / plan.sweep_s
        turned = plan.start_hz * np.expm1(growth * swept) / growth
    risen = np.clip(time_s * plan.start_hz / plan.ramp_periods, 0.0, 1.0)
    return before + 2.0 * np.pi * turned, 0.5 - 0.5 * np.cos(np.pi * risen), first


def _largest_in_training(model: DrivenModel, row: int) -> float:
    """Estimate the largest value of an output within the range of the training data; infinite if that is unknown."""
    if not isinstance(model, PnlssModel):
        return float("inf")  # bounded, and shown whatever it is
    found = float(np.sum(np.abs(model.c[row]) * model.state_range) + np.sum(np.abs(model.d[row]) * model.input_range))
    return found if np.isfinite(found) and found > 0.0 else float("inf")


def _recorded(recording: Recording, number: int, models: SimulatedSweepModels) -> tuple[SweepGiven, tuple[str, ...]]:
    """Return the sweep with a stored number at the model's rate, and the oscillator's phase at the compared samples."""
    bench, model, name = bench_of_recording(recording), models.model, f"sweep {number + 1}"
    try:
        signals = Signals.chosen(bench, [c.name for c in models.inputs], [c.name for c in model.outputs])
    except IdentificationError as error:
        raise IdentificationError(f"{recording.path}: {error}") from None
    fs, rate_hz = bench.sample_rate_hz, model.sample_rate_hz
    own = point_rows(recording, number)
    lead = rows_from_rest(recording, number, Fraction(rate_hz / fs))
    rows = np.concatenate([lead, own])
    lost = int(np.count_nonzero(lost_rows(rows)))
    if lost:
        rows["inputs"] = bridged(rows)
        rows["flags"] &= ~np.uint32(SAMPLE_LOST)
    plan = recording.configuration["plan"]
    ends = (float(plan["start_hz"]), float(plan["stop_hz"]))
    pieces = sweep_pieces(
        signals,
        point_from(recording.latest[number]).level,
        rows,
        lead.size,
        start_hz=ends[0],
        rate_hz=rate_hz,
        name=name,
    )
    found = next(pieces, None)
    if found is None:
        raise IdentificationError(f"{recording.path}: {name} is too short to be predicted")
    turned = np.unwrap(own["theta_rad"].astype(float))
    theta = np.interp(np.arange(found.counted) * fs / rate_hz, np.arange(turned.size), turned)
    said = [f"{recording.path}: {lost} samples of {name} were lost and are bridged"] if lost else []
    begin = None
    if found.initial_state == "estimated":
        if models.exciter is None and isinstance(model, PnlssModel):
            begin = estimated_initial_state(model, with_constants(found, model, models.constants))
        else:
            said.append(f"{recording.path}: {name} does not begin at rest, but is simulated as if it did")
    row = find_role(model.outputs, "drive")
    given = SweepGiven(
        inputs=found.inputs,
        first=found.counted_from,
        theta=theta,
        frequencies_hz=ends,
        largest=float(np.abs(found.outputs[row]).max()),
        initial_state=begin,
        is_recorded=True,
        origin=f"the recorded {', '.join(channel.name for channel in models.inputs)}",
    )
    return given, tuple(said)
