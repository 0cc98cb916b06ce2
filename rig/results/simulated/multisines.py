"""Recorded and planned multisines as a model simulates them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from identification import Exciter, Experiment, PeriodicSpectra, SimulatedRun, Simulation, simulated_run
from identification.experiments import Simulator
from identification.models import run_of
from rig.bench import Bench
from rig.campaigns.kinds import kinds_that_yield
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.plans import bench_of, load_plan
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import bench_of_recording
from rig.measurements.experiments import experiments
from rig.measurements.points_left_out import points_left_out
from rig.recording.reader import Recording
from rig.results.predictions.sweeps import strangers
from rig.results.simulated.data_files import fingerprint
from rig.results.simulated.driven_models import DrivenModel, all_inputs, check_rate, coupled, driving, with_constants
from rig.results.simulated.model import SimulatedModel
from rig.results.simulated.open_bands import OpenBands
from vibrolock.arrays import Float


def simulated_multisines(
    paths: Sequence[Path],
    identified: SimulatedModel,
    specimen: str,
    constants: Mapping[str, float],
    bands: OpenBands | None = None,
) -> tuple[tuple[SimulatedRun, ...], tuple[str, ...]]:
    """Simulate every realisation of recordings; return the runs with their use in the identification, and notes.

    ``specimen``: that of the model. ``constants``: inputs that are no channels of the recordings, with their values.
    ``bands``: what is said beyond the training data.
    Raises `RecordingError` for recordings that are no multisines.
    """
    model, uses = identified.model, identified.uses
    runs: list[SimulatedRun] = []
    notes: list[str] = []
    for path in paths:
        with Recording(path) as recording:
            if recording.kind not in kinds_that_yield(PeriodicSpectra):
                raise RecordingError(f"{path}: holds a {recording.kind}, expected a multisine recording")
            found = experiments(
                recording,
                inputs=[channel.name for channel in driving(model.inputs, constants)],
                outputs=[channel.name for channel in model.outputs],
                rate_hz=model.sample_rate_hz,
            )
            notes += strangers(bench_of_recording(recording), specimen, None, str(path))
            notes += points_left_out(recording)
        for one in found:
            whole = with_constants(one, model, constants)
            run = simulated_run(model, whole, use=uses.get(fingerprint(whole), "test" if uses else "unknown"))
            runs.append(run if bands is None else _recorded_with_bands(bands, model, run, whole))
        if not uses:
            notes.append("the model does not say what it was identified with: these may be its training data")
    return tuple(runs), tuple(notes)


def planned_multisines(
    source: str,
    model: DrivenModel,
    exciter: Exciter | None,
    constants: Mapping[str, float],
    bands: OpenBands | None = None,
) -> tuple[tuple[SimulatedRun, ...], tuple[str, ...]]:
    """Simulate every level and realisation of a planned multisine from its voltage, the last period of it after the transient.

    The ramps are left out: every run begins from rest. Returns the runs, whose errors are NaN, and notes. Raises
    `ConfigurationError` if the plan is no multisine, or its lines or period do not fit the rate of the model.
    """
    plan = load_plan(source)
    if not isinstance(plan, MultisinePlan):
        raise ConfigurationError(f"{source}: is a plan of kind {plan.kind}, expected a multisine")
    bench = bench_of(plan, source)
    samples = _period_samples(source, plan, model.sample_rate_hz)
    ahead = max(plan.transient_periods, 1)
    runs = []
    for target in plan.targets():
        index = target.realisation or 0
        period = target.level * _period(plan, bench, index, samples)
        voltage_v = np.tile(period, ahead + 1)
        simulate = partial(_simulated, exciter, voltage_v, constants, plan.lowest_hz)
        run = simulate(model)
        last = run.outputs[:, ahead * samples :]
        at = run.unbounded_at
        predicted = SimulatedRun(
            name=f"planned {target.level:.4g} V RMS, realisation {index + 1}",
            level=target.level,
            outputs=tuple(channel.name for channel in model.outputs),
            error=np.full(len(model.outputs), np.nan),
            range_use=run.range_use,
            unbounded_at_s=None if at is None else at / model.sample_rate_hz,
            use="planned",
            rms=np.sqrt(np.mean(last**2, axis=1)),
            peak=np.max(np.abs(last), axis=1),
        )
        if bands is not None:
            predicted = bands.of_run(predicted, last, partial(_last, simulate, ahead * samples), known=False)
        runs.append(predicted)
    return tuple(runs), strangers(bench, model.specimen, exciter, source)


def _recorded_with_bands(bands: OpenBands, model: Simulator, run: SimulatedRun, experiment: Experiment) -> SimulatedRun:
    def counted(one: Simulator) -> Float:
        return run_of(one, experiment).outputs[:, experiment.counted_from :]

    return bands.of_run(run, counted(model), counted, known=True) if bands.wanted(run.range_use, known=True) else run


def _simulated(
    exciter: Exciter | None, voltage_v: Float, constants: Mapping[str, float], lowest_hz: float, model: DrivenModel
) -> Simulation:
    if exciter is None:
        return model.simulate(all_inputs(model, voltage_v[None], constants))
    return coupled(model, exciter, voltage_v, lowest_hz)


def _last(simulate: Callable[[DrivenModel], Simulation], first: int, model: DrivenModel) -> Float:
    return simulate(model).outputs[:, first:]


def _period_samples(source: str, plan: MultisinePlan, rate_hz: float) -> int:
    check_rate(source, plan.highest_hz, rate_hz)
    samples = rate_hz / plan.resolution_hz
    if abs(samples - round(samples)) > 1e-6:
        raise ConfigurationError(
            f"{source}: resolution_hz = {plan.resolution_hz:g}: a period has {samples:.4f} samples at the model's "
            f"{rate_hz:g} Hz; allowed is a whole number"
        )
    return round(samples)


def _period(plan: MultisinePlan, bench: Bench, index: int, samples: int) -> Float:
    """One period of a realisation of RMS one, as the bench plays it, at another number of samples."""
    played = plan.design(bench.sample_rate_hz).realisation(plan.phase_seed, index)
    lines = np.fft.rfft(played / np.sqrt(np.mean(played**2)))
    return np.fft.irfft(lines[: samples // 2 + 1], samples) * (samples / played.size)
