"""Sweeps that the selected models simulate from force or voltage as measured, beside the recorded ones."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification import Exciter, Experiment, PnlssModel, pnlss_coupled_run
from identification.channels import find_role
from rig.campaigns.plans import load_plan
from rig.campaigns.sweep.plan import SweepPlan
from rig.reproduce.exciter import exciter_of
from rig.reproduce.options import Options
from rig.reproduce.recordings import recorded, training_data

__all__ = ["COUPLED", "SweepResult", "simulated_sweeps"]

COUPLED = "voltage, exciter coupled"
_LOWEST = 0.8
"""Of the lowest frequency of a sweep: from there on the exciter's reaction is exact."""

_BINS = 400


@dataclass(frozen=True, eq=False)
class SweepResult:
    """One recorded sweep as one model simulates it."""

    sweep: str
    """Name of its plan."""
    training_set: str
    """Of the model."""
    model: str
    """Its name."""
    given: str
    """What it is simulated from: the measured ``force`` or ``voltage``, or the voltage with the exciter coupled."""
    seconds: NDArray[np.float64]
    """Middles of the bins [n] in which envelopes are taken, from the beginning of the sweep."""
    frequency_hz: NDArray[np.float64]
    """Frequency that the plan has there [n]."""
    measured: NDArray[np.float64]
    """Largest magnitude of the drive channel in each bin [n]."""
    simulated: NDArray[np.float64]
    """The same of the simulation [n]; NaN from where it is unbounded."""
    rms_error: float
    """Relative RMS error over the sweep; inf if unbounded."""
    range_use: float
    """Largest state or input over the largest in the training data."""
    unbounded_at_s: float | None
    """When the simulation left all bounds, 0 if before the sweep began; None if it did not."""

    def row(self) -> dict[str, Any]:
        """Numbers for tables and JSON."""
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
    options: Options, models: Mapping[str, tuple[str, PnlssModel]], say: Callable[[str], None]
) -> list[SweepResult]:
    """Every sweep of the specimen by every selected model, from what goes into it; force-input models from the voltage too."""
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
    model: PnlssModel,
    experiment: Experiment,
    exciter: Exciter | None = None,
) -> SweepResult:
    if exciter is None:
        run = model.simulate(experiment.inputs)
    else:
        lowest_hz = _LOWEST * min(plan.start_hz, plan.stop_hz)
        run = pnlss_coupled_run(model, exciter, experiment.inputs[0], lowest_hz=lowest_hz)
    there = experiment.counted_outputs[find_role(experiment.output_channels, "drive")]
    here = run.outputs[find_role(model.outputs, "drive"), experiment.counted_from :]
    at = (
        None
        if run.unbounded_at is None
        else max(run.unbounded_at - experiment.counted_from, 0) / experiment.sample_rate_hz
    )
    least = int(
        np.ceil(experiment.sample_rate_hz / min(plan.start_hz, plan.stop_hz))
    )  # a period, or an envelope is none
    width = max(least, there.size // _BINS)
    seconds = (np.arange(there.size // width) + 0.5) * width / experiment.sample_rate_hz
    swept = max(0.0, experiment.counted / experiment.sample_rate_hz - plan.duration_s)
    share = np.clip((seconds - swept) / plan.duration_s, 0.0, 1.0)
    return SweepResult(
        sweep=sweep,
        training_set=training_set,
        model=name,
        given=experiment.input_channels[0].name if exciter is None else COUPLED,
        seconds=seconds,
        frequency_hz=plan.start_hz + (plan.stop_hz - plan.start_hz) * share,
        measured=_largest(there, width),
        simulated=_largest(here, width),
        rms_error=float(np.linalg.norm(here - there) / np.linalg.norm(there)) if run.bounded else float("inf"),
        range_use=run.range_use,
        unbounded_at_s=at,
    )


def _largest(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Largest magnitude in bins of so many values."""
    return np.asarray(np.abs(values[: values.size // width * width]).reshape(-1, width).max(axis=1))
