"""Sections of a force surface at one lag, and curves at constant force through them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.validation import positive
from vibrolock.arrays import Float
from vibrolock.results import Result

_LAG_STEP_DEG = 0.5
"""Half step of the finite differences that show where the frequency falls with the lag."""


@dataclass(frozen=True, eq=False)
class Section:
    """Levels of a surface at one lag: frequency W (rad/s) and ``ln |F|`` over ``ln X``, each [n_levels]."""

    lag: float
    log_amplitude: Float
    omega: Float
    log_force: Float
    covariance: Float
    """Covariance of W and ``ln |F|`` of every level [n_levels, 2, 2]; levels are independent."""

    def thinned(self) -> "Section":
        """Return every second level and the last."""
        keep = np.arange(self.omega.size) % 2 == 0
        keep[-1:] = True
        arrays = ("log_amplitude", "omega", "log_force", "covariance")
        return replace(self, **{name: getattr(self, name)[keep] for name in arrays})

    def doubts(self) -> Float:
        """Deviation of each level's ``ln |F|`` from the interpolation of the other levels [n_levels]; zero at the ends."""
        doubts = np.zeros(self.omega.size)
        for k in range(1, self.omega.size - 1):
            others = np.delete(self.log_amplitude, k), np.delete(self.log_force, k)
            doubts[k] = abs(_interpolant(*others)(self.log_amplitude[k]) - self.log_force[k])
        return doubts

    @cached_property
    def _omega(self) -> Any:
        return _interpolant(self.log_amplitude, self.omega)

    @cached_property
    def _log_force(self) -> Any:
        return _interpolant(self.log_amplitude, self.log_force)

    def slopes(self, log_amplitude: float) -> tuple[float, float]:
        """``d(W, ln |F|) / d ln X`` at one amplitude."""
        return float(self._omega(log_amplitude, 1)), float(self._log_force(log_amplitude, 1))

    def amplitudes_at(self, log_force: float) -> Float:
        """All ``ln X`` at which the force has a value, within the levels."""
        if self.omega.size < 2:
            return np.empty(0)
        roots = self._log_force.solve(log_force, extrapolate=False)
        return np.asarray(roots[np.isfinite(roots)], dtype=np.float64)

    def omega_at(self, log_amplitude: float) -> float:
        """W (rad/s) at one amplitude."""
        return float(self._omega(log_amplitude))

    def variances(self, log_amplitude: float) -> tuple[float, float]:
        """Variances of W and of ``ln X`` at constant force, from those of the levels."""
        shares = _linear_shares(self.log_amplitude, log_amplitude)
        by_amplitude, force_slope = self.slopes(log_amplitude)
        # at constant force d ln X = -d ln|F| / slope, and W changes with ln X
        change = np.array([[1.0, -by_amplitude / force_slope], [0.0, -1.0 / force_slope]])
        covariance = change @ np.einsum("l,lij->ij", shares**2, self.covariance) @ change.T
        return float(covariance[0, 0]), float(covariance[1, 1])


@dataclass(frozen=True, eq=False)
class ConstantForceCurve(Result):
    """A frequency response at constant force cut from a force surface; points in the order of the lag."""

    response: FrequencyResponse
    """Frequency, force and displacement at the drive point [n]; the phase of the displacement is zero."""
    frequency_std_hz: Float
    """Standard error [n] from the scatter of the measured points about the fits of their levels."""
    amplitude_std_m: Float
    """Standard error of the displacement [n], from the same scatter."""
    frequency_change_hz: Float
    """Change of the frequency [n] if every second level is left out; NaN where too few levels remain.

    It is an upper bound of the error of the interpolation between levels, in practice by a large margin.
    """
    amplitude_change: Float
    """Relative change of the displacement [n] if every second level is left out."""
    stable: NDArray[np.bool_]
    """Whether the point [n] is stable under constant force and frequency: the frequency rises with the lag."""
    notes: tuple[str, ...] = ()
    """Notes on where the curve ends and why."""


