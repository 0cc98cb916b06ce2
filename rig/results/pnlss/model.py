"""A nonlinear state-space model and its origin."""

from dataclasses import dataclass

from identification import PnlssFit, PnlssModel
from identification.models import is_users
from rig.results.simulated.model import SimulatedModel


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedPnlss(SimulatedModel):
    """A nonlinear state-space model and its origin."""

    model: PnlssModel
    fit: PnlssFit | None = None
    """The fit of which the model is the best iterate; None for a model from another source."""

    @property
    def linear(self) -> PnlssModel | None:
        """Linear start of the fit; None if unknown."""
        return None if self.fit is None else self.fit.linear

    @property
    def functions(self) -> list[str]:
        """Functions of the user, ``module:name``, that the model names."""
        named = (*self.model.state_features.functions, *self.model.output_features.functions)
        return [name for name in dict.fromkeys(named) if is_users(name)]


def whole(found: PnlssFit | PnlssModel) -> IdentifiedPnlss:
    """Return a fit or a model without further results as an identified model."""
    if isinstance(found, PnlssFit):
        return IdentifiedPnlss(model=found.model, fit=found)
    return IdentifiedPnlss(model=found)
