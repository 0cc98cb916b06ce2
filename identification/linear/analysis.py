"""A modal analysis as a whole: the modes, the responses they were fitted to, and the stabilisation diagram."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.linear.modes import LinearModes
from identification.linear.response_matrix import FrequencyResponseMatrix
from identification.linear.stabilisation import StabilisationDiagram

__all__ = ["ModalAnalysis"]


@dataclass(frozen=True, eq=False)
class ModalAnalysis:
    """What a linear modal analysis made, kept together.

    Parameters
    ----------
    modes
        The modal model.
    responses
        What it was fitted to; None where modes came from elsewhere.
    stabilisation
        How the modes were found; None where starting values were given.
    """

    modes: LinearModes
    responses: FrequencyResponseMatrix | None = None
    stabilisation: StabilisationDiagram | None = None

    def to_arrays(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Arrays by name, a group for each part, and the attributes (ready for JSON) that go with them."""
        arrays, attributes = _grouped("modes", self.modes)
        if self.responses is not None:
            more, attributes_of_responses = _grouped("responses", self.responses)
            arrays, attributes = arrays | more, attributes | attributes_of_responses
        if self.stabilisation is not None:
            arrays |= {
                f"stabilisation/{f.name}": getattr(self.stabilisation, f.name) for f in fields(self.stabilisation)
            }
        return arrays, attributes

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]) -> "ModalAnalysis":
        """Inverse of `to_arrays`; raises `IdentificationError` if something is missing."""
        diagram = {name: np.asarray(values) for name, values in _group(arrays, "stabilisation").items()}
        return cls(
            LinearModes.from_arrays(_group(arrays, "modes"), attributes.get("modes", {})),
            FrequencyResponseMatrix.from_arrays(_group(arrays, "responses"), attributes["responses"])
            if "responses" in attributes
            else None,
            StabilisationDiagram(**diagram) if diagram else None,
        )


def _grouped(name: str, part: LinearModes | FrequencyResponseMatrix) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    arrays, attributes = part.to_arrays()
    return {f"{name}/{key}": values for key, values in arrays.items()}, {name: attributes}


def _group(arrays: Mapping[str, NDArray[Any]], name: str) -> dict[str, NDArray[Any]]:
    return {key.removeprefix(f"{name}/"): values for key, values in arrays.items() if key.startswith(f"{name}/")}
