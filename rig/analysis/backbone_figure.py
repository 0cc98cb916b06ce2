"""Figure of a backbone: frequency, damping, amplitude and harmonics over the level, and the joints' hysteresis."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig.analysis.drawing import length_unit, roomy
from rig.figures.style import MAIN, SECOND
from simulators.analysis import HysteresisLoop, PeriodicResponses
from simulators.sites.friction import FrictionSite

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = ["draw_backbone"]


def draw_backbone(
    page: "Figure",
    found: PeriodicResponses,
    loops: dict[int, tuple[HysteresisLoop, ...]],
    joints: Sequence[FrictionSite],
) -> None:
    """Four panels over the level, and one more per level that has loops."""
    upper: Figure | SubFigure = page
    lower: SubFigure | None = None
    if loops:
        upper, lower = page.subfigures(2, 1, squeeze=False, height_ratios=(2.0, 1.05))[:, 0]
    (frequency, damping), (amplitude, harmonics) = upper.subplots(2, 2)
    scale, unit = length_unit(float(np.max(found.amplitude_m)))
    x = scale * found.amplitude_m
    frequency.plot(x, found.modal_frequency_hz, "o-", ms=4, color=MAIN)
    frequency.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
    damping.plot(x, 100 * found.damping_ratio, "o-", ms=4, color=MAIN, label="active power of the fundamental")
    total = 100 * found.damping_ratio_total_power
    damping.plot(x, total, "s--", ms=3.5, color=SECOND, label="active power of all harmonics")
    damping.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping ratio, %")
    roomy(damping, np.concatenate([100 * found.damping_ratio, total]), 0.2)
    damping.legend(fontsize=8, loc="best")
    amplitude.plot(found.force_n, x, "o-", ms=4, color=MAIN)
    amplitude.set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement amplitude, {unit}")
    _draw_harmonics(harmonics, found)
    if lower is not None:
        _draw_loops(lower, found, loops, joints)


def _draw_harmonics(axis: "Axes", found: PeriodicResponses) -> None:
    for harmonic, marker, colour in ((2, "^", MAIN), (3, "v", SECOND)):
        if harmonic < found.force_harmonics_n.shape[1]:
            ratio = found.force_harmonic_ratio(harmonic)
            axis.plot(found.force_n, ratio, marker + "-", ms=4, color=colour, label=f"|F{harmonic}|/|F1|")
    axis.set(xlabel="force amplitude (fundamental), N", ylabel="harmonics of the force")
    axis.set_ylim(bottom=0.0)
    axis.legend(fontsize=8)


def _draw_loops(
    part: "Figure | SubFigure",
    found: PeriodicResponses,
    loops: dict[int, tuple[HysteresisLoop, ...]],
    joints: Sequence[FrictionSite],
) -> None:
    """One panel per level with the loops of all joints; those of the second half dashed, for pairs may coincide."""
    axes = np.atleast_1d(part.subplots(1, len(loops)))
    for axis, (point, several) in zip(axes, loops.items(), strict=True):
        largest = max(float(np.max(np.abs(loop.coordinate))) for loop in several)
        scale, words, force = _units(joints, largest)
        for number, (joint, loop) in enumerate(zip(joints, several, strict=True)):
            axis.plot(
                scale * loop.coordinate,
                loop.force,
                lw=1.2,
                ls="-" if 2 * number < len(joints) else (0, (4, 3)),
                color=f"C{number % 10}",
                label=joint.at,
            )
        axis.set_title(f"at {found.force_n[point]:.3g} N", fontsize=9)
        axis.set_xlabel(words)
        axis.locator_params(nbins=5)
    axes[0].set_ylabel(force)
    part.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=8, fontsize=8)


def _units(joints: Sequence[FrictionSite], largest: float) -> tuple[float, str, str]:
    """Factor and axis labels for the joints' coordinate and force."""
    if all(joint.relative_to_mode_1 for joint in joints):
        return 1e3, "joint coordinate, 1e-3 kg$^{1/2}$ m", "joint force, N/kg$^{1/2}$"
    if all(joint.quantity == "deflection" and not joint.relative_to_mode_1 for joint in joints):
        scale, unit = length_unit(largest)
        return scale, f"joint displacement, {unit}", "joint force, N"
    return 1.0, "joint coordinate, SI units", "joint force, SI units"
