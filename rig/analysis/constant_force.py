"""Response curves at constant force with their unstable branches, and the backbone through their maxima."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rig.analysis.backbone import neglected_force
from rig.analysis.balance import Balance
from rig.analysis.levels import checked_points, highest_resonance
from rig.analysis.study import Study, length_unit
from rig.analysis.subject import Subject, positive
from rig.drawing.page import grid, legend_below
from rig.drawing.steady_curve import UNSTABLE
from rig.drawing.style import REJECTED, SECOND, Axes, Figure, shade
from rig.errors import ConfigurationError
from rig.text.console import number, print_table
from simulators.analysis import NotConvergedError, PeriodicResponses
from vibrolock.arrays import Float

_DEFAULT_LEVELS = (0.1, 0.3, 1.0)
"""Default forces over that which the backbone reaches within the bench's limits; chosen."""
_LAGS_DEG = (-175.0, -5.0)
"""First and last phase lag of a curve, deg; chosen: 5 deg from the lags that are never reached."""
_RESONANCE_DEG = -90.0  # lag of the acceleration at phase resonance, deg
_BACKBONE_POINTS = 15  # points of the backbone; chosen


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstantForce(Study):
    """One response curve per force, along each of which the phase lag rises, and the backbone up to the highest force."""

    curves: dict[float, PeriodicResponses]
    """Curves by their force, peak of the fundamental in N."""
    resonances: PeriodicResponses
    """The backbone: vibrations at phase resonance."""

    @property
    def title(self) -> str:
        """Title of the analysis."""
        return f"responses at constant force, {', '.join(f'{force:.4g}' for force in self.curves)} N"

    def numbers(self) -> dict[str, object]:
        """Return the curves with their folds, and the backbone."""
        curves = [
            {"force_n": force, "folds_hz": folds_of(curve), "points": curve} for force, curve in self.curves.items()
        ]
        return {"curves": curves, "backbone": self.resonances}

    def print_tables(self) -> None:
        """Print one line per curve."""
        rows = []
        for force, curve in self.curves.items():
            top = int(np.argmax(curve.amplitude_m))
            resonance = int(np.argmin(np.abs(curve.phase_lag_deg - _RESONANCE_DEG)))
            folds = " to ".join(f"{fold:.4f}" for fold in folds_of(curve))
            rows.append(
                (
                    f"{force:.4f}",
                    number(curve.frequency_hz[resonance], ".4f"),
                    number(curve.amplitude_m[top], ".5f", 1e3),
                    number(curve.frequency_hz[top], ".4f"),
                    number(float(np.max(curve.voltage_v)), ".3f"),
                    folds or "none",
                )
            )
        headings = ("force N", "resonance Hz", "largest mm", "at Hz", "highest voltage V", "unstable between, Hz")
        print_table(headings, rows)

    def draw_on(self, page: Figure) -> None:
        """Draw amplitude and phase over frequency."""
        from matplotlib.lines import Line2D

        curves, resonances = self.curves, self.resonances
        top, bottom = grid(page, 2, 1, sharex=True, height_ratios=(2.0, 1.0))[:, 0]
        scale, unit = length_unit(max(float(np.max(curve.amplitude_m)) for curve in curves.values()))
        handles = []
        for place, (force, curve) in enumerate(curves.items()):
            colour = shade(place, len(curves))
            _branches(top, curve, scale * curve.amplitude_m, colour)
            _branches(bottom, curve, curve.phase_lag_deg, colour)
            handles.append(Line2D([], [], color=colour, label=f"{force:.4g} N"))
        if any(folds_of(curve) for curve in curves.values()):
            handles.append(Line2D([], [], color=REJECTED, ls=UNSTABLE, label="unstable"))
        top.plot(resonances.frequency_hz, scale * resonances.amplitude_m, "o-", lw=0.9, color=SECOND)
        handles.append(Line2D([], [], color=SECOND, marker="o", lw=0.9, label="phase resonance"))
        top.set_ylabel(f"displacement, {unit}")
        top.set_ylim(bottom=0.0)
        bottom.axhline(-90.0, color=SECOND, lw=0.9)
        bottom.set(xlabel="frequency, Hz", ylabel="acceleration lag, deg", yticks=(-180, -90, 0), ylim=(-185, 5))
        legend_below(page, handles=handles)


def constant_force(
    subject: Subject, forces_n: Sequence[float] = (), *, points: int = 141, harmonics: int = 15
) -> ConstantForce:
    """Compute response curves at constant fundamental force (N), with ``points`` phase lags each.

    By default the forces are a tenth, three tenths, and all of the force that the backbone reaches within the bench's limits.
    """
    lags = np.unique(np.append(np.linspace(*_LAGS_DEG, checked_points(points, 3)), _RESONANCE_DEG))
    balance = Balance(subject, harmonics)
    if not forces_n:
        path, last = highest_resonance(balance)
        forces_n = [float(f"{level * path.force_n[last]:.3g}") for level in _DEFAULT_LEVELS]
    curves, notes, failed = {}, [], []
    for force in sorted({positive("force_n", force) for force in forces_n}):
        try:
            curves[force] = balance.constant_force(force, lags)
        except NotConvergedError as failure:
            failed.append(f"{force:g} N: {failure}")
            if failure.found is not None:
                curves[force] = failure.found
    if not curves:
        raise ConfigurationError("; ".join(failed))
    for force, curve in curves.items():
        notes += [f"{force:g} N: {line}" for line in subject.limit_violations(curve)]
    largest = max(curves)
    resonances = balance.backbone(forces_n=np.linspace(largest / _BACKBONE_POINTS, largest, _BACKBONE_POINTS))
    return ConstantForce(
        subject=subject,
        notes=(*failed, *notes, f"{largest:g} N: {neglected_force(curves[largest])}"),
        complete=not failed,
        curves=curves,
        resonances=resonances,
    )


def folds_of(curve: PeriodicResponses) -> list[float]:
    """Return the frequencies (Hz), lowest first, between which the curve has an unstable branch; empty if it has none."""
    if curve.stable is None or np.all(curve.stable):
        return []
    unstable = curve.frequency_hz[~curve.stable]
    return [float(np.min(unstable)), float(np.max(unstable))]


def _branches(axis: Axes, curve: PeriodicResponses, values: Float, colour: object) -> None:
    """Draw stable parts solid and unstable parts dotted; the dots extend to the neighbouring stable points."""
    stable = np.ones(values.size, bool) if curve.stable is None else curve.stable
    for kind, style in ((True, "-"), (False, UNSTABLE)):
        mine = stable == kind
        if kind is False:  # the dots reach to the folds
            mine = mine | np.append(mine[1:], False) | np.append(False, mine[:-1])
        axis.plot(np.where(mine, curve.frequency_hz, np.nan), np.where(mine, values, np.nan), ls=style, color=colour)
