"""Linear frequency responses of a bench: voltage to force and accelerations, force to accelerations."""

from dataclasses import dataclass

import numpy as np

from rig.analysis.balance import configuration_errors
from rig.analysis.levels import checked_points
from rig.analysis.study import Study
from rig.analysis.subject import Subject, positive
from rig.drawing.page import grid, legend_below
from rig.drawing.style import COLOURS, MAIN, Figure
from rig.errors import ConfigurationError
from rig.text.console import print_columns
from simulators.analysis import FrequencyResponses, frequency_response
from vibrolock.arrays import Complex, Float

_BELOW_LOWEST_MODE, _ABOVE_HIGHEST_MODE = 0.5, 1.2
"""Ends of the default range over the lowest and the highest mode; chosen."""
_AROUND_A_MODE = np.tan(np.linspace(-1.5, 1.5, 41))
"""Positions around a resonance in units of its half-width, dense where the phase turns."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Responses(Study):
    """Linear frequency responses in continuous time, at the inputs of the sensors."""

    found: FrequencyResponses
    """All responses as computed by `simulators.analysis`."""
    force_n_per_v: Complex
    """Stinger force per voltage [n]."""
    acceleration_per_v: dict[str, Complex]
    """Acceleration per voltage of each acceleration channel [n], (m/s^2)/V."""
    accelerance_per_kg: dict[str, Complex]
    """Acceleration per stinger force of each acceleration channel [n], (m/s^2)/N."""

    @property
    def title(self) -> str:
        """Title of the analysis."""
        f = self.found.frequency_hz
        return f"linear frequency responses, {f[0]:.4g} to {f[-1]:.4g} Hz, {f.size} points"

    def numbers(self) -> dict[str, object]:
        """Return the curves over the frequency."""
        return {
            "frequency_hz": self.found.frequency_hz,
            "force_n_per_v": self.force_n_per_v,
            "acceleration_m_s2_per_v": self.acceleration_per_v,
            "acceleration_m_s2_per_n": self.accelerance_per_kg,
            "displacement_m_per_v": self.found.displacement_m_per_v,
            "receptance_m_per_n": self.found.receptance_m_per_n,
        }

    def print_tables(self) -> None:
        """Print magnitudes and phases at the structure's modes within the range, and at both ends."""
        f, modes = self.found.frequency_hz, self.subject.rig.linear_modes.frequency_hz
        shown = sorted({0, f.size - 1} | {int(np.argmin(np.abs(f - m))) for m in modes if f[0] <= m <= f[-1]})
        drive = next(channel.name for channel in self.subject.bench.channels if channel.role == "drive")
        curves = {
            "force N/V": self.force_n_per_v,
            f"{drive} m/s^2/V": self.acceleration_per_v[drive],
            f"{drive} m/s^2/N": self.accelerance_per_kg[drive],
        }
        print("at the modes of the structure and at both ends, magnitude and phase in deg (all points with --json)")
        columns: list[tuple[str, str, Float]] = [("frequency Hz", ".4f", f[shown])]
        for name, curve in curves.items():
            columns.append((name, ".4g", np.abs(curve[shown])))
            columns.append(("phase", ".1f", 180.0 / np.pi * np.angle(curve[shown])))
        print_columns(*columns)

    def draw_on(self, page: Figure) -> None:
        """Draw magnitudes and phases; each channel has the same colour in all columns."""
        from matplotlib.ticker import MultipleLocator

        axes = grid(page, 2, 3, sharex=True, down_columns=True)
        columns = (
            ("force, N/V", {"force": self.force_n_per_v}),
            ("acceleration, (m/s²)/V", self.acceleration_per_v),
            ("acceleration, (m/s²)/N", self.accelerance_per_kg),
        )
        for (magnitude, phase), (title, curves) in zip(axes.T, columns, strict=True):
            for place, (name, curve) in enumerate(curves.items()):
                colour = MAIN if len(curves) == 1 and name == "force" else COLOURS[place % len(COLOURS)]
                magnitude.plot(self.found.frequency_hz, np.abs(curve), color=colour, lw=1.0, label=name)
                phase.plot(self.found.frequency_hz, np.degrees(np.unwrap(np.angle(curve))), color=colour, lw=1.0)
            magnitude.set(xscale="log", yscale="log", ylabel=title)
            phase.set(xlabel="frequency, Hz", ylabel=f"phase of {title.split(', ')[1]}, deg")
            low, high = phase.get_ylim()
            phase.yaxis.set_major_locator(MultipleLocator(90.0 if high - low < 900.0 else 360.0))
        legend_below(page, axes[0, 1])


def responses(
    subject: Subject, *, from_hz: float | None = None, to_hz: float | None = None, points: int = 500
) -> Responses:
    """Compute linear frequency responses at geometrically spaced frequencies, with more points around every resonance.

    By default the range is from half of the lowest mode to above the highest mode, at most a quarter of the sample rate.
    """
    rig, modes = subject.rig, subject.rig.linear_modes
    highest = min(_ABOVE_HIGHEST_MODE * modes.frequency_hz[-1], 0.25 * subject.bench.sample_rate_hz)
    lowest = _BELOW_LOWEST_MODE * float(min(modes.frequency_hz[modes.frequency_hz > 0.0]))
    low = positive("from_hz", lowest if from_hz is None else from_hz)
    high = positive("to_hz", max(highest, 2.0 * low) if to_hz is None else to_hz)
    if low >= high:
        raise ConfigurationError(field="from_hz", value=low, allowed=f"less than `to_hz` = {high:g}")
    row = [np.geomspace(low, high, checked_points(points, 2))]
    for several in (modes, rig.coupled_modes):
        for frequency_hz, damping_ratio in zip(several.frequency_hz, several.damping_ratio, strict=True):
            row.append(frequency_hz * (1.0 + damping_ratio * _AROUND_A_MODE))
    grid = np.unique(np.concatenate(row))
    with configuration_errors():
        found = frequency_response(rig, grid[(grid >= low) & (grid <= high)])
    where = {sensor.name: sensor.at for sensor in rig.sensors if sensor.at is not None}
    accelerances = found.accelerance_per_kg
    return Responses(
        subject=subject,
        notes=("elements at their linear stiffness, joints stuck; continuous time, without sensors and converters",),
        found=found,
        force_n_per_v=found.force_n_per_v,
        acceleration_per_v={name: found.sensor_per_v[name] for name in where},
        accelerance_per_kg={name: accelerances[at] for name, at in where.items()},
    )
