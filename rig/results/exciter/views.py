"""Table and figure of an exciter model: force per volt, blocked force per volt and dynamic stiffness, with 95 % bands."""

from typing import Any

import numpy as np

from identification import Exciter
from identification.exciter_coupling import PARAMETERS
from rig.drawing.axes import ticks_at_1_2_5
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, title
from rig.results.kind import Table
from rig.text.console import number, print_table

_SHOWN = {
    "force_per_volt_n_v": ("force per volt, blocked", "N/V"),
    "coil_time_constant_s": ("time constant of the coil", "s"),
    "moving_mass_kg": ("moving mass", "kg"),
    "suspension_damping_n_s_m": ("damping of the suspension", "N s/m"),
    "suspension_stiffness_n_m": ("stiffness of the suspension", "N/m"),
    "back_emf_damping_n_s_m": ("damping by the back-EMF", "N s/m"),
    "damping_n_s_m": ("damping by both", "N s/m"),
    "stinger_compliance_m_n": ("compliance of the stinger", "m/N"),
    "stinger_damping_time_s": ("damping over stiffness of the stinger", "s"),
}


def _summarise(exciter: Exciter) -> dict[str, Any]:
    std = exciter.std
    found = {name: (getattr(exciter, name), std[name]) for name in PARAMETERS} | {
        "damping_n_s_m": exciter.damping_n_s_m
    }
    return {
        "specimen": exciter.source,
        "band_hz": [exciter.lowest_hz, exciter.highest_hz],
        "fit_residual": exciter.fit_residual,
        "parameters": {
            name: {"value": value, "std": error if np.isfinite(error) else None}
            for name, (value, error) in ((name, found[name]) for name in _SHOWN)
        },
        "notes": list(exciter.notes),
    }


def _say(summary: dict[str, Any]) -> None:
    low, high = summary["band_hz"]
    print(f"{low:g} to {high:g} Hz; residual {number(summary['fit_residual'], '.2f')} times that expected from noise")
    print_table(
        ("", "value", "+-", "unit"),
        [
            (_SHOWN[name][0], number(p["value"], ".5g"), number(p["std"], ".2g", 1.96), _SHOWN[name][1])
            for name, p in summary["parameters"].items()
        ],
    )


TABLE = Table(_summarise, _say)


_DRAWS = 400
"""Exciters drawn from the covariance for the 95 % band; chosen."""
_DECADES = 5.0
"""Largest over smallest value from which on the axis is logarithmic; chosen."""
_DOTS: dict[str, Any] = {"ls": "none", "marker": "o", "mew": 0.0, "color": REJECTED, "alpha": 0.5}


def draw_exciter(page: Figure, exciter: Exciter) -> None:
    """Draw measurement and model over the band in which the exciter was identified, with amplitude above phase.

    From left to right: force per volt on the rig, as measured and as the model gives it for the measured motion, with the
    residual and its noise; blocked force per volt; dynamic stiffness of the armature. The dots of the last two are what the
    measured force says of the one if the other is as fitted. A file without measured lines has no first column and no dots.
    """
    lines = exciter.lines
    low = exciter.lowest_hz if np.isfinite(exciter.lowest_hz) else 5.0
    high = exciter.highest_hz if np.isfinite(exciter.highest_hz) else 500.0
    frequency = np.geomspace(low, high, 400)
    drawn = _draws(exciter)
    axes = grid(page, 2, 2 if lines is None else 3, down_columns=True)
    if lines is not None:
        _on_the_rig(axes[0, 0], axes[1, 0], exciter)
    s = 2j * np.pi * frequency
    blocked, stiffness = (np.array([]), np.array([])) if lines is None else _each(exciter)
    for column, name, unit, measured, of in (
        (-2, "blocked force", "N/V", blocked, Exciter.force_per_volt),
        (-1, "stiffness", "N/m", stiffness, Exciter.dynamic_stiffness),
    ):
        size, phase = axes[:, column]
        if lines is not None:
            size.plot(lines.frequency_hz, np.abs(measured), **_DOTS)
            phase.plot(lines.frequency_hz, np.degrees(np.angle(measured)), **_DOTS)
        value = of(exciter, s)
        _modelled(size, phase, frequency, value, [of(one, s) for one in drawn])
        size.set(ylabel=f"{name}, {unit}")
        phase.set(ylabel=f"{name.removesuffix(' force')} phase, deg")
    for axis in axes.ravel():
        axis.set(xscale="log", xlabel="frequency, Hz")
        ticks_at_1_2_5(axis)
    _explain(axes[0, -2], bool(drawn), lines is not None)
    title(page, _title(exciter, low, high))


