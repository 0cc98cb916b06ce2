"""Files of frequency response matrices, such as imported ones."""

from typing import Any

import numpy as np

from identification import FrequencyResponseMatrix
from rig.results.kind import Table
from rig.text.console import number, print_table


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
    print_table(
        ("output", "input", "unit", "largest", "at Hz", "errors"),
        [
            (
                p["output"],
                p["input"],
                p["unit"],
                number(p["largest"], ".4g"),
                number(p["at_hz"], ".3f"),
                "known" if p["errors_known"] else "unknown",
            )
            for p in summary["paths"]
        ],
    )


TABLE = Table(_summarise, _say)
