"""Rates at levels of the amplitude: how wide the local fits are, and what is random and what systematic in them.

Wide fits leave less noise and more curvature. Of several widths each level takes the one with the smallest sum of both; the
curvature is the difference to a fit of a higher degree, beyond its noise and averaged over neighbouring levels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.decays.local_fits import Rates, Series, rates_at
from identification.errors import IdentificationError

__all__ = ["LevelFits", "fitted_levels"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_HALF_WIDTHS = (0.12, 0.2, 0.32, 0.5, 0.75, 1.1)  # in ln(amplitude)
_NEIGHBOURS = 2
_WINDOW_SHARE = 0.2
"""Share of the correction for the window that counts as its error: the terms of the next order."""
_WORST = 0.25
"""Relative standard error of the damping above which a level is left out."""
_SHORTEST_PERIODS = 1.5  # half a fit, beside the window


@dataclass(frozen=True, eq=False)
class LevelFits:
    """Levels, the largest amplitude first; the fields are those of `identification.decays.result.DecayMode`."""

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
        """complex[n_levels]: what a slow quantity, ``values`` at the instants of the series, is at the levels."""
        reach = zip(self.time_s, self.reach_s, strict=True)
        return np.array([_local(series, values, at, at - 0.5 * width, at + 0.5 * width) for at, width in reach])


def fitted_levels(series: Series, number: int, order: int, load: Complex | None) -> LevelFits:
    """Fit at ``number`` levels in equal ratios; ``load`` complex[n]: ``phi_d^2 F / X`` at the instants of the series, 1/s^2."""
    envelope = _envelope(series)
    tops = np.linspace(envelope[0], envelope[-1], number + 2)[1:-1] if number > 1 else np.array([0.5 * (envelope[0] + envelope[-1])])
    if not envelope[0] > envelope[-1]:
        raise IdentificationError("samples: the vibration does not decay; give start_s and stop_s")
    falling = np.minimum.accumulate(envelope)
    centres = np.array([np.interp(-level, -falling, series.seen.at_s) for level in tops])
    tables = [_at_width(series, centres, tops, falling, width, order, load) for width in _HALF_WIDTHS]
    cost = np.array([table.cost() for table in tables])
    if not np.isfinite(cost).any():
        raise IdentificationError("samples: the decay is too short for a fit at any level; record at a higher level or longer")
    least = np.min(np.where(np.isfinite(cost), cost, np.inf), axis=0)
    keep = least < _WORST
    if not keep.any():
        raise IdentificationError(
            f"samples: the noise leaves the damping unknown by {100.0 * float(least.min()):.0f} % at every level; record at a "
            "higher level"
        )
    best = np.argmin(np.where(np.isfinite(cost), cost, np.inf), axis=0)
    chosen = [(tables[best[level]], level) for level in np.flatnonzero(keep)]
    picked = {name: np.array([getattr(table, name)[level] for table, level in chosen]) for name in _PICKED}
    return LevelFits(time_s=centres[keep], **picked)


_PICKED = tuple(name for name in LevelFits.__dataclass_fields__ if name != "time_s")


def _envelope(series: Series) -> Float:
    """float[n]: logarithm of the amplitude, smoothed by a spline of a few knots."""
    from scipy.interpolate import make_lsq_spline

    u = np.linspace(0.0, 1.0, series.seen.at_s.size)
    count = int(np.clip(series.seen.at_s.size // 12, 1, 24))
    inner = np.linspace(0.0, 1.0, count + 1)[1:-1]
    weight = 1.0 / np.sqrt(series.variance + series.variance.min() + 1e-300) if series.variance.max() > 0 else None
    knots = np.concatenate([np.zeros(4), inner, np.ones(4)])
    return np.asarray(make_lsq_spline(u, series.log.real, knots, 3, w=weight)(u))


@dataclass(frozen=True, eq=False)
class _Table:
    """All levels at one width; NaN where there is no fit."""

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

    def cost(self) -> Float:
        """float[n]: relative error of the damping and of the frequency, random and systematic."""
        damping = np.hypot(self.damping_std, self.damping_bound) / np.abs(self.damping)
        return np.asarray(damping)


def _at_width(
    series: Series, centres: Float, levels: Float, falling: Float, width: float, order: int, load: Complex | None
) -> _Table:
    rows = np.full((centres.size, 11), np.nan, np.complex128)
    for number, (centre, level) in enumerate(zip(centres, levels, strict=True)):
        turning = float(np.interp(centre, series.seen.at_s, series.seen.turning))
        least = _SHORTEST_PERIODS * 2.0 * np.pi / turning * max(1.0, series.seen.periods)
        early = min(float(np.interp(-(level + width), -falling, series.seen.at_s)), centre - least)
        late = max(float(np.interp(-(level - width), -falling, series.seen.at_s)), centre + least)
        fit = rates_at(series, centre, (early, late), order)
        if fit is not None:
            pull = 0.0j if load is None else complex(_local(series, load, centre, early, late))
            rows[number] = _row(fit, pull, late - early)
    real = rows.real
    misfit = _pooled(real[:, 10], np.median)
    scale = np.sqrt(np.maximum(misfit, 1.0))
    stds = real[:, 4:7] * scale[:, None]
    bounds = []
    for column in (0, 1):
        apart = rows[:, 7 + column]  # difference of the fits of two degrees, and its standard error times i
        square = np.abs(apart.real) ** 2 - (scale * apart.imag) ** 2
        bounds.append(np.sqrt(np.maximum(_pooled(square, np.mean), 0.0)) + _WINDOW_SHARE * np.abs(rows[:, 9].real if column else rows[:, 9].imag))
    return _Table(
        reach_s=real[:, 3] * 0.0 + real[:, 3],
        log=rows[:, 0],
        rate=rows[:, 1],
        stiffness=rows[:, 2].real,
        damping=rows[:, 2].imag,
        log_std=stds[:, 0],
        stiffness_std=stds[:, 1],
        damping_std=stds[:, 2],
        stiffness_bound=bounds[0],
        damping_bound=bounds[1],
    )


def _row(fit: Rates, pull: complex, reach_s: float) -> list[complex]:
    """Properties of one fit, errors to first order."""
    stiffness, damping = _properties(fit.rate, fit.change, pull)
    further = _properties(fit.rate + fit.further[1], fit.change + fit.further[2], pull)
    corrected = _properties(fit.rate - fit.correction, fit.change, pull)
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
        (corrected[1] - damping) + 1j * (corrected[0] - stiffness),
        fit.misfit,
    ]


def _properties(rate: complex, change: complex, pull: complex) -> tuple[float, float]:
    """Stiffness k (1/s^2) and damping c (1/s) from ``s^2 + s' + c s + k = pull``."""
    left = pull - rate**2 - change
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


def _pooled(values: Float, by) -> Float:  # type: ignore[no-untyped-def]
    """float[n]: ``by`` over each level and its neighbours, those without a fit left out."""
    out = np.full(values.size, np.nan)
    for number in range(values.size):
        near = values[max(0, number - _NEIGHBOURS) : number + _NEIGHBOURS + 1]
        near = near[np.isfinite(near)]
        if near.size and np.isfinite(values[number]):
            out[number] = by(near)
    return out
