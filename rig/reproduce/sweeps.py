"""Sweeps that the selected models simulate from what was measured, beside the recorded ones."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification import Experiment, PnlssModel
from rig.campaigns.plans import load_plan
from rig.campaigns.sweep import SweepPlan
from rig.reproduce.options import Options
from rig.reproduce.recordings import recorded, training_data

__all__ = ["SweepResult", "simulated_sweeps"]

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
    unbounded_s: float
    """When the simulation left all bounds; NaN if it did not."""

    def row(self) -> dict[str, Any]:
        """Numbers for tables and JSON."""
        bounded = bool(np.isnan(self.unbounded_s))
        top, here = int(np.argmax(self.measured)), int(np.argmax(self.simulated)) if bounded else 0
        return {
            "sweep": self.sweep,
            "training_set": self.training_set,
            "model": self.model,
            "bounded": bounded,
            "unbounded_s": None if bounded else self.unbounded_s,
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
    """Every sweep of the specimen by every selected model, from the measured force or from the voltage."""
    found = []
    for sweep in options.specimen.sweeps:
        plan = load_plan(f"{options.specimen.name}/{sweep}")
        assert isinstance(plan, SweepPlan)
        (experiment,) = training_data(options, recorded(options, sweep, say))
        for training_set, (name, model) in models.items():
            found.append(_simulated(sweep, plan, training_set, name, model, experiment))
    return found


def _simulated(
    sweep: str, plan: SweepPlan, training_set: str, name: str, model: PnlssModel, experiment: Experiment
) -> SweepResult:
    drive = next(i for i, channel in enumerate(experiment.output_channels) if channel.role == "drive")
    run = model.simulate(experiment.inputs)
    there = experiment.counted_outputs[drive]
    here = run.outputs[drive, experiment.counted_from :]
    at = None if run.unbounded_at is None else (run.unbounded_at - experiment.counted_from) / experiment.sample_rate_hz
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
        seconds=seconds,
        frequency_hz=plan.start_hz + (plan.stop_hz - plan.start_hz) * share,
        measured=_largest(there, width),
        simulated=_largest(here, width),
        rms_error=float(np.linalg.norm(here - there) / np.linalg.norm(there)) if run.bounded else float("inf"),
        range_use=run.range_use,
        unbounded_s=float("nan") if at is None else at,
    )


def _largest(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Largest magnitude in bins of so many values."""
    return np.asarray(np.abs(values[: values.size // width * width]).reshape(-1, width).max(axis=1))
