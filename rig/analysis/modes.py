"""Linear modes: of the structure with the shapes at every channel, and of the coupled rig from the voltage."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.analysis.modes_figure import draw_modes
from rig.analysis.study import Study
from rig.analysis.subject import Subject
from rig.text.console import number, print_table
from simulators.modes import LinearModes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Modes", "modes"]

Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Modes(Study):
    """Modes of the structure with elements at their linear stiffness and joints stuck, and of the coupled rig."""

    structure: LinearModes
    """Modes of the structure alone."""
    coupled: LinearModes
    """Modes of structure, stinger and exciter from the voltage."""
    channel_shapes: dict[str, Real]
    """Mass-normalised deflection (kg^-1/2) [n_mode] at every acceleration channel, by its name."""
    point_shapes: dict[str, Real]
    """The same at every named point; at a joint's site in its own coordinate."""

    @property
    def title(self) -> str:
        """What this is."""
        return f"linear modes, {self.structure.frequency_hz.size} of the structure"

    def numbers(self) -> dict[str, Any]:
        """Structure and coupled rig."""
        structure, coupled = (
            [
                {"frequency_hz": frequency_hz, "damping_ratio": damping_ratio}
                for frequency_hz, damping_ratio in zip(modes.frequency_hz, modes.damping_ratio, strict=True)
            ]
            for modes in (self.structure, self.coupled)
        )
        for k, mode in enumerate(structure):
            mode["drive_shape"] = self.structure.drive_shape[k]
            mode["channel_shapes"] = {name: shape[k] for name, shape in self.channel_shapes.items()}
            mode["point_shapes"] = {name: shape[k] for name, shape in self.point_shapes.items()}
        return {"structure": structure, "coupled": coupled}

    def print_tables(self) -> None:
        """One line per mode."""
        modes, channels = self.structure, self.channel_shapes
        print("structure: elements at their linear stiffness, joints stuck; shapes in kg^-1/2 at the channels")
        print_table(
            ("mode", "frequency Hz", "damping %", "drive point", *channels),
            [
                (
                    f"{'*' if k == self.subject.mode else ''}{k + 1}",
                    number(modes.frequency_hz[k], ".4f"),
                    number(modes.damping_ratio[k], ".4f", 100.0),
                    number(modes.drive_shape[k], ".6f"),
                    *(number(shape[k], ".6f") for shape in channels.values()),
                )
                for k in range(modes.frequency_hz.size)
            ],
        )
        print("* the mode under test\ncoupled rig from the voltage: structure, stinger and exciter")
        print_table(
            ("mode", "frequency Hz", "damping %"),
            [
                (f"{k + 1}", number(frequency_hz, ".4f"), number(self.coupled.damping_ratio[k], ".4f", 100.0))
                for k, frequency_hz in enumerate(self.coupled.frequency_hz)
            ],
        )

    def draw_on(self, page: "Figure") -> None:
        """The shapes, along the beam where the structure is one."""
        draw_modes(page, self.subject.rig, self.structure)


def modes(subject: Subject) -> Modes:
    """Linear modes of the rig of a bench."""
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
