"""Files of hammer tests: the hits, and the frequency responses with coherence."""

from typing import Any

import numpy as np

from identification import FrequencyResponseMatrix, HammerTest
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(found: HammerTest) -> dict[str, Any]:
    responses = found.responses
    return {
        "specimen": responses.specimen,
        "estimator": responses.estimator,
        "channels": [dict(vars(channel)) for channel in found.channels],
        "lines": int(responses.frequency_hz.size),
        "band_hz": [float(responses.frequency_hz[0]), float(responses.frequency_hz[-1])],
        "record_s": found.record_s,
        "decay_rate_1_s": responses.decay_rate_1_s,
        "hits": found.table(),
        "coherence_median": {
            output.name: float(np.median(found.coherence[:, row])) for row, output in enumerate(responses.outputs)
        },
        "notes": list(responses.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    low, high = summary["band_hz"]
    used = sum(not hit["fault"] for hit in summary["hits"])
    window = f", exponential window {summary['decay_rate_1_s']:.3g} 1/s" if summary["decay_rate_1_s"] else ""
    print(f"{used} of {len(summary['hits'])} hits of {summary['record_s']:.4g} s count{window}")
    print(f"{summary['estimator']}, {summary['lines']} lines, {low:.4g} to {high:.4g} Hz")
    print_table(
        ("hit", "peak N", "pulse ms", "fault"),
        [
            (hit["label"], number(hit["peak_n"], ".4g"), number(hit["duration_s"], ".3g", 1e3), hit["fault"] or "-")
            for hit in summary["hits"]
        ],
    )
    coherence = ", ".join(f"{name} {value:.4f}" for name, value in summary["coherence_median"].items())
    print(f"median coherence: {coherence}")


def exported(found: HammerTest) -> list[FrequencyResponseMatrix]:
    """Return what is exported of a file: the responses."""
    return [found.responses]


TABLE = Table(_summarise, _say)
