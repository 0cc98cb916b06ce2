"""What a dynamic model of any kind answers, and what is asked of it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.experiment import Experiment
from identification.experiments.simulation import Simulation
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.states import HarmonicResponse, SteadyStates
from identification.linear.modes import LinearModes
from identification.prediction.steady_prediction import ResponseBand, SteadyPrediction
from vibrolock.arrays import Complex, Float
from vibrolock.on_use import Registry

HARMONICS = 7
"""Default number of harmonics. Chosen: a hardening beam's response changes by less than 1e-3 with more."""
POINTS = 1000
"""Default for the largest number of points on a branch. Chosen: a resonance with two folds takes some 200."""
LARGEST_RANGE_USE = 2.0
"""Default for the largest use of a model's validity range (decision 24)."""


class Limit(NamedTuple):
    """Largest magnitude of one quantity in the data of an identification; NaN if unknown."""

    quantity: str
    largest: float
    unit: str


@dataclass(frozen=True, eq=False, kw_only=True)
class SteadyRequest:
    """A steady vibration under a constant excitation, as `identification.frequency_response` describes its parameters.

    ``level`` is in newtons, or in volts if ``held`` is ``voltage``. ``stability``: whether a harmonic balance finds the
    multipliers of each vibration, which takes half of the time; otherwise they are NaN, and only folds count as unstable.
    """

    level: float
    held: Held
    exciter: Exciter | None = None
    held_inputs: Mapping[str, float] | None = None
    support: bool | None = None
    linear_modes: LinearModes | None = None
    residuals: bool = True
    lowest_share: float = 0.05
    harmonics: int = HARMONICS
    samples: int | None = None
    points: int = POINTS
    largest_range_use: float = LARGEST_RANGE_USE
    stability: bool = True


class DynamicModel(ABC):
    """One dynamic model, of whatever kind, as predictions see it.

    A kind need not answer everything: what it cannot answer raises `IdentificationError`.
    """

    kind: ClassVar[str]
    """What the kind is called in messages."""
    options: ClassVar[frozenset[str]]
    """Options of a steady vibration that the kind has, beside those that all have."""
    band_points: ClassVar[int] = POINTS
    """Largest number of points on a branch of each draw of a band."""

    @property
    @abstractmethod
    def channels(self) -> tuple[str, ...]:
        """Names of the motions that are predicted, the drive point first."""

    @abstractmethod
    def linear_response(self, frequency_hz: Float) -> Complex:
        """complex[n, n_channels]: displacement per force, m/N, of small vibrations."""

    @abstractmethod
    def validity(self) -> tuple[Limit, ...]:
        """Largest magnitudes in the data of the identification; a prediction's ``range_use`` is relative to them."""

    @abstractmethod
    def default_held(self, exciter: Exciter | None) -> Held:
        """Quantity of the force that is constant if nothing else is requested."""

    @abstractmethod
    def frequency_response(
        self, request: SteadyRequest, band_hz: tuple[float | None, float | None]
    ) -> SteadyPrediction:
        """Return the response at a constant excitation, on all branches."""

    @abstractmethod
    def steady_state(self, request: SteadyRequest, frequency_hz: float, near: SteadyStates | None) -> SteadyStates:
        """Return one vibration at a frequency."""

    @abstractmethod
    def backbone(self, request: SteadyRequest, near_hz: float | None) -> SteadyStates:
        """Return vibrations at phase resonance up to the level of the request."""

    def harmonic_response(self, request: SteadyRequest, band_hz: tuple[float | None, float | None]) -> HarmonicResponse:
        """Return the response with all harmonics."""
        raise self.cannot("predict harmonics", "frequency_response gives the fundamentals")

    def simulate(self, inputs: ArrayLike) -> Simulation:
        """Return the run from rest under ``inputs``, float[n_inputs, n]."""
        raise self.cannot("be simulated over time", "predict_sweep predicts its response to a sweep")

    def simulate_experiment(self, experiment: Experiment, initial_state: Float | None = None) -> Simulation:
        """Return the run under the inputs of an experiment, begun as the experiment and the model require."""
        raise self.cannot("be simulated over time", "predict_sweep predicts its response to a sweep")

    def coupled_run(self, exciter: Exciter, voltage_v: ArrayLike, lowest_hz: float | None) -> Simulation:
        """Return the run with the exciter at the force, from a recorded voltage."""
        raise self.cannot("be simulated over time", "predict_sweep predicts its response to a sweep")

    def draws(self, count: int, seed: int) -> Iterator["DynamicModel"]:
        """Yield models drawn about this one by the covariance of its identification."""
        raise self.cannot("be drawn", "its identification gives no covariance")

    def with_what_is_open(
        self, band: ResponseBand, response: SteadyPrediction, respond: Callable[[object], SteadyPrediction]
    ) -> ResponseBand:
        """Return a band of `draws` with what the data leave open beyond their range.

        ``response`` is that of this model, ``respond`` gives the same of another one, however far it goes. Raises
        `IdentificationError` if what is open makes the response uncertain. A kind that knows nothing of it returns the band.
        """
        return band

    def cannot(self, what: str, hint: str) -> IdentificationError:
        """Return the error for something that the kind does not answer."""
        return IdentificationError(f"model: a {self.kind} cannot {what}; {hint}")


KINDS: Registry[Callable[[object], DynamicModel]] = Registry(
    {
        "NonlinearMode": "identification.models.modal.dynamics:ModalDynamics",
        "PnlssModel": "identification.models.pnlss.dynamics:PnlssDynamics",
        "StructuredModel": "identification.models.structured.dynamics:StructuredDynamics",
        "StructuredFit": "identification.models.structured.dynamics:StructuredDynamics",
    }
)
"""Answers by the name of the class of a model; imported on use, so that one kind does not load the others."""


def has_kind(model: object) -> bool:
    """Return whether a model is of one of the kinds."""
    return isinstance(model, DynamicModel) or type(model).__name__ in KINDS


def dynamic_model(model: object) -> DynamicModel:
    """Return the answers of a model of any kind; a `DynamicModel` gives its own.

    Raises `IdentificationError` for anything else.
    """
    if isinstance(model, DynamicModel):
        return model
    name = type(model).__name__
    if name not in KINDS:
        raise IdentificationError(f"is a {name}", field="model", allowed=KINDS)
    return KINDS[name](model)
