"""Exchange of frequency response matrices."""

from functools import partial

import numpy as np

from identification import (
    FrequencyResponseMatrix,
)
from identification.common import decode, encode
from rig.results.kind import Exchange
from rig.text.contents import Contents


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


EXCHANGE = Exchange(
    "frequency-response-matrix", FrequencyResponseMatrix, _response_matrix, partial(decode, FrequencyResponseMatrix)
)
