"""The backbone of a bench: vibrations at phase resonance over the level, by harmonic balance of the coupled rig."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.analysis.balance import Balance
from rig.analysis.levels import By, level_range
from rig.analysis.study import Study, length_unit, set_min_span
from rig.analysis.subject import Subject
from rig.drawing.areas import areas, is_narrow
from rig.drawing.style import COLOURS, MAIN, SECOND, Figure, SubFigure
from rig.errors import ConfigurationError
from rig.text.console import print_columns
from simulators.analysis import (
    HysteresisLoop,
    NotConvergedError,
    PeriodicResponses,
    hysteresis_loops,
)
from simulators.parts import FrictionSite

_MIN_NEGLECTED_PERCENT = 0.001  # smallest neglected part of the force that is given as a number, %; chosen
_ROUNDING_J = 1e-15  # energy below which a loop is closed by rounding, J; chosen


@dataclass(frozen=True, eq=False, kw_only=True)
class Backbone(Study):
    """Vibrations at phase resonance, and the hysteresis of the joints at three of them."""

    responses: PeriodicResponses
    """One point per level."""
    loops: dict[int, tuple[HysteresisLoop, ...]]
    """Loops of all friction joints, by the number of the point (lowest, middle and highest level); empty without joints."""

    @property
    def figure_in(self) -> tuple[float, float]:
        """Width and height of the figure, inches; it is taller if there are loops."""
        return (9.0, 8.6) if self.loops else (9.0, 6.4)

    @property
    def title(self) -> str:
        """Title of the analysis."""
        return f"backbone by harmonic balance, {self.responses.frequency_hz.size} levels"

    def numbers(self) -> dict[str, object]:
        """Return points and loops."""
        joints = [f"{joint.at} ({joint.kind})" for joint in self.subject.rig.friction]
        loops = [
            {"point": point, "joint": name, "dissipated_j": loop.dissipated_j, "loop": loop}
            for point, loops in self.loops.items()
            for name, loop in zip(joints, loops, strict=True)
        ]
        return {"points": self.responses, "frequency_shift": self.responses.frequency_shift, "loops": loops}

    def print_tables(self) -> None:
        """Print one line per level, in the form of a measured backbone."""
        r = self.responses
        unknown = [None] * r.frequency_hz.size
        ratios = [r.force_harmonic_ratio(h) if h < r.force_harmonics_n.shape[1] else unknown for h in (2, 3)]
        print_columns(
            ("force N", ".4f", r.force_n),
            ("voltage V", ".4f", r.voltage_v),
            ("frequency Hz", ".4f", r.frequency_hz),
            ("damping %", ".4f", 100.0 * r.damping_ratio),
            ("all harmonics %", ".4f", 100.0 * r.damping_ratio_total_power),
            ("amplitude mm", ".5f", 1e3 * r.amplitude_m),
            *((f"F{h}/F1", ".3f", ratio) for h, ratio in zip((2, 3), ratios, strict=True)),
        )
        print(f"modal frequency, largest amplitude over smallest: {100.0 * r.frequency_shift:+.2f} %")
        for point, loops in self.loops.items():
            lost = ", ".join(
                f"{joint.at} {loop.dissipated_j if loop.dissipated_j > _ROUNDING_J else 0.0:.3g}"
                for joint, loop in zip(self.subject.rig.friction, loops, strict=True)
            )
            print(f"lost per period in the joints at {r.force_n[point]:.4g} N, J: {lost}")

    def draw_on(self, page: Figure) -> None:
        """Draw frequency, damping, amplitude and harmonics over the level, and the loops."""
        found, loops, joints = self.responses, self.loops, self.subject.rig.friction
        upper, *below = areas(page, (4, len(loops) + 1) if loops else (4,), (2.0, 1.15) if loops else (1.0,))
        axes = upper.subplots(4, 1) if is_narrow(page) else upper.subplots(2, 2)
        frequency, damping, amplitude, harmonics = axes.ravel()
        scale, unit = length_unit(float(np.max(found.amplitude_m)))
        x = scale * found.amplitude_m
        frequency.plot(x, found.modal_frequency_hz, "o-", color=MAIN)
        frequency.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
        damping.plot(x, 100 * found.damping_ratio, "o-", color=MAIN, label="from the fundamental's power")
        total = 100 * found.damping_ratio_total_power
        damping.plot(x, total, "s--", color=SECOND, label="from the power of all harmonics")
        damping.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping, %")
        set_min_span(damping, np.concatenate([100 * found.damping_ratio, total]), 0.2)
        damping.legend(loc="best")
        amplitude.plot(found.force_n, x, "o-", color=MAIN)
        amplitude.set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement, {unit}")
        for harmonic, marker, colour in ((2, "^", MAIN), (3, "v", SECOND)):
            if harmonic < found.force_harmonics_n.shape[1]:
                ratio = found.force_harmonic_ratio(harmonic)
                harmonics.plot(found.force_n, ratio, marker + "-", color=colour, label=f"|F{harmonic}|/|F1|")
        harmonics.set(xlabel="force amplitude (fundamental), N", ylabel="harmonics of force")
        harmonics.set_ylim(bottom=0.0)
        harmonics.legend()
        for lower in below:
            _draw_loops(lower, found, loops, joints)


def backbone(
    subject: Subject,
    *,
    by: By = "force",
    lowest: float | None = None,
    highest: float | None = None,
    points: int = 15,
    harmonics: int = 15,
) -> Backbone:
    """Compute the backbone over geometrically spaced levels of force (peak of the fundamental, N) or voltage (V).

    By default ``highest`` is the level at which the bench's limits or the valid range of the rig end the backbone, and
    ``lowest`` a hundredth of it. Raises `ConfigurationError` for values that are not allowed, and if no vibration is found.
    """
    balance = Balance(subject, harmonics)
    levels = level_range(balance, by, lowest, highest, points)
    notes: list[str] = []
    try:
        found = balance.backbone(forces_n=levels) if by == "force" else balance.backbone(voltages_v=levels)
    except NotConvergedError as failure:
        if failure.found is None:
            raise ConfigurationError(f"no vibration at resonance found at the lowest level: {failure}") from failure
        found = failure.found
        notes.append(f"ends after {found.frequency_hz.size} of {levels.size} levels: {failure}")
    n = found.frequency_hz.size
    shown = sorted({0, n // 2, n - 1}) if subject.rig.friction else []
    return Backbone(
        subject=subject,
        notes=(*notes, *subject.limit_violations(found, "levels"), neglected_force(found)),
        complete=not notes,
        responses=found,
        loops={point: hysteresis_loops(subject.rig, found, point) for point in shown},
    )


def neglected_force(found: PeriodicResponses) -> str:
    """Return a remark on the part of the force above the balanced harmonics."""
    highest = found.force_harmonics_n.shape[1] - 1
    percent = 100.0 * float(np.max(found.neglected_share))
    text = f"up to {percent:.2g} %" if percent >= _MIN_NEGLECTED_PERCENT else f"less than {_MIN_NEGLECTED_PERCENT:g} %"
    return (
        f"force above harmonic {highest} is left out: {text} of the fundamental; balance more harmonics to include it"
    )


def _draw_loops(
    part: SubFigure,
    found: PeriodicResponses,
    loops: dict[int, tuple[HysteresisLoop, ...]],
    joints: Sequence[FrictionSite],
) -> None:
    """Draw one panel per level with the loops of all joints.

    The loops of the second half of the joints are dashed, because pairs of loops may coincide.
    """
    narrow = is_narrow(part.get_figure(root=True))
    axes = np.atleast_1d(part.subplots(len(loops), 1) if narrow else part.subplots(1, len(loops)))
    for axis, (point, several) in zip(axes, loops.items(), strict=True):
        largest = max(float(np.max(np.abs(loop.coordinate))) for loop in several)
        scale, words, force = _units(joints, largest)
        for place, (joint, loop) in enumerate(zip(joints, several, strict=True)):
            axis.plot(
                scale * loop.coordinate,
                loop.force,
                lw=1.2,
                ls="-" if 2 * place < len(joints) else (0, (4, 3)),
                color=COLOURS[place % len(COLOURS)],
                label=joint.at,
            )
        axis.set_title(f"at {found.force_n[point]:.3g} N")
        axis.set_xlabel(words)
        axis.locator_params(nbins=5)
        axis.set_ylabel(force if narrow or axis is axes[0] else "")
    part.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3 if narrow else 6)


def _units(joints: Sequence[FrictionSite], largest: float) -> tuple[float, str, str]:
    """Return scale factor and axis labels for the joints' coordinate and force."""
    if all(joint.relative_to_mode_1 for joint in joints):
        return 1e3, "joint coordinate, 1e-3 kg$^{1/2}$ m", "joint force, N/kg$^{1/2}$"
    if all(joint.quantity == "deflection" and not joint.relative_to_mode_1 for joint in joints):
        scale, unit = length_unit(largest)
        return scale, f"joint displacement, {unit}", "joint force, N"
    return 1.0, "joint coordinate, SI units", "joint force, SI units"
