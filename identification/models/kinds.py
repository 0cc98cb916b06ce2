"""The kinds of dynamic models: from the class of a model to its answers."""

from collections.abc import Callable

from identification.errors import IdentificationError
from identification.models.dynamic_model import DynamicModel
from vibrolock.on_use import Registry

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
        raise IdentificationError(f"model: is a {name}, allowed are {', '.join(KINDS)}")
    return KINDS[name](model)
