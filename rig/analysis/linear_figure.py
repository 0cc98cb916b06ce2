"""Figure of linear frequency responses: magnitude above phase, for force per volt and acceleration per volt and newton."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.figures.style import MAIN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_responses"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def draw_responses(
    page: "Figure", frequency_hz: Real, force: Complex, per_v: dict[str, Complex], per_n: dict[str, Complex]
) -> None:
    """Three columns; the channels share their colours."""
    from matplotlib.ticker import MultipleLocator

    axes = page.subplots(2, 3, sharex=True)
    columns = (
        ("force per voltage, N/V", {"force": force}),
        ("acceleration per voltage, (m/s²)/V", per_v),
        ("acceleration per force, (m/s²)/N", per_n),
    )
    for (magnitude, phase), (title, curves) in zip(axes.T, columns, strict=True):
        for number, (name, curve) in enumerate(curves.items()):
            colour = MAIN if len(curves) == 1 and name == "force" else f"C{number % 10}"
            magnitude.plot(frequency_hz, np.abs(curve), color=colour, lw=1.0, label=name)
            phase.plot(frequency_hz, np.degrees(np.unwrap(np.angle(curve))), color=colour, lw=1.0)
        magnitude.set(xscale="log", yscale="log")
        magnitude.set_title(title, fontsize=9, loc="left")
        phase.set_xlabel("frequency, Hz")
        low, high = phase.get_ylim()
        phase.yaxis.set_major_locator(MultipleLocator(90.0 if high - low < 900.0 else 360.0))
    axes[0, 0].set_ylabel("magnitude")
    axes[1, 0].set_ylabel("phase, deg")
    page.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=8)
