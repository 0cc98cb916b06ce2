"""Storage, table, figure, curves and exchange of stepped-sine measurements."""

from typing import Any

import numpy as np

from identification import FrequencyResponse, pack_frequency_responses, unpack_frequency_responses
from identification.common import MOTION_UNIT
from rig.drawing.curves import DISPLACEMENT, FREQUENCY, LAG, ONE_AMPLITUDE, Curves, Line, Panel, Trace, View
from rig.drawing.page import grid, legend_below
from rig.drawing.style import REJECTED, Figure, length_factor, plain_log, shade, title
from rig.results.kind import Exchange, Storage, Table
from rig.text.column import Column
from rig.text.console import print_rows
from rig.text.contents import Contents


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
    print_rows(
        summary["responses"],
        Column("label", "level"),
        Column("samples", "samples"),
        Column("lowest_hz", "from", "Hz", ".2f"),
        Column("highest_hz", "to", "Hz", ".2f"),
    )


TABLE = Table(_summarise, _say)


def draw_responses(page: Figure, responses: tuple[FrequencyResponse, ...]) -> None:
    """Draw amplitude and phase lag over frequency."""
    top, bottom = grid(page, 2, 1, sharex=True)[:, 0]
    scale, unit = length_factor(np.concatenate([response.amplitude_m for response in responses]))
    for index, response in enumerate(responses):
        colour = shade(index, len(responses))
        order = np.argsort(response.frequency_hz)
        label = response.label or f"{response.level:g}"
        line = ".--" if response.controlled == "force" else ".-"
        top.semilogy(response.frequency_hz[order], scale * response.amplitude_m[order], line, color=colour, label=label)
        bottom.plot(response.frequency_hz[order], response.phase_lag_deg[order], line, color=colour)
    top.set(ylabel=f"displacement, {unit}")
    plain_log(top)
    bottom.set(xlabel="frequency, Hz", ylabel="phase lag, deg")
    bottom.axhline(90.0, color=REJECTED, lw=0.8)
    legend_below(page, top)
    title(page, f"{responses[0].specimen or 'specimen'}: stepped-sine responses, {len(responses)} levels")


def curves(responses: tuple[FrequencyResponse, ...], view: View) -> Curves:
    """Return amplitude and phase lag of every response, over frequency."""
    view.only(of=ONE_AMPLITUDE)
    traces = tuple(
        Trace(
            one.label or f"{one.level:g} {one.level_unit}",
            (Line(one.frequency_hz, one.amplitude_m), Line(one.frequency_hz, one.phase_lag_deg)),
        )
        for one in responses
    )
    return Curves((Panel(FREQUENCY, DISPLACEMENT), Panel(FREQUENCY, LAG)), traces, responses[0].specimen)


def _frequency_responses(responses: tuple[FrequencyResponse, ...]) -> Contents:
    arrays, attributes = pack_frequency_responses(responses)
    arrays["number"] = np.repeat(np.arange(1, len(responses) + 1), arrays["points_per_level"])
    kinds = sorted({MOTION_UNIT[response.kind] for response in responses})
    rows = dict.fromkeys(("number", "frequency_hz", "force", "response"), 0)
    units: dict[str, Any] = {"force": "N", "response": " or ".join(kinds), "level": "of what was controlled"}
    return Contents("frequency-responses", responses[0].specimen, arrays, attributes, rows, units)


EXCHANGE = Exchange("frequency-responses", tuple, _frequency_responses, unpack_frequency_responses)


STORAGE = Storage(pack_frequency_responses, unpack_frequency_responses)
