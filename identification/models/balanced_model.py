"""Models whose steady vibrations are found by harmonic balance."""

from abc import abstractmethod
from collections.abc import Sequence

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.simulators import Driven
from identification.harmonic_balance.assembly import response_of, steady_state_of
from identification.harmonic_balance.backbone import Resonances, resonances
from identification.harmonic_balance.driven import DrivenBalance
from identification.harmonic_balance.notes import harmonics_notes, held_notes, loss_notes
from identification.harmonic_balance.setting_up import Held, band_around
from identification.harmonic_balance.states import HarmonicResponse, SteadyStates, motion_rows
from identification.models.dynamic_model import DynamicModel, SteadyRequest
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive


class BalancedModel(DynamicModel):
    """A driven model with the equations of a harmonic balance."""

    driven: Driven
    """The model: its inputs and outputs."""

    @abstractmethod
    def balance(self, request: SteadyRequest, highest_hz: float) -> tuple[DrivenBalance, list[str]]:
        """Return the equations for vibrations up to a frequency, with notes."""

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

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the motions, the drive point first."""
        outputs = self.driven.outputs
        return tuple(outputs[row].name for row in motion_rows(outputs))

    def default_held(self, exciter: Exciter | None) -> Held:
        """Return the fundamental, or a pure sine for a force that nothing gives harmonics."""
        force_driven = any(channel.role == "force" for channel in self.driven.inputs)
        return "pure-sine" if force_driven and exciter is None else "fundamental"

    def frequency_response(
        self, request: SteadyRequest, band_hz: tuple[float | None, float | None]
    ) -> SteadyPrediction:
        """Return the fundamentals of `harmonic_response`."""
        return self.harmonic_response(request, band_hz).prediction

    def harmonic_response(self, request: SteadyRequest, band_hz: tuple[float | None, float | None]) -> HarmonicResponse:
        """Follow the response along the band, from below and, where that does not reach the far end, also from above."""
        low, high = band_around(self.resonance_hz, *band_hz, self.highest_hz)
        balance, more = self.balance(request, high)
        return response_of(
            balance,
            request.level,
            request.held,
            (low, high),
            points=request.points,
            largest_range_use=request.largest_range_use,
            notes=lambda every: self._notes(request, every),
            more=more,
        )

    def steady_state(self, request: SteadyRequest, frequency_hz: float, near: SteadyStates | None) -> SteadyStates:
        """Return the vibration that is reached from rest as the level rises, or that is ``near`` another."""
        at_hz = positive("frequency_hz", frequency_hz, "Hz")
        balance, _ = self.balance(request, at_hz)
        return steady_state_of(balance, at_hz, request.level, near, request.largest_range_use)

    def backbone(self, request: SteadyRequest, near_hz: float | None) -> SteadyStates:
        """Follow phase resonance from 2 % of the level up to the level."""
        found = self.resonances(request, near_hz)
        if found.reason:
            reached = found.level[-1] * request.level
            raise IdentificationError(f"force_n: the backbone ends at {reached:.3g} N ({found.reason})")
        return found.states()

    def resonances(self, request: SteadyRequest, near_hz: float | None) -> Resonances:
        """Follow phase resonance as far as it goes, up to the level."""
        begin_hz = self.resonance_hz(None if near_hz is None else positive("near_hz", near_hz, "Hz"))
        balance, _ = self.balance(request, begin_hz)
        return resonances(balance, begin_hz, request.largest_range_use, request.points)

    def _notes(self, request: SteadyRequest, points: SteadyStates) -> tuple[str, ...]:
        held = held_notes(self.driven, request.held, request.exciter, request.held_inputs)
        return (*held, *harmonics_notes(points), *self.range_notes(points), *loss_notes(points))
