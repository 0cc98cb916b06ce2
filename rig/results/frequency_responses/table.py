"""Files of stepped-sine measurements."""

from typing import Any

from identification import FrequencyResponse
from rig.results.kind import Table
from rig.text.console import number, print_table


def _summarise(responses: tuple[FrequencyResponse, ...]) -> dict[str, Any]:
    return {
        "specimen": responses[0].specimen,
        "responses": [
            {
                "label": response.label,
                "samples": int(response.frequency_hz.size),
                "lowest_hz": float(response.frequency_hz.min()),
                "highest_hz": float(response.frequency_hz.max()),
            }
            for response in responses
        ],
        "notes": [],
    }


def _say(summary: dict[str, Any]) -> None:
    print(f"{len(summary['responses'])} levels")
    print_table(
        ("level", "samples", "from Hz", "to Hz"),
        [
            (r["label"], str(r["samples"]), number(r["lowest_hz"], ".2f"), number(r["highest_hz"], ".2f"))
            for r in summary["responses"]
        ],
    )


TABLE = Table(_summarise, _say)
