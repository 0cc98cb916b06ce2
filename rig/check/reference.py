"""Findings from the comparison with an earlier check of the same bench: swapped or reversed channels and changed gains."""

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from rig.check.findings import Finding, not_tested
from rig.check.judging import best_assignment, by_shape, sized
from rig.check.responses import Responses
from vibrolock.arrays import Complex


def on_lines_of(frequency_hz: NDArray[np.float64], reference: Responses) -> Complex:
    """Interpolate the responses per volt of the reference: complex[n_channels, n_lines]."""
    return np.array([np.interp(frequency_hz, reference.frequency_hz, row) for row in reference.per_volt])


def reference_findings(bench: Bench, found: Responses, reference: Responses, dead: set[str]) -> list[Finding]:
    """Return the findings on channels that both checks have and that are not ``dead``."""
    both = [i for i, name in enumerate(found.names) if name in reference.names and name not in dead]
    both = [i for i in both if bench.channels[i].role != "monitor"]
    if not both:
        return [not_tested("reference", "the reference has no channel in common with this bench")]
    inside = (found.frequency_hz >= reference.frequency_hz[0]) & (found.frequency_hz <= reference.frequency_hz[-1])
    known = on_lines_of(found.frequency_hz[inside], reference)
    known = known[[reference.names.index(found.names[i]) for i in both]]
    volts = np.array([bench.channels[i].sensitivity_v_per_unit for i in both])[:, None]
    now = found.per_volt[both][:, inside]
    swapped = best_assignment(by_shape(now * volts, known * volts))
    names = [found.names[i] for i in both]
    if swapped is not None:
        return [
            Finding("place", name, "fail", text=f"reads what {names[really]} did in the reference: swapped")
            for place, (name, really) in enumerate(zip(names, swapped, strict=True))
            if place != really
        ]
    return [finding for name, new, old in zip(names, now, known, strict=True) for finding in _compared(name, new, old)]


def _compared(name: str, now: Complex, known: Complex) -> list[Finding]:
    alike = float(np.real(np.vdot(known, now)) / (np.linalg.norm(known) * np.linalg.norm(now)))
    ratio = float(np.exp(np.median(np.log(np.abs(now) / np.abs(known)))))
    turned = alike < 0.0
    text = "reversed since the reference (if all channels are: the drive is)" if turned else ""
    sign = Finding("polarity", name, "fail" if turned else "ok", alike, "likeness", "above 0", text)
    text = "per volt, against the reference: amplifier, sensitivity, or the rig has changed"
    return [sign, sized("gain", name, ratio, "of reference", text)]
