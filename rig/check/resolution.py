"""Findings on a level that the converters hardly see: by how much gain or how many bits would do."""

import math

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from rig.check.findings import Finding

LEAST_STEPS = 1.0  # RMS in steps of a converter below which there is a warning; chosen
ENOUGH_STEPS = 4.0  # RMS in steps of a converter that suffice; chosen


def resolution_findings(bench: Bench, level_rms_v: float, rows: NDArray[np.void]) -> list[Finding]:
    """Return a warning for the output and for each channel whose multisine is below one step of its converter.

    ``rows``: those of the multisine. Noise that the bench declares is taken out of the size of a channel.
    """
    out = []
    steps = level_rms_v / bench.output_bit_v
    if steps < LEAST_STEPS:
        enough_v = ENOUGH_STEPS * bench.output_bit_v
        text = (
            f"the level of {level_rms_v:.3g} V RMS is below one step of the output ({bench.output_bit_v:.3g} V): "
            f"--level {enough_v:.2g}, {_more_bits(steps)}, or {ENOUGH_STEPS / steps:.2g} times less gain of the amplifier "
            "with more volts"
        )
        out.append(Finding("resolution", "", "warn", steps, "steps", f"from {LEAST_STEPS:g}", text))
    for index, channel in enumerate(bench.channels):
        values = rows["inputs"][:, index].astype(float)
        values = values[np.isfinite(values)]
        if channel.role == "monitor" or not values.size:
            continue
        signal = math.sqrt(max(0.0, float(values.var()) - channel.noise_rms**2))
        steps = signal / channel.resolution_in_unit
        if steps < LEAST_STEPS:
            text = f"the multisine is below one step of its converter: {_more_gain(steps)}, or a higher --level"
            out.append(Finding("resolution", channel.name, "warn", steps, "steps", f"from {LEAST_STEPS:g}", text))
    return out


def _more_gain(steps: float) -> str:
    if steps < 1.0 / ENOUGH_STEPS:
        return "it hardly shows, so the gain it needs cannot be estimated, or the channel is dead"
    return f"{ENOUGH_STEPS / steps:.2g} times the gain of its conditioner, {_more_bits(steps)}"


def _more_bits(steps: float) -> str:
    count = math.ceil(math.log2(ENOUGH_STEPS / steps))
    return f"{count} more bit{'' if count == 1 else 's'}"
