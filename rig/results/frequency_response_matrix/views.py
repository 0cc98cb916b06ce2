"""Table, figure, curves and exchange of frequency response matrices."""

from functools import partial
from typing import Any

import numpy as np

from identification import FrequencyResponseMatrix
from identification.common import decode, encode
from rig.drawing.areas import is_narrow
from rig.drawing.curves import Curves, View, transfer_curves
from rig.drawing.lines import pooled, without_wraps
from rig.drawing.page import grid
from rig.drawing.style import COLOURS, REJECTED, Figure, title, unit_text
from rig.results.kind import Exchange, Table
from rig.text.column import Column
from rig.text.console import print_rows
from rig.text.contents import Contents


def _summarise(matrix: FrequencyResponseMatrix) -> dict[str, Any]:
    return {
        "specimen": matrix.specimen,
        "estimator": matrix.estimator,
        "lines": int(matrix.frequency_hz.size),
        "band_hz": [float(matrix.frequency_hz[0]), float(matrix.frequency_hz[-1])],
        "paths": [
            {
                "output": output.name,
                "input": source.name,
                "unit": f"{output.unit}/{source.unit}",
                "largest": float(np.abs(matrix.value[:, row, column]).max()),
                "at_hz": float(matrix.frequency_hz[int(np.argmax(np.abs(matrix.value[:, row, column])))]),
                "errors_known": matrix.noise_covariance is not None or matrix.total_covariance is not None,
            }
            for row, output in enumerate(matrix.outputs)
            for column, source in enumerate(matrix.inputs)
        ],
        "notes": list(matrix.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    low, high = summary["band_hz"]
    print(f"{summary['estimator'] or 'estimator unknown'}, {summary['lines']} lines, {low:g} to {high:g} Hz")
    print_rows(
        [{**path, "errors": "known" if path["errors_known"] else "unknown"} for path in summary["paths"]],
        *(Column(name, name) for name in ("output", "input", "unit")),
        Column("largest", "largest", "", ".4g"),
        Column("at_hz", "at", "Hz", ".3f"),
        Column("errors", "errors"),
    )


TABLE = Table(_summarise, _say)


_LINES = ("-", "--", ":", "-.")


def draw_response_matrix(page: Figure, matrix: FrequencyResponseMatrix) -> None:
    """Draw one colour per output and one line style per input; thin lines are standard errors."""
    size, phase = grid(page, 2, 1, sharex=True, height_ratios=(2.0, 1.0))[:, 0]
    known = False
    errors = matrix.noise_std if matrix.total_covariance is None else matrix.total_std
    for row, output in enumerate(matrix.outputs):
        for column, source in enumerate(matrix.inputs):
            colour, line = COLOURS[row % len(COLOURS)], _LINES[column % len(_LINES)]
            value = matrix.value[:, row, column]
            label = f"{output.name} over {source.name}, {unit_text(f'{output.unit}/{source.unit}')}"
            size.semilogy(matrix.frequency_hz, np.abs(value), line, color=colour, label=label)
            phase.plot(matrix.frequency_hz, without_wraps(np.degrees(np.angle(value))), line, color=colour)
            if np.isfinite(errors[:, row, column]).any():
                known = True
                error = pooled(errors[:, row, column])
                size.semilogy(matrix.frequency_hz, error, line, color=colour, lw=0.7, alpha=0.6)
    size.set(ylabel="frequency response")
    if known:
        size.plot([], [], color=REJECTED, lw=0.7, label="thin: standard error")
    size.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1 if is_narrow(page) else 2, borderaxespad=0.2)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    estimator = f", {matrix.estimator}" if matrix.estimator else ""
    title(page, f"{matrix.specimen or 'specimen'}: frequency responses{estimator}")


def curves(matrix: FrequencyResponseMatrix, view: View) -> Curves:
    """Return size and phase of the response from the force to the channel."""
    return transfer_curves({"": matrix}, view)


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
