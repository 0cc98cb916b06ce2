"""Nonlinear state-space models as arrays and attributes, and back: what files hold."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.pnlss.features import Features

if TYPE_CHECKING:
    from identification.pnlss.model import PnlssModel

__all__ = ["MATRICES", "model_arrays", "model_values"]

MATRICES = ("a", "b", "e", "c", "d", "f")
_FEATURES = ("state_features", "output_features")
_PARTS = ("exponents", "weights", "limits")


def model_arrays(model: "PnlssModel") -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays by name, and the attributes (ready for JSON) that go with them."""
    arrays: dict[str, NDArray[Any]] = {name: getattr(model, name) for name in (*MATRICES, "state_range", "input_range")}
    for name in _FEATURES:
        arrays |= {f"{name}/{part}": getattr(getattr(model, name), part) for part in _PARTS}
    return arrays, {
        "sample_rate_hz": model.sample_rate_hz,
        "inputs": [vars(channel) for channel in model.inputs],
        "outputs": [vars(channel) for channel in model.outputs],
        "excited_hz": None if model.excited_hz is None else list(model.excited_hz),
        "training": list(model.training),
        "specimen": model.specimen,
        "notes": list(model.notes),
    }


def model_values(arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> dict[str, Any]:
    """What the model is made with, from what `model_arrays` gave; raises `IdentificationError` if something is missing."""
    try:
        values: dict[str, Any] = {name: arrays[name] for name in (*MATRICES, "state_range", "input_range")}
        variables = int(values["a"].shape[0] + values["b"].shape[1])
        for name in _FEATURES:
            parts: dict[str, Any] = {part: arrays[f"{name}/{part}"] for part in _PARTS}
            values[name] = Features(variables=variables, **parts)
        for name in ("inputs", "outputs"):
            values[name] = tuple(Channel(**channel) for channel in attributes[name])
        for name in ("training", "notes"):
            values[name] = tuple(attributes[name])
        band = attributes.get("excited_hz")
        values["excited_hz"] = None if band is None else (float(band[0]), float(band[1]))
        values["sample_rate_hz"] = float(attributes["sample_rate_hz"])
        values["specimen"] = str(attributes["specimen"])
    except (KeyError, TypeError, IndexError) as error:
        raise IdentificationError(f"PNLSS model: {error} is missing or unknown") from None
    return values
