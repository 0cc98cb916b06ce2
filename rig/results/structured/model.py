"""A structured model and its origin."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from identification import ResponseBand, SteadyPrediction, StructuredFit, StructuredModel, dynamic_model
from identification.experiments import Simulator
from identification.models import UserSpring, drawn
from rig.results.simulated.model import SimulatedModel
from rig.results.simulated.open_bands import OpenBands


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedStructured(SimulatedModel):
    """A structured model and its origin."""

    model: StructuredModel
    fit: StructuredFit | None = None
    """Its fit; None for a model from another source."""
    linear: StructuredModel | None = None
    """Modes with which the fit began, without elements; None if unknown."""

    @property
    def functions(self) -> list[str]:
        """Functions of the user, ``module:name``, that the model names."""
        named = [law.function for element in self.model.elements for law in element.laws if isinstance(law, UserSpring)]
        return list(dict.fromkeys(named))

    @property
    def steps_left(self) -> float:
        """Share of the errors of the model's steps that its fit has not made up for; 1 if unknown."""
        return 1.0 if self.fit is None else self.fit.steps_left

    def allowed_by_fit(self, count: int) -> list[Simulator] | None:
        """Return models drawn by the covariance of the fit; None if it is unknown."""
        return None if self.fit is None else list(drawn(self.fit, count))

    def open_bands(self, asked: bool, allowed: bool) -> OpenBands | None:
        """Return what is to be said of predictions beyond the training data; None for a model without elements."""
        return OpenBands(None if self.scatter else self.fit, asked, allowed) if self.model.elements else None

    def with_what_is_open(
        self, band: ResponseBand, response: SteadyPrediction, respond: Callable[[Any], SteadyPrediction]
    ) -> ResponseBand:
        """Return the band with laws that the training data do not tell from those of the fit, and the error that it left.

        Raises `identification.IdentificationError` if these laws differ too much.
        """
        return band if self.fit is None else dynamic_model(self.fit).with_what_is_open(band, response, respond)


def whole(found: StructuredFit | StructuredModel) -> IdentifiedStructured:
    """Return a fit or a model without further results as an identified model."""
    if isinstance(found, StructuredFit):
        return IdentifiedStructured(model=found.model, fit=found)
    return IdentifiedStructured(model=found)
