"""Answers of a PNLSS model to what is asked of any dynamic model."""

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.states import SteadyStates, largest_use, motion_rows
from identification.models.balanced_model import BalancedModel
from identification.models.dynamic_model import Limit, SteadyRequest
from identification.models.pnlss.coupled.run import CoupledRun, pnlss_coupled_run
from identification.models.pnlss.errors import estimated_initial_state
from identification.models.pnlss.model import PnlssModel
from identification.models.pnlss.steady.setting_up import balance_of, harmonics_that_fit, linear_resonance_hz
from vibrolock.arrays import Complex, Float


class PnlssDynamics(BalancedModel):
    """A polynomial nonlinear state-space model."""

    kind = "PNLSS model"
    options = frozenset({"exciter", "held_inputs", "samples", "voltage_v", "band_hz"})

    def __init__(self, model: PnlssModel) -> None:
        self.driven = self.model = model

    @property
    def highest_hz(self) -> float:
        """Half the sample rate."""
        return 0.5 * self.model.sample_rate_hz

    def balance(self, request: SteadyRequest, highest_hz: float) -> tuple[DrivenBalance, list[str]]:
        """Return the balance of the map, with as many harmonics as lie below half the sample rate."""
        count, notes = harmonics_that_fit(self.model, request.harmonics, highest_hz)
        given = request.level, request.held, request.exciter, request.held_inputs
        return balance_of(self.model, *given, count, request.samples), notes

    def resonance_hz(self, near_hz: float | None = None) -> float:
        """Return the resonance of the linear part."""
        return linear_resonance_hz(self.model, near_hz)

    def range_notes(self, points: SteadyStates) -> list[str]:
        """Return notes on states and inputs beyond those of the training data."""
        notes = []
        for name, use in (("states", points.state_use), ("input", points.input_use)):
            largest = float(np.max(largest_use(use), initial=0.0))
            if np.isnan(largest):
                notes.append(f"the range of the {name} in the training data is unknown")
            elif largest > 1.0:
                reach = "reach" if name == "states" else "reaches"
                notes.append(f"the {name} {reach} {largest:.2f} times the training data: extrapolated")
        return notes

    def linear_response(self, frequency_hz: Float) -> Complex:
        """Return the response of the linear part to the force."""
        model, rows = self.model, motion_rows(self.model.outputs)
        forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"]
        if len(forces) != 1:
            raise IdentificationError(f"model: has {len(forces)} forces among its inputs, needs one")
        s = 2j * np.pi * np.asarray(frequency_hz)
        order = np.array([MOTION_ORDER[model.outputs[row].motion] for row in rows])
        response = model.linear_part.response(np.exp(s / model.sample_rate_hz))[:, rows, forces[0]]
        return np.asarray(response / s[:, None] ** order)

    def validity(self) -> tuple[Limit, ...]:
        """Return the ranges of states and inputs."""
        states = (Limit(f"state {k + 1}", float(x), "1") for k, x in enumerate(self.model.state_range))
        inputs = zip(self.model.inputs, self.model.input_range.tolist(), strict=True)
        return (*states, *(Limit(channel.name, x, channel.unit) for channel, x in inputs))

    def simulate(self, inputs: ArrayLike) -> Simulation:
        """Return the run from rest."""
        return self.model.simulate(inputs)

    def simulate_experiment(self, experiment: Experiment, initial_state: Float | None = None) -> Simulation:
        """Return the run from rest, from ``initial_state``, or from the state that the experiment wants estimated."""
        if initial_state is None and experiment.initial_state == "estimated":
            initial_state = estimated_initial_state(self.model, experiment)
        return self.model.simulate(experiment.inputs, initial_state=initial_state)

    def coupled_run(self, exciter: Exciter, voltage_v: ArrayLike, lowest_hz: float | None) -> CoupledRun:
        """Return the run with the exciter."""
        return pnlss_coupled_run(self.model, exciter, voltage_v, lowest_hz=lowest_hz)
