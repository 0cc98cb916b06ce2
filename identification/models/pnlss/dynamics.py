"""Answers of a PNLSS model to what is asked of any dynamic model."""

import numpy as np
from numpy.typing import ArrayLike

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.drives import Drive
from identification.harmonic_balance.states import SteadyStates, largest_use, motion_rows
from identification.models.balanced_model import BalancedModel
from identification.models.dynamic_model import Limit, SteadyRequest
from identification.models.pnlss.balance import PnlssBalance, samples_for
from identification.models.pnlss.coupled import coupled_run
from identification.models.pnlss.errors import estimated_initial_state
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Complex, Float

_LIGHT = 0.3
"""Largest damping ratio at which a pole counts as a resonance. Chosen."""
_LOWEST, _GUESSED = 0.8, 0.5
"""Default lowest frequency of a run with an exciter: share of the lowest trained frequency, or of the linear resonance if that
is unknown. Chosen."""


class PnlssDynamics(BalancedModel):
    """A polynomial nonlinear state-space model."""

    kind = "PNLSS model"
    options = frozenset({"exciter", "held_inputs", "samples", "voltage_v", "band_hz", "stability"})

    def __init__(self, model: PnlssModel) -> None:
        self.driven = self.model = model

    @property
    def highest_hz(self) -> float:
        """Half the sample rate."""
        return 0.5 * self.model.sample_rate_hz

    def harmonics_below(self, harmonics: int, highest_hz: float) -> tuple[int, list[str]]:
        """Return the number of harmonics below half the sample rate, with a note if it is lower than requested."""
        rate_hz = self.model.sample_rate_hz
        possible = int(np.ceil(0.5 * rate_hz / highest_hz)) - 1
        if possible < 1:
            raise IdentificationError(
                f"{highest_hz:g} Hz is not below half the model's {rate_hz:g} Hz", field="frequency_hz"
            )
        if possible >= harmonics:
            return harmonics, []
        return possible, [f"{possible} harmonics, for which the model's {rate_hz:g} Hz has room at {highest_hz:.4g} Hz"]

    def samples_for(self, harmonics: int) -> int:
        """Return enough samples that harmonics do not alias."""
        return samples_for(self.model, harmonics)

    def equations(self, drive: Drive, basis: Basis, held: Float, request: SteadyRequest) -> PnlssBalance:
        """Return the balance of the map."""
        return PnlssBalance(self.model, drive, basis, held)

    def resonance_hz(self, near_hz: float | None = None) -> float:
        """Natural frequency of the lightly damped mode of the linear part that is nearest, or that moves the drive point most.

        If the excited band of the training data is known and contains such modes, only these are considered, because modes
        outside the band are uncertain. Raises `IdentificationError` if there is no lightly damped mode.
        """
        model = self.model
        poles = np.linalg.eigvals(model.a)
        s = np.log(poles[(poles.imag > 0.0) & (np.abs(poles) > 0.0)]) * model.sample_rate_hz
        s = s[-s.real <= _LIGHT * np.abs(s)]
        if not s.size:
            raise IdentificationError(
                "not given, and the model's linear part has no lightly damped mode to set it by", field="band_hz"
            )
        low, high = (2.0 * np.pi * f for f in model.excited_hz or (0.0, np.inf))
        inside = (np.abs(s) >= low) & (np.abs(s) <= high)
        s = s[inside] if inside.any() else s
        if near_hz is not None:
            natural_hz = np.abs(s) / (2.0 * np.pi)
            return float(natural_hz[np.argmin(np.abs(natural_hz - near_hz))])
        output = motion_rows(model.outputs)[0]
        order = MOTION_ORDER[model.outputs[output].motion]
        forces = [row for row, channel in enumerate(model.inputs) if channel.role == "force"] or slice(None)
        response = model.linear_part.response(np.exp(1j * s.imag / model.sample_rate_hz))[:, output, forces]
        size = np.linalg.norm(response, axis=1) / np.abs(s) ** order
        return float(np.abs(s[int(np.argmax(size))]) / (2.0 * np.pi))

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

    def simulate_experiment(self, experiment: Experiment, initial_state: Float | None = None) -> Simulation:
        """Return the run from rest, from ``initial_state``, or from the state that the experiment wants estimated."""
        if initial_state is None and experiment.initial_state == "estimated":
            initial_state = estimated_initial_state(self.model, experiment)
        return self.model.simulate(experiment.inputs, initial_state=initial_state)

    def coupled_run(self, exciter: Exciter, voltage_v: ArrayLike, lowest_hz: float | None) -> Simulation:
        """Return the run with the exciter, whose reaction is exact above the lowest frequency of the training by default."""

        def default_hz() -> float:
            band = self.model.excited_hz
            return _LOWEST * band[0] if band and band[0] > 0.0 else _GUESSED * self.resonance_hz()

        return coupled_run(self.model, exciter, voltage_v, lowest_hz, default_hz)
