"""Figure of an exciter model: blocked force per volt and dynamic stiffness, with 95 % bands."""

from typing import TYPE_CHECKING

import numpy as np

from identification import Exciter
from identification.prediction.exciter import PARAMETERS
from rig.drawing.style import MAIN, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_exciter"]

_DRAWS = 400
_DECADES = 5.0


def draw_exciter(page: "Figure", exciter: Exciter) -> None:
    """Draw blocked force per volt and dynamic stiffness over the band in which the exciter was identified."""
    low = exciter.lowest_hz if np.isfinite(exciter.lowest_hz) else 5.0
    high = exciter.highest_hz if np.isfinite(exciter.highest_hz) else 500.0
    frequency = np.geomspace(low, high, 400)
    s = 2j * np.pi * frequency
    drawn = _draws(exciter)
    axes = page.subplots(2, 2, sharex=True)
    columns = (
        ("blocked force per volt", "N/V", exciter.force_per_volt(s), [each.force_per_volt(s) for each in drawn]),
        (
            "dynamic stiffness of the armature",
            "N/m",
            exciter.dynamic_stiffness(s),
            [e.dynamic_stiffness(s) for e in drawn],
        ),
    )
    for (size, phase), (name, unit, value, sampled) in zip(axes.T, columns, strict=True):
        size.semilogx(frequency, np.abs(value), color=MAIN)
        if np.abs(value).max() > _DECADES * np.abs(value).min():
            size.set_yscale("log")
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(value))), color=MAIN)
        if sampled:
            size.fill_between(frequency, *np.quantile(np.abs(sampled), (0.025, 0.975), axis=0), color=MAIN, alpha=0.25)
        size.set(ylabel=f"{name}, {unit}")
        phase.set(xlabel="frequency, Hz", ylabel="phase, deg")
    damping, error = exciter.damping_n_s_m
    known = f"{damping:.5g}" if not np.isfinite(error) else f"{damping:.5g} +- {1.96 * error:.2g}"
    facts = (
        f"mass {exciter.moving_mass_kg:.4g} kg, stiffness {exciter.suspension_stiffness_n_m:.4g} N/m, "
        f"damping of suspension and back-EMF {known} N s/m"
    )
    title(page, f"Exciter of {exciter.source or 'an unnamed rig'}, {low:g} to {high:g} Hz\n{facts}")


def _draws(exciter: Exciter) -> list[Exciter]:
    """Return exciters with parameters drawn from their covariance; an empty list if the covariance is unknown."""
    covariance = np.asarray(exciter.covariance)
    if not np.isfinite(covariance).all():
        return []
    values = np.random.default_rng(0).multivariate_normal(exciter.values, covariance, _DRAWS, method="eigh")
    return [Exciter(**dict(zip(PARAMETERS, row, strict=True))) for row in values.tolist()]
