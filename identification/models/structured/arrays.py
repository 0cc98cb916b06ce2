"""Convert structured models and their fits to arrays and attributes for a file, and back."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.models.structured.element_trials import ElementTrial
from identification.models.structured.elements import NonlinearElement
from identification.models.structured.fit import StructuredFit
from identification.models.structured.laws import law_from_dict
from identification.models.structured.model import StructuredModel
from identification.packing import pack

Arrays = Mapping[str, NDArray[Any]]
Attributes = Mapping[str, Any]

_MODELS = ("model", "start")


def model_arrays(model: StructuredModel) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return arrays by name, and JSON-able attributes: the elements and all else that is no array."""
    arrays, attributes = pack(model)
    return arrays, attributes | {"elements": [_as_dict(element) for element in model.elements]}


def model_from(arrays: Arrays, attributes: Attributes) -> StructuredModel:
    """Invert `model_arrays`; raise `IdentificationError` if something is missing or unknown."""
    try:
        values: dict[str, Any] = {**{name: np.asarray(array) for name, array in arrays.items()}, **attributes}
        values["elements"] = tuple(_element_from(element) for element in values["elements"])
        for name in ("inputs", "outputs"):
            values[name] = tuple(Channel(**channel) for channel in values[name])
        return StructuredModel(**values)
    except (KeyError, TypeError) as error:
        raise IdentificationError(f"structured model: {error} is missing or unknown") from None


def fit_arrays(fit: StructuredFit) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return arrays and attributes of a fit; those of its models are in groups of their own."""
    arrays: dict[str, NDArray[Any]] = {"values": fit.values, "covariance": fit.covariance}
    attributes: dict[str, Any] = {
        "names": list(fit.names),
        **{name: getattr(fit, name) for name in ("training_error", "evaluations", "seconds", "stopped")},
        "trials": [asdict(trial) for trial in fit.trials],
    }
    for name in _MODELS:
        inside, of_model = model_arrays(getattr(fit, name))
        arrays |= {f"{name}/{key}": array for key, array in inside.items()}
        attributes[name] = of_model
    return arrays, attributes


def fit_from(arrays: Arrays, attributes: Attributes) -> StructuredFit:
    """Invert `fit_arrays`; raise `IdentificationError` if something is missing or unknown."""
    try:
        values: dict[str, Any] = {name: attributes[name] for name in attributes if name not in _MODELS}
        values |= {name: np.asarray(arrays[name]) for name in ("values", "covariance")}
        values["names"] = tuple(values["names"])
        values["trials"] = tuple(_trial_from(trial) for trial in values.get("trials", ()))
        for name in _MODELS:
            head = f"{name}/"
            inside = {key.removeprefix(head): array for key, array in arrays.items() if key.startswith(head)}
            values[name] = model_from(inside, attributes[name])
        fit = StructuredFit(**values)
    except (KeyError, TypeError) as error:
        raise IdentificationError(f"structured fit: {error} is missing or unknown") from None
    count = len(fit.names)
    if fit.values.shape != (count,) or fit.covariance.shape != (count, count):
        raise IdentificationError(
            f"structured fit: {count} names, but values of shape {fit.values.shape} and a covariance of shape "
            f"{fit.covariance.shape}"
        )
    return fit


def _trial_from(values: Mapping[str, Any]) -> ElementTrial:
    """Return a trial from its attributes."""
    texts = {name: tuple(values[name]) for name in ("laws", "between")}
    return ElementTrial(**{**values, **texts, **{name: float(values[name]) for name in ("error", "gain", "at_least")}})


def _as_dict(element: NonlinearElement) -> dict[str, Any]:
    """Return the fields of an element as numbers, texts, lists and, for the laws, dictionaries."""
    values = {field.name: getattr(element, field.name) for field in fields(element)}
    return values | {"direction": element.direction.tolist(), "laws": [law.as_dict() for law in element.laws]}


def _element_from(values: Mapping[str, Any]) -> NonlinearElement:
    """Invert `_as_dict`."""
    return NonlinearElement(**{**values, "laws": tuple(law_from_dict(law) for law in values["laws"])})
