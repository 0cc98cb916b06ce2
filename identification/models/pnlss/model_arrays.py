"""Convert the fields of a nonlinear state-space model to arrays and attributes for a file, and back."""

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.models.pnlss.features import Features

MATRICES = ("a", "b", "e", "c", "d", "f")
_FEATURES = ("state_features", "output_features")
_PARTS = ("exponents", "weights", "limits")


def model_arrays(fields: Mapping[str, Any]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return arrays by name and JSON-able attributes from the fields of a `PnlssModel` by name."""
    arrays: dict[str, NDArray[Any]] = {name: fields[name] for name in (*MATRICES, "state_range", "input_range")}
    for name in _FEATURES:
        arrays |= {f"{name}/{part}": getattr(fields[name], part) for part in _PARTS}
    functions = {f"{name}/functions": list(fields[name].functions) for name in _FEATURES if fields[name].functions}
    return arrays, {
        **functions,
        "sample_rate_hz": fields["sample_rate_hz"],
        "inputs": [vars(channel) for channel in fields["inputs"]],
        "outputs": [vars(channel) for channel in fields["outputs"]],
        "excited_hz": None if fields["excited_hz"] is None else list(fields["excited_hz"]),
        "training": list(fields["training"]),
        "specimen": fields["specimen"],
        "notes": list(fields["notes"]),
    }


def model_values(arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Invert `model_arrays`: return fields of a `PnlssModel`; raise `IdentificationError` if something is missing."""
    try:
        values: dict[str, Any] = {name: arrays[name] for name in (*MATRICES, "state_range", "input_range")}
        variables = int(values["a"].shape[0] + values["b"].shape[1])
        for name in _FEATURES:
            parts: dict[str, Any] = {part: arrays[f"{name}/{part}"] for part in _PARTS}
            functions = tuple(attributes.get(f"{name}/functions", ()))
            values[name] = Features(variables=variables, functions=functions, **parts)
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
