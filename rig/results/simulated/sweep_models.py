"""Sweeps of a PNLSS or structured model, alone or with its exciter: simulated, then demodulated."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from identification import (
    Channel,
    Exciter,
    IdentificationError,
    PnlssModel,
    Simulation,
    StructuredModel,
    SweepPrediction,
    Transient,
    demodulate,
)
from identification.common import MOTION_ORDER, find_role
from rig.campaigns.evaluation.vibrations import VOLTAGE
from rig.results.simulated.driven_models import DrivenModel, all_inputs, coupled, driving
from rig.results.simulated.open_bands import OpenBands
from vibrolock.arrays import Float

_SHOWN = 10.0
"""An unbounded run is shown while it is below this many times the largest recorded amplitude, or the largest in training."""
_SHORT_PERIODS = 20
"""A run that became unbounded within fewer periods of the first frequency is too short to show anything."""


@dataclass(frozen=True, eq=False)
class SweepGiven:
    """Excitation of a model: rows of its inputs, or one row of voltage, and the phase at the samples from ``first`` on."""

    inputs: Float
    first: int
    theta: Float
    frequencies_hz: tuple[float, float]
    """First and last frequency, Hz."""
    largest: float
    """Largest output at the drive point that is worth showing."""
    initial_state: Float | None
    origin: str
    is_recorded: bool
    """Whether the sweep was made, so that its errors are known."""


@dataclass(frozen=True, eq=False)
class SimulatedSweepModels:
    """Models with which sweeps are simulated."""

    model: DrivenModel
    exciter: Exciter | None
    """Exciter that drives a force-driven model from the voltage; without it, the recorded force drives the model."""
    constants: Mapping[str, float] = field(default_factory=dict)
    """Values of the inputs that are constant, by name."""
    bands: OpenBands | None = None
    """What is said beyond the training data; None for nothing."""

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Channels that drive the simulation."""
        return driving(self.model.inputs, self.constants) if self.exciter is None else (VOLTAGE,)

    def predict(self, given: SweepGiven) -> SweepPrediction:
        """Return the fundamentals of the simulated sweep; of an unbounded run, only those before it diverged."""
        model, first, rate_hz = self.model, given.first, self.model.sample_rate_hz
        force, force_channel, run, notes = self._simulated(given)
        row = find_role(model.outputs, "drive")
        signals = np.vstack([force, run.outputs[row]])[:, first:]
        stop = signals.shape[1]
        unbounded_at_s = None if run.unbounded_at is None else max(run.unbounded_at - first, 0) / rate_hz
        if unbounded_at_s is not None:
            beyond = np.flatnonzero(~(np.abs(signals[1]) <= _SHOWN * given.largest))
            stop = int(beyond[0]) if beyond.size else stop
            notes.append(f"the run diverged {unbounded_at_s:.2f} s into the sweep: no errors are given")
        elif run.range_use > 1.0:
            what = "states or input" if isinstance(model, PnlssModel) else "elements"
            notes.append(f"{what} reach {run.range_use:.2f} times the training data: extrapolated")
        notes += self._outside(given)
        found = _fundamentals(
            given.theta[:stop], signals[:, :stop], (force_channel, model.outputs[row]), rate_hz, given.frequencies_hz[0]
        )
        s = 2j * np.pi * found.frequency_hz
        drive_m = found.fundamentals[1] / s ** MOTION_ORDER[model.outputs[row].motion]
        predicted = SweepPrediction(
            time_s=found.time_s,
            frequency_hz=found.frequency_hz,
            modal_amplitude=np.full(found.time_s.size, complex(np.nan)),
            drive_m=drive_m,
            drive_m_s=s * drive_m,
            drive_m_s2=s**2 * drive_m,
            force=found.fundamentals[0],
            largest_identified=float("nan"),
            window_periods=found.window_periods,
            origin=given.origin,
            notes=tuple(notes),
            simulated_range_use=run.range_use,
            unbounded_at_s=unbounded_at_s,
        )
        if self.bands is None:
            return predicted
        shape = (
            float(np.max(np.abs(model.linearised().output_shapes[row]))) if isinstance(model, StructuredModel) else 0.0
        )
        return self.bands.of_sweep(
            predicted,
            shape,
            lambda other: replace(self, model=other, bands=None).predict(given).peak(),
            given.is_recorded,
        )

    def _simulated(self, given: SweepGiven) -> tuple[Float, Channel, Simulation, list[str]]:
        """Return the force at the drive point (imposed or predicted), its channel, the run, and notes."""
        model = self.model
        channels = {channel.role: (row, channel) for row, channel in enumerate(model.outputs)}
        if self.exciter is not None:
            channel = next(channel for channel in model.inputs if channel.role == "force")
            found = coupled(model, self.exciter, given.inputs[0], min(given.frequencies_hz))
            source = self.exciter.source
            return found.force_n, channel, found, [f"holds for the exciter of {source} alone", *found.notes]
        run: Simulation
        inputs = all_inputs(model, given.inputs, self.constants)
        if isinstance(model, PnlssModel):
            run = model.simulate(inputs, initial_state=given.initial_state)
        else:
            run = model.simulate(inputs)
        for channel, imposed in zip(model.inputs, inputs, strict=True):
            if channel.role == "force":
                return imposed, channel, run, []
        row, channel = channels["force"]
        return run.outputs[row], channel, run, []

    def _outside(self, given: SweepGiven) -> list[str]:
        band = self.model.excited_hz if isinstance(self.model, PnlssModel) else None
        if not band or (band[0] * 0.999 <= min(given.frequencies_hz) and max(given.frequencies_hz) <= band[1] * 1.001):
            return []
        low, high = sorted(given.frequencies_hz)
        return [f"sweeps from {low:g} to {high:g} Hz, the model was trained from {band[0]:g} to {band[1]:g} Hz"]


def _fundamentals(
    theta: Float, signals: Float, channels: tuple[Channel, Channel], rate_hz: float, first_hz: float
) -> Transient:
    """Demodulate like a recording; return a single instant at rest if the run ended before the first usable period."""
    try:
        return demodulate(theta, signals, channels, sample_rate_hz=rate_hz)
    except IdentificationError:
        if theta.size >= _SHORT_PERIODS * rate_hz / first_hz:
            raise
        nothing = np.zeros((2, 1), dtype=np.complex128)
        return Transient(channels, np.zeros(1), np.array([first_hz]), nothing, 1)
