"""Recorded and planned sweeps, predicted by a nonlinear mode."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from identification import (
    Exciter,
    HalfPeriods,
    LinearModes,
    NonlinearMode,
    SweepPrediction,
    Transient,
    VoltageSweep,
    compare_sweep,
    predict_sweep,
    zero_crossings,
)
from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged
from rig.campaigns.kinds import kinds_that_yield
from rig.campaigns.plans import bench_of, load_plan
from rig.campaigns.sweep.plan import SweepPlan
from rig.errors import ConfigurationError, RecordingError, RigError
from rig.measurements import bench_of_recording, point_rows, sweeps
from rig.recording.reader import Recording
from rig.results.predictions.references import Swept
from rig.text.durations import duration

SLOW, FAST = 5.0, 20.0
"""Times real time of predicted sweeps, with reading them: of a structured model with an exciter on two machines."""
COMPARED = ("force", "drive")
"""Roles of the channels of a sweep that a comparison shows."""


def expected_duration(recordings: Sequence[Path], plans: Sequence[str]) -> str:
    """Return how long it takes to predict recorded and planned sweeps, in words; empty if that is unknown."""
    sweeps_s = 0.0
    with suppress(RigError, OSError):
        for path in recordings:
            with Recording(path) as recording:
                sweeps_s += recording.n_rows / bench_of_recording(recording).sample_rate_hz
        for source in plans:
            plan = planned(source)
            sweeps_s += plan.sweep_s * len(plan.levels)
    if not sweeps_s:
        return ""
    return f"some {duration(sweeps_s / FAST)} to {duration(sweeps_s / SLOW)} for {duration(sweeps_s)} of sweeps"


@dataclass(frozen=True)
class SweepModels:
    """Models and options with which sweeps are predicted."""

    mode: NonlinearMode
    modes: LinearModes | None
    """Linear model with the other modes."""
    exciter: Exciter | None
    """Exciter model; without it, the recorded force is imposed."""
    zero_crossings: str | None
    """Zero crossings between which the imposed force is read: ``half-periods`` or ``periods``; None: it is demodulated."""
    largest_range_use: float
    """Largest modal amplitude over the largest identified."""

    def predict(self, given: Transient | HalfPeriods | VoltageSweep) -> SweepPrediction:
        """Call `identification.predict_sweep` with these models."""
        return predict_sweep(
            self.mode,
            given,
            exciter=self.exciter,
            linear_modes=self.modes,
            largest_range_use=self.largest_range_use,
        )


def recorded_sweeps(path: Path, models: SweepModels) -> Iterator[Swept]:
    """Predict every sweep of a recording; raise `RecordingError` if the file has other contents."""
    with Recording(path) as recording:
        if recording.kind not in kinds_that_yield(Transient):
            raise RecordingError(f"{path}: holds a {recording.kind}, expected a sweep recording")
        notes = strangers(bench_of_recording(recording), models.mode.specimen, models.exciter, str(path))
        recorded = sweeps(recording)
        rejected = set(recording.latest) - set(recorded)
        if rejected or not recording.complete:
            notes += (f"{path}: is not complete; sweeps accepted, and predicted: {len(recorded)}",)
        for number, sweep in recorded.items():
            name = path.stem if len(recorded) == 1 else f"{path.stem} [{number + 1}]"
            which = models.zero_crossings
            predicted = models.predict(sweep if which is None else _between_crossings(recording, number, which))
            yield Swept(predicted, force_and_drive(sweep), compare_sweep(predicted, sweep, name=name), notes)


def planned_sweeps(plan_source: str, models: SweepModels) -> Iterator[Swept]:
    """Predict every level of a planned sweep; raise `ConfigurationError` if it is no sweep, or not linear in time."""
    plan = planned(plan_source)
    if plan.rate_hz_per_s is None:
        raise ConfigurationError(
            f"{plan_source}: rate_octaves_per_min: a logarithmic sweep cannot be predicted; give rate_hz_per_s"
        )
    notes = strangers(bench_of(plan, plan_source), models.mode.specimen, models.exciter, plan_source)
    for level_v in plan.levels:
        predicted = models.predict(VoltageSweep(plan.start_hz, plan.stop_hz, plan.rate_hz_per_s, level_v))
        yield Swept(predicted, notes=notes)


def planned(plan_source: str) -> SweepPlan:
    """Load a plan of sweeps at constant voltage; raise `ConfigurationError` for any other plan."""
    plan = load_plan(plan_source)
    if not isinstance(plan, SweepPlan):
        raise ConfigurationError(f"{plan_source}: is a plan of kind {plan.kind}, expected a sweep")
    if plan.level_unit != "V":
        raise ConfigurationError(
            f"{plan_source}: has levels in {plan.level_unit}, whose voltage only the test can tell; give levels_v"
        )
    return plan


def strangers(bench: Bench, specimen: str, exciter: Exciter | None, source: str) -> tuple[str, ...]:
    """Return notes on models of another rig. An exciter may be moved to another structure, but only its user knows that."""
    notes = []
    if specimen not in ("", bench.specimen.name):
        notes.append(f"the model is of {specimen}, {source} of {bench.specimen.name}: not the same specimen")
    here = f"{bench.name}, {bench.specimen.name}"  # format in which the identification of an exciter writes its source
    if exciter is not None and exciter.source not in ("", here):
        notes.append(
            f"the exciter model is of {exciter.source}, {source} of {here}: right only if amplifier, exciter and "
            "stinger are the same"
        )
    return tuple(notes)


def _between_crossings(recording: Recording, number: int, which: str) -> HalfPeriods:
    bench = bench_of_recording(recording)
    column = next(index for index, channel in enumerate(bench.channels) if channel.role == "force")
    force = bridged(point_rows(recording, number))[:, column]
    return zero_crossings(force, sample_rate_hz=bench.sample_rate_hz, whole_periods=which == "periods")


def force_and_drive(sweep: Transient) -> Transient:
    """Return only the channels of a sweep that a comparison shows, force and drive."""
    rows = [row for row, channel in enumerate(sweep.channels) if channel.role in COMPARED]
    return replace(sweep, channels=tuple(sweep.channels[row] for row in rows), fundamentals=sweep.fundamentals[rows])
