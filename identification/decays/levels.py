"""Rates at levels of the amplitude: how wide the local fits are, and what is random and what systematic in them.

Wide fits leave less noise and more curvature. Of several widths each level takes the one with the smallest sum of both; the
curvature is the difference to a fit of a higher degree, beyond its noise and averaged over neighbouring levels.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from identification.decays.local_fits import Rates, Series, rates_at
from identification.errors import IdentificationError
from identification.slow_flows.fits import neighbours
from vibrolock.arrays import Complex, Float

_HALF_WIDTHS = (0.12, 0.2, 0.32, 0.5, 0.75, 1.1)  # in ln(amplitude)
_COLUMNS = 11
"""Columns of the table of fits at all levels."""
_WINDOW_SHARE = 0.2
"""Share of the correction for the window that counts as its error: the terms of the next order."""
_WORST = 0.25
"""Relative standard error of the damping above which a level is left out."""
_SHORTEST_PERIODS = 1.5  # half a fit, beside the window


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelFits:
    """Fits at n levels; NaN where there is none.

    ``time_s``, ``reach_s`` float[n]: instants, and lengths of the fits; ``log``, ``rate`` complex[n]: L and s;
    ``stiffness`` (1/s^2), ``damping`` (1/s) float[n]; ``log_std``, ``stiffness_std``, ``damping_std``: random standard errors;
    ``stiffness_bound``, ``damping_bound``: bounds of systematic errors.
    """

    time_s: Float
    reach_s: Float
    log: Complex
    rate: Complex
    stiffness: Float
    damping: Float
    log_std: Float
    stiffness_std: Float
    damping_std: Float
    stiffness_bound: Float
    damping_bound: Float

    def local(self, series: Series, values: Complex) -> Complex:
        """complex[n]: what a slow quantity, ``values`` at the instants of the series, is at the levels."""
        reach = zip(self.time_s, self.reach_s, strict=True)
        return np.array([_local(series, values, at, at - 0.5 * width, at + 0.5 * width) for at, width in reach])

    @property
    def cost(self) -> Float:
        """float[n]: relative error of the damping, random and systematic; infinite where there is no fit."""
        error = np.hypot(self.damping_std, self.damping_bound) / np.abs(self.damping)
        return np.where(np.isfinite(error), error, np.inf)


def fitted_levels(series: Series, number: int, order: int) -> LevelFits:
    """Fit at ``number`` levels in equal ratios, the largest first; levels with too much noise are left out.

    ``order``: how often the signal is differentiated against the displacement.
    """
    envelope = _envelope(series)
    if not envelope[0] > envelope[-1]:
        raise IdentificationError("the vibration does not decay", field="samples", hint="give `start_s` and `stop_s`")
    levels = np.linspace(envelope[0], envelope[-1], number + 2)[1:-1]
    falling = np.minimum.accumulate(envelope)
    centres = np.array([np.interp(-level, -falling, series.seen.at_s) for level in levels])
    tables = [_at_width(series, centres, levels, falling, width, order) for width in _HALF_WIDTHS]
    cost = np.array([table.cost for table in tables])
    least = cost.min(axis=0)
    if not np.isfinite(least).any():
        reason = "the decay is too short for a fit at any level; record it longer, or from a higher level"
        raise IdentificationError(reason, field="samples")
    keep = np.flatnonzero(least < _WORST)
    if not keep.size:
        raise IdentificationError(
            f"the noise leaves the damping uncertain by {100.0 * float(least.min()):.0f} % at every level; "
            "record from a higher level",
            field="samples",
        )
    best = cost.argmin(axis=0)
    names = [entry.name for entry in fields(LevelFits)]
    return LevelFits(**{name: np.array([getattr(tables[best[n]], name)[n] for n in keep]) for name in names})


def _envelope(series: Series) -> Float:
    """float[n]: logarithm of the amplitude, smoothed by a spline of a few knots."""
    from scipy.interpolate import make_lsq_spline

    u = np.linspace(0.0, 1.0, series.seen.at_s.size)
    count = int(np.clip(series.seen.at_s.size // 12, 1, 24))
    inner = np.linspace(0.0, 1.0, count + 1)[1:-1]
    weight = 1.0 / np.sqrt(series.variance + series.variance.min() + 1e-300) if series.variance.max() > 0 else None
    knots = np.concatenate([np.zeros(4), inner, np.ones(4)])
    return np.asarray(make_lsq_spline(u, series.log.real, knots, 3, w=weight)(u))


def _at_width(series: Series, centres: Float, levels: Float, falling: Float, width: float, order: int) -> LevelFits:
    rows = np.full((centres.size, _COLUMNS), np.nan, np.complex128)
    for number, (centre, level) in enumerate(zip(centres, levels, strict=True)):
        turning = float(np.interp(centre, series.seen.at_s, series.seen.turning))
        least = _SHORTEST_PERIODS * 2.0 * np.pi / turning * series.seen.periods
        early = min(float(np.interp(-(level + width), -falling, series.seen.at_s)), centre - least)
        late = max(float(np.interp(-(level - width), -falling, series.seen.at_s)), centre + least)
        fit = rates_at(series, centre, (early, late), order)
        if fit is not None:
            rows[number] = _row(fit, late - early)
    scale = np.sqrt(np.maximum(_pooled(rows[:, 9].real, np.median), 1.0))
    random = rows[:, 4:7].real * scale[:, None]
    bounds = []
    for apart, window in ((rows[:, 7], rows[:, 10].real), (rows[:, 8], rows[:, 10].imag)):
        beyond_noise = apart.real**2 - (scale * apart.imag) ** 2
        bounds.append(np.sqrt(np.maximum(_pooled(beyond_noise, np.mean), 0.0)) + _WINDOW_SHARE * np.abs(window))
    return LevelFits(
        time_s=centres,
        reach_s=rows[:, 3].real,
        log=rows[:, 0],
        rate=rows[:, 1],
        stiffness=rows[:, 2].real,
        damping=rows[:, 2].imag,
        log_std=random[:, 0],
        stiffness_std=random[:, 1],
        damping_std=random[:, 2],
        stiffness_bound=bounds[0],
        damping_bound=bounds[1],
    )


def _row(fit: Rates, reach_s: float) -> list[complex]:
    """Return the columns of a table of fits.

    L, s, ``k + i c``, the length, standard errors of ln(amplitude), k and c, the differences of k and of c to the fit of higher
    degree with their standard errors times i, the misfit, and the effect of the window on ``k + i c``.
    """
    stiffness, damping = _properties(fit.rate, fit.change)
    further = _properties(fit.rate + fit.further[1], fit.change + fit.further[2])
    corrected = _properties(fit.rate - fit.correction, fit.change)
    omega = fit.rate.imag
    on_damping = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 1.0 / omega]])  # by real and by imaginary parts of L, s, s'
    on_stiffness = np.array([[0.0, damping + 2.0 * fit.rate.real, 1.0], [0.0, 2.0 * omega, 0.0]])

    def std(by: Float, covariance: Float) -> float:
        return float(np.sqrt(max(np.einsum("pi,ij,pj->", by, covariance, by), 0.0)))

    return [
        fit.log,
        fit.rate,
        stiffness + 1j * damping,
        reach_s,
        float(np.sqrt(max(fit.covariance[0, 0], 0.0))),
        std(on_stiffness, fit.covariance),
        std(on_damping, fit.covariance),
        further[0] - stiffness + 1j * std(on_stiffness, fit.further_covariance),
        further[1] - damping + 1j * std(on_damping, fit.further_covariance),
        fit.misfit,
        corrected[0] - stiffness + 1j * (corrected[1] - damping),
    ]


def _properties(rate: complex, change: complex) -> tuple[float, float]:
    """Stiffness k (1/s^2) and damping c (1/s) from ``s^2 + s' + c s + k = 0``."""
    left = -(rate**2) - change
    damping = left.imag / rate.imag
    return float(left.real - damping * rate.real), float(damping)


def _local(series: Series, load: Complex, centre: float, early: float, late: float) -> complex:
    """Value of the load at an instant, by a parabola."""
    near = (series.seen.at_s >= early) & (series.seen.at_s <= late)
    half = max(late - centre, centre - early)
    u = (series.seen.at_s[near] - centre) / half
    root = np.sqrt(np.maximum(1.0 - u**2, 1e-9))
    design = np.vander(u, 3, increasing=True) * root[:, None]
    return complex(np.linalg.lstsq(design.astype(np.complex128), load[near] * root, rcond=None)[0][0])


def _pooled(values: Float, by: Callable[..., Any]) -> Float:
    """float[n]: ``by`` over each level and its neighbours, those without a fit left out."""
    out = np.full(values.size, np.nan)
    for number, near in enumerate(neighbours(values.size)):
        if np.isfinite(values[number]):
            out[number] = by(values[near][np.isfinite(values[near])])
    return out