def cut(section_at: Callable[[float], Section], force_n: float, lags_deg: Float, specimen: str) -> ConstantForceCurve:
    """Return the curve at ``force_n`` through the sections at ``lags_deg``; raise `IdentificationError` if there is none."""
    target = float(np.log(positive("force_n", force_n, "N")))
    sections = [section_at(float(lag)) for lag in lags_deg]
    amplitude, several = _followed(sections, target, int(np.argmin(np.abs(lags_deg - 90.0))))
    on = np.flatnonzero(np.isfinite(amplitude))
    if not on.size:
        raise IdentificationError(_reach(sections), field="force_n", value=force_n)
    sections, lags_deg, missing, amplitude = [sections[k] for k in on], lags_deg[on], _left(lags_deg, on), amplitude[on]
    omega = np.array([one.omega_at(u) for one, u in zip(sections, amplitude, strict=True)])
    variances = np.array([one.variances(u) for one, u in zip(sections, amplitude, strict=True)])
    thinned = [one.thinned() for one in sections]
    fewer = np.array([_nearest(one.amplitudes_at(target), u) for one, u in zip(thinned, amplitude, strict=True)])
    moved = [one.omega_at(u) if np.isfinite(u) else np.nan for one, u in zip(thinned, fewer, strict=True)]
    frequency, displacement = omega / (2.0 * np.pi), np.exp(amplitude)
    force = np.asarray(force_n * np.exp(1j * np.radians(lags_deg)), dtype=np.complex128)
    motion = displacement.astype(np.complex128)
    label = f"{force_n:g} N"
    return ConstantForceCurve(
        FrequencyResponse(frequency, force, motion, "displacement", "force", force_n, label, specimen),
        frequency_std_hz=np.sqrt(variances[:, 0]) / (2.0 * np.pi),
        amplitude_std_m=np.sqrt(variances[:, 1]) * displacement,
        frequency_change_hz=np.abs(np.array(moved) - omega) / (2.0 * np.pi),
        amplitude_change=np.abs(np.expm1(fewer - amplitude)),
        stable=_rising(section_at, sections, target, lags_deg, amplitude),
        notes=(*missing, *several),
    )


def _followed(sections: list[Section], target: float, first: int) -> tuple[Float, tuple[str, ...]]:
    """Return ``ln X`` at every lag, followed from resonance outwards by continuity, and a note on further solutions."""
    roots = [section.amplitudes_at(target) for section in sections]
    amplitude = np.full(len(sections), np.nan)
    for order in (range(first, len(sections)), range(first - 1, -1, -1)):
        known = amplitude[first]
        for k in order:
            amplitude[k] = _nearest(roots[k], known)
            known = amplitude[k] if np.isfinite(amplitude[k]) else known
    extra = [np.degrees(section.lag) for section, found in zip(sections, roots, strict=True) if found.size > 1]
    if not extra:
        return amplitude, ()
    return amplitude, (
        f"lags {min(extra):.0f} to {max(extra):.0f} deg: the force has several amplitudes, one is followed",
    )


def _nearest(roots: Float, known: float) -> float:
    """Return the root nearest to ``known``, or the largest if ``known`` is NaN; NaN if there are no roots."""
    if not roots.size:
        return float("nan")
    return float(roots[np.argmin(np.abs(roots - known))] if np.isfinite(known) else np.max(roots))


def _rising(
    section_at: Callable[[float], Section], sections: list[Section], target: float, lags_deg: Float, amplitude: Float
) -> Any:
    """Return whether the frequency rises with the lag along the curve [n], by finite differences at every point."""
    rising = np.ones(lags_deg.size, dtype=np.bool_)
    for k, (lag, here, known) in enumerate(zip(lags_deg.tolist(), sections, amplitude, strict=True)):
        ends = []
        for section in (section_at(lag - _LAG_STEP_DEG), here, section_at(lag + _LAG_STEP_DEG)):
            u = _nearest(section.amplitudes_at(target), known)
            if np.isfinite(u):
                ends.append(section.omega_at(u))
        rising[k] = len(ends) < 2 or ends[-1] > ends[0]
    return rising


def _left(lags_deg: Float, on: NDArray[np.int64]) -> tuple[str, ...]:
    off = np.delete(lags_deg, on)
    if not off.size:
        return ()
    return (
        f"{off.size} of {lags_deg.size} lags left out ({off.min():g} to {off.max():g} deg): the force meets no measured level "
        f"there",
    )


def _reach(sections: list[Section]) -> str:
    """Describe the range of forces at the lag with the most levels."""
    best = max(sections, key=lambda one: one.omega.size)
    if best.omega.size < 2:
        return "fewer than two levels were measured at any of the lags"
    forces = np.exp(best.log_force)
    return f"levels at lag {np.degrees(best.lag):.0f} deg hold {forces.min():.4g} to {forces.max():.4g} N"


def _linear_shares(x: Float, at: float) -> Float:
    """Weights of the two neighbours of ``at`` in ``x`` in a linear interpolation."""
    upper = int(np.clip(np.searchsorted(x, at), 1, x.size - 1))
    shares = np.zeros(x.size)
    shares[upper] = (at - x[upper - 1]) / (x[upper] - x[upper - 1])
    shares[upper - 1] = 1.0 - shares[upper]
    return shares


def _interpolant(x: Float, values: Float) -> Any:
    """Return the monotone piecewise cubic through ``values`` [n, ...] over rising ``x`` (Fritsch & Carlson 1980).

    Joints that begin to slip cause kinks in the force over the amplitude, next to which a spline oscillates; on the friction
    beam this doubles the error. Where the force rises from level to level, each force has a single solution.
    """
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(x, values, extrapolate=False)
