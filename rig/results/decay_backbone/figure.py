"""Figure of a free decay: modal frequency and damping over the amplitude, one row of panels per mode."""

from typing import TYPE_CHECKING

from identification import DecayBackbone
from rig.drawing.style import MAIN, SECOND, engineering, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SMALL_CHANGE = 2e-4
"""Least height of the frequency axis over the last frequency, so that rounding does not look like a change; chosen."""


def draw_decay(page: "Figure", found: DecayBackbone) -> None:
    """Draw every mode with its 95 % intervals."""
    panels = page.subplots(len(found.modes), 2, squeeze=False)
    for (left, right), mode in zip(panels, found.modes, strict=True):
        amplitude, unit = engineering(mode.amplitude_m)
        left.errorbar(
            amplitude, mode.modal_frequency_hz, mode.modal_frequency_bound_95_hz, fmt="o-", color=MAIN, capsize=2
        )
        right.errorbar(
            amplitude,
            100.0 * mode.damping_ratio,
            100.0 * mode.damping_ratio_bound_95,
            fmt="o-",
            color=SECOND,
            capsize=2,
        )
        label = f"displacement amplitude of {mode.reference}, {unit}"
        left.set(xlabel=label, ylabel="modal frequency, Hz", xscale="log")
        right.set(xlabel=label, ylabel="modal damping ratio, %", xscale="log")
        right.set_ylim(bottom=0.0)
        low, high = left.get_ylim()
        least = _SMALL_CHANGE * float(mode.modal_frequency_hz[-1])
        if high - low < least:
            left.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))
        left.ticklabel_format(axis="y", useOffset=False)
    count = len(found.modes)
    title(page, f"{found.specimen or 'specimen'}: free decay, {count} mode{'' if count == 1 else 's'}, 95 % intervals")