def _on_the_rig(size: Axes, phase: Axes, exciter: Exciter) -> None:
    lines = exciter.lines
    assert lines is not None
    f, measured = lines.frequency_hz, lines.force_per_volt
    modelled = exciter.force(1.0, lines.acceleration_per_volt, f)
    size.loglog(f, np.abs(measured), **_DOTS, label="measured")
    size.plot(f, np.abs(modelled), color=MAIN, label="model")
    size.plot(f, np.abs(measured - modelled), marker=".", ls="none", mew=0.0, color=SECOND, label="residual")
    size.plot(f, lines.noise, "--", color="black", lw=0.9, label="noise")
    phase.plot(f, np.degrees(np.angle(measured)), **_DOTS)
    phase.plot(f, np.degrees(np.angle(modelled)), color=MAIN)
    size.set(ylabel="force, N/V")
    phase.set(ylabel="force phase, deg")
    size.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)


def _each(exciter: Exciter) -> tuple[np.ndarray, np.ndarray]:
    """Return blocked force per volt and stiffness, complex[n_lines], from each measured line with the other as fitted."""
    lines = exciter.lines
    assert lines is not None
    s = 2j * np.pi * lines.frequency_hz
    armature = lines.acceleration_per_volt / s**2 + exciter.stinger_compliance(s) * lines.force_per_volt
    path = exciter.path.factor(lines.frequency_hz)
    blocked = (lines.force_per_volt + exciter.dynamic_stiffness(s) * armature) / path
    return blocked, (exciter.force_per_volt(s) * path - lines.force_per_volt) / armature


def _modelled(size: Axes, phase: Axes, frequency: np.ndarray, value: np.ndarray, drawn: list[np.ndarray]) -> None:
    size.plot(frequency, np.abs(value), color=MAIN)
    if np.abs(value).max() > _DECADES * np.abs(value).min():
        size.set_yscale("log")
    else:
        size.set_ylim(0.0, 1.4 * np.abs(value).max())
    phase.plot(frequency, np.degrees(np.angle(value)), color=MAIN)
    if drawn:
        size.fill_between(frequency, *np.quantile(np.abs(drawn), (0.025, 0.975), axis=0), color=MAIN, alpha=0.25, lw=0)
    phase.set(ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))


def _explain(axis: Axes, band: bool, dots: bool) -> None:
    axis.plot([], [], color=MAIN, label="model")
    if band:
        axis.fill([], [], color=MAIN, alpha=0.25, lw=0, label="95 % of the fit")
    if dots:
        axis.plot([], [], **_DOTS, label="each measured line, rest as fitted")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, borderaxespad=0.2)


def _title(exciter: Exciter, low: float, high: float) -> str:
    damping, error = exciter.damping_n_s_m
    known = f"{damping:.5g}" if not np.isfinite(error) else f"{damping:.5g} ± {1.96 * error:.2g}"
    missing = "" if exciter.lines is not None else "; the file holds no measured lines"
    return (
        f"Exciter of {exciter.source or 'an unnamed rig'}, {low:g} to {high:g} Hz; "
        f"moving mass {exciter.moving_mass_kg:.4g} kg, suspension {exciter.suspension_stiffness_n_m:.4g} N/m, "
        f"damping (suspension and back-EMF) {known} N s/m{missing}"
    )


def _draws(exciter: Exciter) -> list[Exciter]:
    """Return exciters with parameters drawn from their covariance; an empty list if the covariance is unknown."""
    covariance = np.asarray(exciter.covariance)
    if not np.isfinite(covariance).all():
        return []
    values = np.random.default_rng(0).multivariate_normal(exciter.values, covariance, _DRAWS, method="eigh")
    return [Exciter(**dict(zip(PARAMETERS, row, strict=True))) for row in values.tolist()]
