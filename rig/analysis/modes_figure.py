"""Figure of linear modes: their shapes along the beam, with everything that is attached to it."""

from typing import TYPE_CHECKING

import numpy as np

from rig.figures.style import MAIN, REJECTED
from simulators.modes import LinearModes
from simulators.structures.meshed import MeshedBeam
from simulators.virtual_rig import VirtualRig

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_modes"]

_MOST = 8
_STATIONS = 401
_MARKERS = "osD^vPX*<>ph"


def draw_modes(page: "Figure", rig: VirtualRig, modes: LinearModes) -> None:
    """One panel per mode, the lowest eight at most."""
    count = min(_MOST, modes.frequency_hz.size)
    rows = (count + 1) // 2
    panels = page.subplots(rows, min(2, count), sharex=True, squeeze=False).ravel()
    for k, axis in enumerate(panels):
        if k >= count:
            axis.set_axis_off()
            continue
        axis.axhline(0.0, color=REJECTED, lw=0.8)
        if isinstance(rig.structure, MeshedBeam):
            _along_the_beam(axis, rig, rig.structure, modes, k)
        else:
            _at_the_points(axis, rig, modes, k)
        text = f"mode {k + 1}: {modes.frequency_hz[k]:.5g} Hz, {100 * modes.damping_ratio[k]:.3g} %"
        axis.set_title(text, fontsize=9, loc="left")
        if k % 2 == 0:
            axis.set_ylabel("shape, kg$^{-1/2}$")
    if isinstance(rig.structure, MeshedBeam):
        for axis in panels[max(0, count - 2) : count]:
            axis.set_xlabel("position along the beam, m")
            axis.tick_params(labelbottom=True)
    page.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)


def _along_the_beam(axis: "Axes", rig: VirtualRig, beam: MeshedBeam, modes: LinearModes, k: int) -> None:
    x = np.linspace(0.0, beam.length_m, _STATIONS)
    shapes = np.array([beam.modes.shape(float(position)) for position in x])
    axis.plot(x, shapes @ (rig.plant.signs * modes.vectors[:, k]), color=MAIN)
    for number, (at, label) in enumerate(_attached(rig).items()):
        if at in beam.points_m:
            height = modes.at(rig.shape(at))[k]
            marker, colour = _MARKERS[number % len(_MARKERS)], f"C{number % 10}"
            axis.plot(beam.points_m[at], height, marker, ms=5, color=colour, label=label)


def _at_the_points(axis: "Axes", rig: VirtualRig, modes: LinearModes, k: int) -> None:
    names = rig.structure.points
    axis.bar(names, [modes.at(rig.shape(at))[k] for at in names], width=0.5, color=MAIN, label="named points")
    axis.tick_params(axis="x", labelsize=8, labelrotation=30)


def _attached(rig: VirtualRig) -> dict[str, str]:
    """What is attached to each point of the structure, in words."""
    there: dict[str, list[str]] = {rig.stinger.at: ["stinger"]}
    for sensor in rig.sensors:
        if sensor.at is not None:
            there.setdefault(sensor.at, []).append(f"channel {sensor.name}")
    for part in (*rig.elements, *rig.friction):
        there.setdefault(part.at, []).append(f"{part.kind} at {part.at}")
    return {at: ", ".join(dict.fromkeys(what)) for at, what in there.items()}
