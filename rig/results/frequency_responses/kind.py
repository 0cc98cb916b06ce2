"""Files of stepped-sine measurements."""

from typing import Any

from identification import FrequencyResponse, pack_frequency_responses, unpack_frequency_responses
from rig.results.kind import FileKind
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


FREQUENCY_RESPONSES = FileKind(
    name="frequency-responses",
    holds=tuple,
    pack=pack_frequency_responses,
    unpack=unpack_frequency_responses,
    summarise=_summarise,
    say=_say,
    draw="rig.results.frequency_responses.figure:draw_responses",
)
