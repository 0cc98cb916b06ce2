"""Linear modes of the structure, with their shapes at the channels, and of the coupled rig driven by a voltage."""

from dataclasses import dataclass

import numpy as np

from rig.analysis.study import Study
from rig.analysis.subject import Subject
from rig.drawing.page import grid, legend_below
from rig.drawing.style import COLOURS, MAIN, REJECTED, Axes, Figure
from rig.text.console import print_columns
from simulators import VirtualRig
from simulators.analysis import LinearModes
from simulators.parts import MeshedBeam
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False, kw_only=True)
class Modes(Study):
    """Linear modes of the structure, with linear stiffness of the elements and stuck joints, and of the coupled rig."""

    structure: LinearModes
    """Modes of the structure alone."""
    coupled: LinearModes
    """Modes of structure, stinger and exciter, driven by the voltage."""
    channel_shapes: dict[str, Float]
    """Mass-normalised shapes (kg^-1/2) [n_mode] at every acceleration channel, by channel name."""
    point_shapes: dict[str, Float]
    """Mass-normalised shapes at every named point; at a joint's site in the coordinate of the joint."""

    @property
    def title(self) -> str:
        """Title of the analysis."""
        return f"linear modes, {self.structure.frequency_hz.size} of the structure"

    def numbers(self) -> dict[str, object]:
        """Return the modes of structure and coupled rig."""
        structure = [
            {
                "frequency_hz": frequency_hz,
                "damping_ratio": self.structure.damping_ratio[k],
                "drive_shape": self.structure.drive_shape[k],
                "channel_shapes": {name: shape[k] for name, shape in self.channel_shapes.items()},
                "point_shapes": {name: shape[k] for name, shape in self.point_shapes.items()},
            }
            for k, frequency_hz in enumerate(self.structure.frequency_hz)
        ]
        coupled = [
            {"frequency_hz": frequency_hz, "damping_ratio": self.coupled.damping_ratio[k]}
            for k, frequency_hz in enumerate(self.coupled.frequency_hz)
        ]
        return {"structure": structure, "coupled": coupled}

    def print_tables(self) -> None:
        """Print one line per mode."""
        modes, channels = self.structure, self.channel_shapes
        print("structure: elements at their linear stiffness, joints stuck; shapes in kg^-1/2 at the channels")
        numbers = [f"{'*' if k == self.subject.mode else ''}{k + 1}" for k in range(modes.frequency_hz.size)]
        print_columns(
            ("mode", "", numbers),
            ("frequency Hz", ".4f", modes.frequency_hz),
            ("damping %", ".4f", 100.0 * modes.damping_ratio),
            ("drive point", ".6f", modes.drive_shape),
            *((name, ".6f", shape) for name, shape in channels.items()),
        )
        print("* the mode under test\ncoupled rig from the voltage: structure, stinger and exciter")
        print_columns(
            ("mode", ".0f", range(1, self.coupled.frequency_hz.size + 1)),
            ("frequency Hz", ".4f", self.coupled.frequency_hz),
            ("damping %", ".4f", 100.0 * self.coupled.damping_ratio),
        )

    def draw_on(self, page: Figure) -> None:
        """Draw a panel for each of the lowest eight modes; along the beam if the structure is a beam."""
        rig, modes = self.subject.rig, self.structure
        count = min(_MAX_MODES, modes.frequency_hz.size)
        panels = grid(page, (count + 1) // 2, min(2, count), sharex=True).ravel()
        for k, axis in enumerate(panels):
            if k >= count:
                axis.set_axis_off()
                continue
            axis.axhline(0.0, color=REJECTED, lw=0.8)
            if isinstance(rig.structure, MeshedBeam):
                _along_the_beam(axis, rig, rig.structure, modes, k)
            else:
                names = rig.structure.points
                heights = [modes.at(rig.shape(at))[k] for at in names]
                axis.bar(names, heights, width=0.5, color=MAIN, label="named points")
                axis.tick_params(axis="x", labelrotation=30)
            axis.set_title(f"mode {k + 1}: {modes.frequency_hz[k]:.5g} Hz, {100 * modes.damping_ratio[k]:.3g} %")
            if k % 2 == 0:
                axis.set_ylabel("shape, kg$^{-1/2}$")
        if isinstance(rig.structure, MeshedBeam):
            for axis in panels[max(0, count - 2) : count]:
                axis.set_xlabel("position along the beam, m")
                axis.tick_params(labelbottom=True)
        legend_below(page, panels[0])
        if count < modes.frequency_hz.size:
            text = f"the lowest {count} of {modes.frequency_hz.size} modes"
            page.text(0.99, 0.01, text, ha="right", color=REJECTED)


def modes(subject: Subject) -> Modes:
    """Compute the linear modes of the rig of a bench."""
    rig = subject.rig
    linear = rig.linear_modes
    points = {at: linear.at(rig.shape(at)) for at in rig.structure.points}
    channels = {sensor.name: points[sensor.at] for sensor in rig.sensors if sensor.at is not None}
    return Modes(
        subject=subject,
        structure=linear,
        coupled=rig.coupled_modes,
        channel_shapes=channels,
        point_shapes=points,
    )


_MAX_MODES = 8  # modes that are drawn; chosen: as many as a page holds
_STATIONS = 401  # positions along the beam at which a shape is drawn; chosen
_MARKERS = "osD^vPX*<>ph"  # markers of what is attached


def _along_the_beam(axis: Axes, rig: VirtualRig, beam: MeshedBeam, modes: LinearModes, k: int) -> None:
    x = np.linspace(0.0, beam.length_m, _STATIONS)
    shapes = np.array([beam.modes.shape(float(position)) for position in x])
    axis.plot(x, shapes @ (rig.plant.signs * modes.vectors[:, k]), color=MAIN)
    for place, (at, label) in enumerate(_attached(rig).items()):
        if at in beam.points_m:
            height = modes.at(rig.shape(at))[k]
            marker, colour = _MARKERS[place % len(_MARKERS)], COLOURS[(place + 1) % len(COLOURS)]
            axis.plot(beam.points_m[at], height, marker, color=colour, label=label)


def _attached(rig: VirtualRig) -> dict[str, str]:
    there: dict[str, list[str]] = {rig.stinger.at: ["stinger"]}
    for sensor in rig.sensors:
        if sensor.at is not None:
            there.setdefault(sensor.at, []).append(f"channel {sensor.name}")
    for part in (*rig.elements, *rig.friction):
        there.setdefault(part.at, []).append(f"{part.kind} at {part.at}")
    return {at: ", ".join(dict.fromkeys(what)) for at, what in there.items()}
