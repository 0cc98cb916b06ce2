"""Table and figure of a hammer test: the hits, and the frequency responses with coherence."""

from typing import Any

import numpy as np

from identification import FrequencyResponseMatrix, HammerTest
from rig.drawing.areas import is_narrow
from rig.drawing.lines import without_wraps
from rig.drawing.page import grid
from rig.drawing.style import COLOURS, MAIN, REJECTED, Figure, title, unit_text
from rig.results.kind import Table
from rig.text.column import Column
from rig.text.console import print_rows


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
    print_rows(
        [{**hit, "fault": hit["fault"] or "-"} for hit in summary["hits"]],
        Column("label", "hit"),
        Column("peak_n", "peak", "N", ".4g"),
        Column("duration_s", "pulse", "ms", ".3g", 1e3),
        Column("fault", "fault"),
    )
    coherence = ", ".join(f"{name} {value:.4f}" for name, value in summary["coherence_median"].items())
    print(f"median coherence: {coherence}")


def exported(found: HammerTest) -> list[FrequencyResponseMatrix]:
    """Return what is exported of a file: the responses."""
    return [found.responses]


TABLE = Table(_summarise, _say)


_MOST_OUTPUTS = 6
"""Largest number of outputs that are drawn; chosen for legibility."""


def draw_hammer_test(page: Figure, found: HammerTest) -> None:
    """Draw the responses in amplitude and phase, the coherence, and the spectrum of the force with the hits' peaks."""
    responses = found.responses
    size, phase, coherence, force = grid(page, 4, 1, sharex=True, height_ratios=(2.2, 1.0, 1.0, 1.0))[:, 0]
    frequency = responses.frequency_hz
    source = responses.inputs[0]
    for row, (output, colour) in enumerate(zip(responses.outputs[:_MOST_OUTPUTS], COLOURS, strict=False)):
        value = responses.value[:, row, 0]
        label = f"{output.name} over {source.name}, {unit_text(f'{output.unit}/{source.unit}')}"
        size.semilogy(frequency, np.abs(value), color=colour, label=label)
        size.semilogy(frequency, responses.total_std[:, row, 0], color=colour, lw=0.6, alpha=0.6)
        phase.plot(frequency, without_wraps(np.degrees(np.angle(value))), color=colour)
        coherence.plot(frequency, found.coherence[:, row], color=colour)
    size.plot([], [], color=REJECTED, lw=0.6, label="thin: standard error")
    size.set(ylabel="frequency response")
    size.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1 if is_narrow(page) else 2, borderaxespad=0.2)
    phase.set(ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, 0, 180))
    coherence.set(ylabel="coherence", ylim=(0.0, 1.05))
    level = 20.0 * np.log10(found.force_n_s / np.max(found.force_n_s))
    force.plot(frequency, level, color=MAIN)
    force.set(xlabel="frequency, Hz", ylabel="force, dB", ylim=(min(-25.0, float(level.min()) - 2.0), 3.0))
    window = f", window {responses.decay_rate_1_s:.3g} 1/s" if responses.decay_rate_1_s else ""
    count = f"{len(found.used)} of {len(found.hits)} hits"
    title(page, f"{responses.specimen or 'specimen'}: hammer test, {responses.estimator}, {count}{window}")
