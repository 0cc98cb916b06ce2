"""Predictions by structured models: recorded multisines."""

from dataclasses import fields
from pathlib import Path

from identification import Predictions
from rig.errors import ConfigurationError
from rig.models.files.files import load_as
from rig.models.files.structured import STRUCTURED, IdentifiedStructured, functions_of
from rig.models.predict.multisines import simulated_multisines
from rig.models.predict.request import PredictionRequest

__all__ = ["structured_predictions"]


def structured_predictions(path: Path, request: PredictionRequest) -> Predictions:
    """Return the simulated multisines with their errors.

    Raises `ConfigurationError` for other requests, `identification.IdentificationError` if the recorded channels do not fit.
    """
    for field in fields(request):
        if field.name not in ("multisines", "trust_code") and getattr(request, field.name) != field.default:
            raise ConfigurationError(
                f"`{field.name}`: means nothing to a structured model, which answers `multisines` alone so far"
            )
    found: IdentifiedStructured = load_as(STRUCTURED, path)
    if (functions := functions_of(found.model)) and not request.trust_code:
        raise ConfigurationError(
            f"{path}: function = {functions[0]!r}: is code that the model names, and is not imported unless you trust it: "
            "`trust_code`"
        )
    runs, notes = simulated_multisines(request.multisines, found, found.model.specimen)
    return Predictions(runs=runs, specimen=found.model.specimen, notes=tuple(dict.fromkeys(notes)))
