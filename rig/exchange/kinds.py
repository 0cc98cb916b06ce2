"""Kinds of objects that are exchanged, each with its conversion to arrays and back."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from identification import (
    Backbone,
    FrequencyResponse,
    FrequencyResponseMatrix,
    IdentificationError,
    LinearModes,
    NonlinearMode,
    PnlssModel,
    StructuredModel,
    Transient,
    pack_frequency_responses,
    unpack_frequency_responses,
)
from identification.common import MOTION_UNIT, decode, encode
from identification.nonlinear import QUANTITIES
from rig.exchange.pnlss import pnlss_from, pnlss_parts
from rig.exchange.structured import structured_from, structured_parts
from rig.exchange.time_data import TimeData, time_data_from, time_data_parts, transient_from, transient_parts
from rig.measurements.backbone_table import backbone_from, backbone_parts
from rig.text.contents import Contents, Labels, unit_of


def _nonlinear_mode(mode: NonlinearMode) -> Contents:
    arrays, attributes = encode(mode)
    size = len(mode.force_n)
    rows = {name: 0 for name, array in arrays.items() if array.ndim and array.shape[0] == size}
    units = np.array([unit_of(name) for name in QUANTITIES])
    further = {"systematic_std": units, "random_std": units, "interval_95": units[:, None]}
    labels: dict[str, Labels] = dict.fromkeys(("systematic_std", "random_std"), (QUANTITIES,))
    labels |= {"interval_95": (QUANTITIES, ("low", "high"))}
    return Contents("nonlinear-mode", mode.specimen, arrays, attributes, rows, further, labels)


def _linear_modes(modes: LinearModes) -> Contents:
    arrays, attributes = encode(modes)
    names = tuple(channel.name for channel in modes.channels)
    shapes = {name: 1 for name in arrays if name.startswith("shapes")}
    rows = {name: 0 for name, array in arrays.items() if array.shape == modes.frequency_hz.shape and name not in _SIDES}
    units: dict[str, Any] = {"lower": "1/kg", "upper": "s2/kg", "force_rms_n": "N", "residues": "1/kg"}
    units["small_terms"] = np.array(["1/(kg s)", "1/(kg s2)", "s3/kg"])
    labels = dict.fromkeys(shapes, (names,))
    return Contents("linear-modes", modes.specimen, arrays, attributes, rows | shapes, units, labels)


_SIDES = ("lower", "upper")  # one value per channel, not per mode


def _response_matrix(matrix: FrequencyResponseMatrix) -> Contents:
    arrays, attributes = encode(matrix)
    outputs, inputs = (tuple(c.name for c in channels) for channels in (matrix.outputs, matrix.inputs))
    ratio = np.array([[f"{o.unit}/{i.unit}" for i in matrix.inputs] for o in matrix.outputs])
    flat, paths = ratio.ravel(), tuple(f"{o}/{i}" for o in outputs for i in inputs)
    covariance = np.array([[f"({a})({b})" for b in flat] for a in flat])
    kinds = ("noise_covariance", "total_covariance")
    units = {"value": ratio, **dict.fromkeys(kinds, covariance)}
    labels = {"value": (outputs, inputs), **dict.fromkeys(kinds, (paths, paths))}
    if matrix.deviations is not None:
        units["deviations"] = flat
        labels["deviations"] = (tuple(str(record + 1) for record in range(matrix.deviations.shape[1])), paths)
    rows = dict.fromkeys(arrays, 0)
    return Contents("frequency-response-matrix", _level(matrix), arrays, attributes, rows, units, labels)


def _level(matrix: FrequencyResponseMatrix) -> str:
    levels = ", ".join(f"{rms:.4g} {i.unit} RMS" for rms, i in zip(matrix.input_rms, matrix.inputs, strict=False))
    return ", ".join(text for text in (matrix.specimen, levels) if text)


def _frequency_responses(responses: tuple[FrequencyResponse, ...]) -> Contents:
    arrays, attributes = pack_frequency_responses(responses)
    arrays["number"] = np.repeat(np.arange(1, len(responses) + 1), arrays["points_per_level"])
    kinds = sorted({MOTION_UNIT[response.kind] for response in responses})
    rows = dict.fromkeys(("number", "frequency_hz", "force", "response"), 0)
    units: dict[str, Any] = {"force": "N", "response": " or ".join(kinds), "level": "of what was controlled"}
    return Contents("frequency-responses", responses[0].specimen, arrays, attributes, rows, units)


@dataclass(frozen=True)
class ExchangeKind:
    """Conversion of one type of objects to arrays and back; ``name`` is the name of the kind in exchanged files."""

    name: str
    type: type
    apart: Callable[[Any], Contents]
    together: Callable[[Mapping[str, Any], Mapping[str, Any]], Any]


KINDS = (
    ExchangeKind("backbone", Backbone, backbone_parts, backbone_from),
    ExchangeKind("frequency-responses", tuple, _frequency_responses, unpack_frequency_responses),
    ExchangeKind(
        "frequency-response-matrix", FrequencyResponseMatrix, _response_matrix, partial(decode, FrequencyResponseMatrix)
    ),
    ExchangeKind("linear-modes", LinearModes, _linear_modes, partial(decode, LinearModes)),
    ExchangeKind("nonlinear-mode", NonlinearMode, _nonlinear_mode, partial(decode, NonlinearMode)),
    ExchangeKind("time-data", TimeData, time_data_parts, time_data_from),
    ExchangeKind("pnlss", PnlssModel, pnlss_parts, pnlss_from),
    ExchangeKind("structured", StructuredModel, structured_parts, structured_from),
    ExchangeKind("sweep", Transient, transient_parts, transient_from),
)


def taken_apart(value: Any) -> Contents:
    """Convert an object to arrays and attributes; raise `IdentificationError` for a type that is not exchanged."""
    if isinstance(value, Contents):
        return value
    for kind in KINDS:
        if isinstance(value, kind.type):
            return kind.apart(value)
    names = ", ".join(kind.name for kind in KINDS)
    raise IdentificationError(f"{type(value).__name__}: is not exchanged; what is: {names}")


def put_together(kind: str, arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> Any:
    """Convert the output of `taken_apart` back; raise `IdentificationError` for an unknown kind or data that does not fit."""
    for known in KINDS:
        if known.name == kind:
            try:
                return known.together(arrays, attributes)
            except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
                raise IdentificationError(f"{kind}: does not fit together ({error})") from None
    raise IdentificationError(f"kind: is '{kind}', known are {', '.join(kind.name for kind in KINDS)}")
