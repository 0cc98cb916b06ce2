"""A nonlinear state-space model in a sweep, alone or with the exciter that drives it: simulated, then demodulated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification import (
    Channel,
    Exciter,
    IdentificationError,
    PnlssModel,
    Simulation,
    SweepPrediction,
    Transient,
    demodulate,
    pnlss_coupled_run,
)
from identification.channels import MOTION_ORDER, find_role
from rig.campaigns.evaluation.vibrations import VOLTAGE

__all__ = ["PnlssSweepModels", "SweepGiven"]

Float = NDArray[np.float64]

_SHOWN = 10.0
"""Of an unbounded run is shown what is below this many times the largest recorded amplitude, or that of training."""
_SHORT_PERIODS = 20
"""Periods at the first frequency below which a run that ended has nothing to be seen."""
_LOWEST = 0.8
"""Of the lowest frequency of a sweep: from there on the exciter's reaction is exact."""


@dataclass(frozen=True, eq=False)
class SweepGiven:
    """What a model is driven with: rows of its inputs, or one of voltage, and the phase at the samples from ``first`` on."""

    inputs: Float
    first: int
    theta: Float
    frequencies_hz: tuple[float, float]
    """First and last frequency."""
    largest: float
    """Largest output at the drive point that is worth showing."""
    initial_state: Float | None
    origin: str


@dataclass(frozen=True, eq=False)
class PnlssSweepModels:
    """What sweeps are simulated with."""

    model: PnlssModel
    """The model."""
    exciter: Exciter | None
    """What drives a force-driven model from the voltage; without it the recorded force does."""

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """What drives."""
        return self.model.inputs if self.exciter is None else (VOLTAGE,)

    def predict(self, given: SweepGiven) -> SweepPrediction:
        """The simulated sweep as fundamentals; of an unbounded one what came before."""
        model, first, rate_hz = self.model, given.first, self.model.sample_rate_hz
        force, force_channel, run, notes = self._simulated(given)
        row = find_role(model.outputs, "drive")
        signals = np.vstack([force, run.outputs[row]])[:, first:]
        stop = signals.shape[1]
        unbounded_at_s = None if run.unbounded_at is None else max(run.unbounded_at - first, 0) / rate_hz
        if unbounded_at_s is not None:
            beyond = np.flatnonzero(~(np.abs(signals[1]) <= _SHOWN * given.largest))
            stop = int(beyond[0]) if beyond.size else stop
            notes.append(f"the run left all bounds {unbounded_at_s:.2f} s into the sweep: no errors are given")
        elif run.range_use > 1.0:
            notes.append(f"states or input reach {run.range_use:.2f} times the training data: extrapolated")
        notes += self._outside(given)
        found = _fundamentals(
            given.theta[:stop], signals[:, :stop], (force_channel, model.outputs[row]), rate_hz, given.frequencies_hz[0]
        )
        s = 2j * np.pi * found.frequency_hz
        drive_m = found.fundamentals[1] / s ** MOTION_ORDER[model.outputs[row].motion]
        return SweepPrediction(
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

    def _simulated(self, given: SweepGiven) -> tuple[Float, Channel, Simulation, list[str]]:
        """The force at the drive point, imposed or predicted, its channel, the run, and notes."""
        model = self.model
        channels = {channel.role: (row, channel) for row, channel in enumerate(model.outputs)}
        if self.exciter is not None:
            channel = next(channel for channel in model.inputs if channel.role == "force")
            lowest = min(
                _LOWEST * min(given.frequencies_hz), *([_LOWEST * model.excited_hz[0]] if model.excited_hz else [])
            )
            coupled = pnlss_coupled_run(model, self.exciter, given.inputs[0], lowest_hz=lowest)
            source = self.exciter.source
            return coupled.force_n, channel, coupled, [f"holds for the exciter of {source} alone", *coupled.notes]
        run = model.simulate(given.inputs, initial_state=given.initial_state)
        for channel, imposed in zip(model.inputs, given.inputs, strict=True):
            if channel.role == "force":
                return imposed, channel, run, []
        row, channel = channels["force"]
        return run.outputs[row], channel, run, []

    def _outside(self, given: SweepGiven) -> list[str]:
        """Frequencies that the model was never shown."""
        band = self.model.excited_hz
        if not band or (band[0] * 0.999 <= min(given.frequencies_hz) and max(given.frequencies_hz) <= band[1] * 1.001):
            return []
        low, high = sorted(given.frequencies_hz)
        return [f"sweeps from {low:g} to {high:g} Hz, the model was trained from {band[0]:g} to {band[1]:g} Hz"]


def _fundamentals(
    theta: Float, signals: Float, channels: tuple[Channel, Channel], rate_hz: float, first_hz: float
) -> Transient:
    """Demodulated as a recording is; a single instant at rest where a run ended before there was a period to see."""
    try:
        return demodulate(theta, signals, channels, sample_rate_hz=rate_hz)
    except IdentificationError:
        if theta.size >= _SHORT_PERIODS * rate_hz / first_hz:
            raise
        nothing = np.zeros((2, 1), dtype=np.complex128)
        return Transient(channels, np.zeros(1), np.array([first_hz]), nothing, 1)
