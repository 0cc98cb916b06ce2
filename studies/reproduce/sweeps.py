"""Sweeps simulated by the selected models from measured force or voltage, compared with the recorded ones."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification import Exciter, Experiment, Simulation, coupled_run
from identification.common import find_role
from rig.campaigns.plans import load_plan
from rig.campaigns.sweep.plan import SweepPlan
from rig.results.simulated.driven_models import DrivenModel
from studies.reproduce.options import Options
from studies.reproduce.recordings import exciter_of, recorded, training_data

COUPLED = "voltage, exciter coupled"
_LOWEST = 0.8
"""Part of the lowest frequency of a sweep above which the exciter's reaction is exact."""

_BINS = 400


@dataclass(frozen=True, eq=False)
class SweepResult:
    """One recorded sweep as simulated by one model."""

    sweep: str
    """Name of the sweep's plan."""
    training_set: str
    """Training set of the model."""
    model: str
    """Name of the model."""
    given: str
    """Excitation of the simulation: the measured ``force`` or ``voltage``, or the voltage with the exciter coupled."""
    seconds: NDArray[np.float64]
    """Centres of the bins [n] in which envelopes are taken, from the beginning of the sweep, s."""
    frequency_hz: NDArray[np.float64]
    """Frequency of the plan at these times [n], Hz."""
    measured: NDArray[np.float64]
    """Largest recorded magnitude of the drive channel in each bin [n]."""
    simulated: NDArray[np.float64]
    """Largest simulated magnitude of the drive channel in each bin [n]; NaN after the simulation became unbounded."""
    rms_error: float
    """Relative RMS error over the sweep; inf if unbounded."""
    range_use: float
    """Largest state or input over the largest in the training data."""
    unbounded_at_s: float | None
    """Time at which the simulation became unbounded, 0 if before the sweep began; None if it stayed bounded."""

    def row(self) -> dict[str, Any]:
        """Return the numbers for tables and JSON."""
        bounded = self.unbounded_at_s is None
        top, here = int(np.argmax(self.measured)), int(np.argmax(self.simulated)) if bounded else 0
        return {
            "sweep": self.sweep,
            "training_set": self.training_set,
            "model": self.model,
            "from": self.given,
            "unbounded": not bounded,
            "unbounded_at_s": None if bounded else self.unbounded_at_s,
            "peak_measured": float(self.measured[top]),
            "peak_measured_hz": float(self.frequency_hz[top]),
            "peak_error": float(self.simulated[here] / self.measured[top]) - 1.0 if bounded else None,
            "peak_hz": float(self.frequency_hz[here]) if bounded else None,
            "rms_error": self.rms_error if bounded else None,
            "range_use": self.range_use if bounded else None,
        }


def simulated_sweeps(
    options: Options, models: Mapping[str, tuple[str, DrivenModel]], say: Callable[[str], None]
) -> list[SweepResult]:
    """Simulate every sweep of the specimen with every selected model, from the measured input of the model.

    Models with the force as input are also simulated from the voltage, with the exciter coupled.
    """
    found = []
    exciter = exciter_of(options, say) if options.input == "force" else None
    for sweep in options.specimen.sweeps:
        plan = load_plan(f"{options.specimen.name}/{sweep}")
        assert isinstance(plan, SweepPlan)
        (experiment,) = training_data(options, recorded(options, sweep, say))
        if exciter is not None:
            (driven,) = training_data(options, recorded(options, sweep, say), given="voltage")
        for training_set, (name, model) in models.items():
            found.append(_simulated(sweep, plan, training_set, name, model, experiment))
            if exciter is not None:
                found.append(_simulated(sweep, plan, training_set, name, model, driven, exciter))
    return found


def _simulated(
    sweep: str,
    plan: SweepPlan,
    training_set: str,
    name: str,
    model: DrivenModel,
    experiment: Experiment,
    exciter: Exciter | None = None,
) -> SweepResult:
    run: Simulation
    if exciter is None:
        run = model.simulate(experiment.inputs)
    else:
        lowest_hz = _LOWEST * min(plan.start_hz, plan.stop_hz)
        run = coupled_run(model, exciter, experiment.inputs[0], lowest_hz=lowest_hz)
    there = experiment.counted_outputs[find_role(experiment.output_channels, "drive")]
    here = run.outputs[find_role(model.outputs, "drive"), experiment.counted_from :]
    rate_hz, lost = experiment.sample_rate_hz, run.unbounded_at
    at = None if lost is None else max(lost - experiment.counted_from, 0) / rate_hz
    least = int(np.ceil(rate_hz / min(plan.start_hz, plan.stop_hz)))  # an envelope needs at least one period
    width = max(least, there.size // _BINS)
    seconds = (np.arange(there.size // width) + 0.5) * width / rate_hz
    swept = max(0.0, experiment.counted / rate_hz - plan.sweep_s)
    share = np.clip((seconds - swept) / plan.sweep_s, 0.0, 1.0)
    return SweepResult(
        sweep=sweep,
        training_set=training_set,
        model=name,
        given=experiment.input_channels[0].name if exciter is None else COUPLED,
        seconds=seconds,
        frequency_hz=plan.start_hz + (plan.stop_hz - plan.start_hz) * share,
        measured=_largest(there, width),
        simulated=_largest(here, width),
        rms_error=float(np.linalg.norm(here - there) / np.linalg.norm(there)) if at is None else float("inf"),
        range_use=run.range_use,
        unbounded_at_s=at,
    )


def _largest(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Return the largest magnitude in bins of ``width`` values."""
    return np.asarray(np.abs(values[: values.size // width * width]).reshape(-1, width).max(axis=1))
