"""Models whose steady vibrations are found by harmonic balance."""

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.experiments.simulators import Simulator, simulated
from identification.harmonic_balance.basis import Basis
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.drives import Drive
from identification.harmonic_balance.notes import edge_notes, harmonics_notes, held_notes, loss_notes
from identification.harmonic_balance.paths import (
    Followed,
    Resonances,
    followed,
    from_rest,
    polished,
    resonances,
    statically_stable,
)
from identification.harmonic_balance.setting_up import Held, band_around, drive_of, held_values, unknowns_near
from identification.harmonic_balance.states import HarmonicResponse, SteadyStates, motion_rows, steady_states
from identification.models.dynamic_model import DynamicModel, SteadyRequest
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive
from vibrolock.arrays import Float


class BalancedModel(DynamicModel):
    """A driven model with the equations of a harmonic balance."""

    driven: Simulator
    """The model."""

    @abstractmethod
    def samples_for(self, harmonics: int) -> int:
        """Return the default number of samples of a period."""

    @abstractmethod
    def equations(self, drive: Drive, basis: Basis, held: Float, request: SteadyRequest) -> DrivenBalance:
        """Return the equations; ``held``, float[n_inputs], are constant values of the other inputs."""

    @abstractmethod
    def resonance_hz(self, near_hz: float | None = None) -> float:
        """Frequency of the resonance of small vibrations that is nearest, or that moves most."""

    @abstractmethod
    def range_notes(self, points: SteadyStates) -> Sequence[str]:
        """Return notes on vibrations beyond the range of the training data."""

    @property
    @abstractmethod
    def highest_hz(self) -> float:
        """Frequency that a band must stay below, Hz."""

    def harmonics_below(self, harmonics: int, highest_hz: float) -> tuple[int, list[str]]:
        """Return how many harmonics of vibrations up to a frequency the model has, with a note if these are fewer."""
        return harmonics, []

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the motions, the drive point first."""
        outputs = self.driven.outputs
        return tuple(outputs[row].name for row in motion_rows(outputs))

    def default_held(self, exciter: Exciter | None) -> Held:
        """Return the fundamental, or a pure sine for a force that nothing gives harmonics."""
        force_driven = any(channel.role == "force" for channel in self.driven.inputs)
        return "pure-sine" if force_driven and exciter is None else "fundamental"

    def simulate(self, inputs: ArrayLike) -> Simulation:
        """Return the run from rest."""
        return self.driven.simulate(inputs)

    def simulate_experiment(self, experiment: Experiment, initial_state: Float | None = None) -> Simulation:
        """Return the run under the inputs of an experiment, which begins at rest or in the model's own way."""
        return begun_at_rest(self.driven, experiment, initial_state)

    def balance(self, request: SteadyRequest, highest_hz: float) -> tuple[DrivenBalance, list[str]]:
        """Return the equations for vibrations up to a frequency, with notes."""
        IdentificationError.unless_at_least("harmonics", request.harmonics, 1)
        harmonics, notes = self.harmonics_below(request.harmonics, highest_hz)
        least = 2 * harmonics + 1
        samples = self.samples_for(harmonics) if request.samples is None else request.samples
        if samples < least:
            raise IdentificationError(
                field="samples", value=samples, allowed=f"at least {least} for {harmonics} harmonics"
            )
        basis = Basis(harmonics, samples)
        row, held = held_values(self.driven, request.held_inputs)
        drive = drive_of(self.driven, request.level, request.held, request.exciter, basis.size, row)
        return self.equations(drive, basis, held, request), notes

    def frequency_response(
        self, request: SteadyRequest, band_hz: tuple[float | None, float | None]
    ) -> SteadyPrediction:
        """Return the fundamentals of `harmonic_response`."""
        return self.harmonic_response(request, band_hz).prediction

    def harmonic_response(self, request: SteadyRequest, band_hz: tuple[float | None, float | None]) -> HarmonicResponse:
        """Follow the response along the band, from below and, where that does not reach the far end, also from above."""
        low, high = band_around(self.resonance_hz, *band_hz, self.highest_hz)
        balance, more = self.balance(request, high)
        allowed = positive("largest_range_use", request.largest_range_use)
        IdentificationError.unless_at_least("points", request.points, 2)
        found: list[Followed] = []
        for begin, end in ((low, high), (high, low)):
            path = followed(balance, begin, end, points=request.points, largest_use=allowed)
            if path is None:
                more.append(
                    f"at {begin:.4g} Hz no vibration was found that can be reached from rest within the range allowed"
                )
                continue
            found.append(path)
            if not path.note:
                break
            more.append(path.note)
        if not found:
            raise IdentificationError(
                f"at {request.level:g} {('V' if request.held == 'voltage' else 'N')} the model has no periodic vibration at "
                f"{low:.4g} or {high:.4g} Hz that can be reached from rest within {allowed:g} times its range",
                field="force_n",
            )
        states = [each.states(balance, stability=request.stability) for each in found]
        folds = [each.folds(balance, stability=request.stability) for each in found]
        every = states[0] if len(states) == 1 else states[0].joined(states[1])
        held = held_notes(self.driven, request.held, request.exciter, request.held_inputs)
        notes = (*held, *harmonics_notes(every), *self.range_notes(every), *loss_notes(every))
        return HarmonicResponse(
            force_n=float(request.level),
            force=request.held,
            points=every,
            folds=folds[0] if len(folds) == 1 else folds[0].joined(folds[1]),
            branch=np.repeat(np.arange(len(states)), [each.count for each in states]),
            notes=(*notes, *edge_notes(every, low, high), *more),
            complete=not any(each.note for each in found),
        )

    def steady_state(self, request: SteadyRequest, frequency_hz: float, near: SteadyStates | None) -> SteadyStates:
        """Return the vibration that is reached from rest as the level rises, or that is ``near`` another."""
        at_hz = positive("frequency_hz", frequency_hz, "Hz")
        balance, _ = self.balance(request, at_hz)
        if near is None:
            z = from_rest(balance, at_hz, request.largest_range_use)
        else:
            z = polished(balance, unknowns_near(balance, near), at_hz)
        if z is None:
            raise IdentificationError(
                f"no periodic vibration was found at {at_hz:g} Hz and {request.level:g}", field="frequency_hz"
            )
        stable = np.array([statically_stable(balance, z, at_hz)])
        return steady_states(balance, z[None], np.array([at_hz]), stable, stability=request.stability)

    def backbone(self, request: SteadyRequest, near_hz: float | None) -> SteadyStates:
        """Follow phase resonance from 2 % of the level up to the level."""
        found = self.resonances(request, near_hz)
        if found.reason:
            reached = found.level[-1] * request.level
            raise IdentificationError(f"force_n: the backbone ends at {reached:.3g} N ({found.reason})")
        return found.states(stability=request.stability)

    def resonances(self, request: SteadyRequest, near_hz: float | None) -> Resonances:
        """Follow phase resonance as far as it goes, up to the level."""
        begin_hz = self.resonance_hz(None if near_hz is None else positive("near_hz", near_hz, "Hz"))
        balance, _ = self.balance(request, begin_hz)
        return resonances(balance, begin_hz, request.largest_range_use, request.points)


def begun_at_rest(model: Simulator, experiment: Experiment, initial_state: Float | None) -> Simulation:
    """Return the run of a model that has no initial state; raise `IdentificationError` if the experiment needs one."""
    if initial_state is not None or experiment.initial_state == "estimated":
        raise IdentificationError(
            f"experiment '{experiment.name}': does not begin at rest, as a {type(model).__name__} does"
        )
    return simulated(model, experiment)
