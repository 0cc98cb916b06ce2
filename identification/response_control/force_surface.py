"""The force surface of a response-controlled test, and frequency responses at constant force cut from it.

A test that holds the displacement amplitude X of the drive point has no folds: at every level the structure responds like a
linear one. The levels together form a surface, the harmonic force over frequency and amplitude. Its contours are the
frequency responses at constant force, including turning points and unstable branches, although no controller stabilised these
(Karaagacli & Ozguven, Mech. Syst. Signal Process. 2021, harmonic force surfaces from response-controlled tests).

Here the surface is spanned by amplitude and phase lag instead of amplitude and frequency. At one lag the frequency and
``ln |F|`` are smooth and single-valued in ``ln X``, even if the resonance shifts by many bandwidths between two levels.
Levels are fitted one by one (`levels`); between levels, frequency and ``ln |F|`` are interpolated at the same lag.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.response_control.curves import ConstantForceCurve, Section, cut
from identification.response_control.levels import LevelFit, LevelPoints, best_degree, check_level, fit_level
from vibrolock.arrays import Float
from vibrolock.results import Result

LEAST_LEVELS = 3  # fewest levels that make a force surface; chosen
_SAME_LEVEL = 1e-6  # relative difference up to which two levels are one; chosen: rounding only
_LAGS_DEG = np.arange(30.0, 150.5, 1.0)  # deg; lags of a curve when none are given; chosen


@dataclass(frozen=True, eq=False)
class ForceSurface(Result):
    """Force and frequency over response level and phase lag, as fitted level by level; built by `force_surface`."""

    levels: tuple[LevelFit, ...]
    """Fits of the levels, smallest amplitude first."""
    specimen: str = ""

    @property
    def amplitude_m(self) -> Float:
        """float[n_levels]: peak of the displacement at the drive point, m."""
        return np.array([level.amplitude_m for level in self.levels])

    @property
    def fit_residual(self) -> Float:
        """float[n_levels]: relative RMS residual of the fit of each level."""
        return np.array([level.residual for level in self.levels])

    def section(self, phase_lag_deg: float) -> Section:
        """Return frequency and force, at a lag of the displacement behind the force, of the levels measured at that lag."""
        lag = float(np.radians(phase_lag_deg))
        found = [(level.amplitude_m, *level.at_lag(lag)) for level in self.levels]
        known = [one for one in found if np.isfinite(one[1])]
        amplitude, omega, stiffness = (np.array([one[i] for one in known], dtype=np.float64) for i in range(3))
        covariance = np.array([one[3] for one in known]).reshape(-1, 2, 2)
        return Section(lag, np.log(amplitude), omega, stiffness + np.log(amplitude), covariance)

    def at_lag(self, phase_lag_deg: float = 90.0) -> FrequencyResponse:
        """Return one point per level at a phase lag; at phase resonance, the default, a backbone (`single_point_mode`)."""
        section = self.section(phase_lag_deg)
        if not section.omega.size:
            raise IdentificationError("no level was measured there", field="phase_lag_deg", value=phase_lag_deg)
        force = np.exp(section.log_force + 1j * section.lag)
        amplitude = np.exp(section.log_amplitude)
        frequency = section.omega / (2.0 * np.pi)
        level, label = float(np.max(amplitude)), f"lag {phase_lag_deg:g} deg"
        return FrequencyResponse(frequency, force, amplitude, "displacement", "none", level, label, self.specimen)

    def next_level_m(self) -> float:
        """Displacement at which one more level is most informative: in the gap whose ends are interpolated worst.

        If the force has kinks over the amplitude, spacing half of the levels evenly and choosing the rest by this method is
        better than spacing all evenly.
        """
        worst, where = 0.0, float("nan")
        for section in (self.section(lag) for lag in _LAGS_DEG[:: _LAGS_DEG.size // 8]):
            if section.omega.size < LEAST_LEVELS:
                continue
            doubts, x = section.doubts(), section.log_amplitude
            scores = (doubts[:-1] + doubts[1:]) * np.diff(x)
            gap = int(np.argmax(scores))
            if scores[gap] >= worst:
                worst, where = float(scores[gap]), float(np.exp(0.5 * (x[gap] + x[gap + 1])))
        if not np.isfinite(where):
            raise IdentificationError(f"no lag was measured at {LEAST_LEVELS} of them", field="levels")
        return where

    def constant_force(self, force_n: float, phase_lags_deg: ArrayLike | None = None) -> ConstantForceCurve:
        """Compute the frequency response at a constant fundamental force, from below to above resonance.

        Raises `IdentificationError` if a value is out of its range, or no measured level has this force at any of the
        lags.

        Parameters
        ----------
        force_n
            Peak of the fundamental of the force.
        phase_lags_deg
            Lags of the displacement behind the force [n], rising, between 0 and 180. Default: 30 to 150 by 1.
        """
        lags = np.atleast_1d(np.asarray(_LAGS_DEG if phase_lags_deg is None else phase_lags_deg, dtype=np.float64))
        if lags.ndim != 1 or not np.all((lags > 0.0) & (lags < 180.0)) or np.any(np.diff(lags) <= 0.0):
            raise IdentificationError(field="phase_lags_deg", allowed="rising lags between 0 and 180")
        return cut(self.section, float(force_n), lags, self.specimen)


def force_surface(responses: Sequence[FrequencyResponse]) -> ForceSurface:
    """Fit the force surface of the response-controlled levels of a test.

    Raises `IdentificationError` if there are fewer than three levels, or if a level has fewer than four points or lies
    on one side of resonance only.

    Parameters
    ----------
    responses
        Measured levels at the drive point, by frequency or by lag, in any order; levels of the same nominal value (up and
        down) are combined. Levels that are not response-controlled raise an error. Points whose amplitude deviates from their
        level are corrected along the slope of the surface at the same lag.
    """
    for response in responses:
        if response.controlled != "response":
            reason = f"'{response.label}' held {response.controlled}, must hold the response"
            raise IdentificationError(reason, field="responses")
    points = _by_level(responses)
    if len(points) < LEAST_LEVELS:
        raise IdentificationError(f"{len(points)} levels", field="responses", allowed=f"at least {LEAST_LEVELS}")
    specimen = responses[0].specimen
    raw = ForceSurface(_fits(points), specimen)
    ordered = sorted(points, key=lambda one: float(np.median(one.amplitude_m)))
    return ForceSurface(_fits([_at_level(raw, one) for one in ordered]), specimen)


def _by_level(responses: Sequence[FrequencyResponse]) -> list[LevelPoints]:
    groups: list[list[FrequencyResponse]] = []
    for response in sorted(responses, key=lambda one: one.level):
        if groups and response.level <= groups[-1][0].level * (1.0 + _SAME_LEVEL):
            groups[-1].append(response)
        else:
            groups.append([response])
    return [
        LevelPoints(
            2.0 * np.pi * np.concatenate([one.frequency_hz for one in group]),
            np.concatenate([one.force / one.displacement_m for one in group]),
            np.concatenate([one.amplitude_m for one in group]),
        )
        for group in groups
    ]


def _fits(points: Sequence[LevelPoints]) -> tuple[LevelFit, ...]:
    for one in points:
        check_level(one, f"level {1e3 * float(np.median(one.amplitude_m)):.4g} mm")
    degree = best_degree(points)
    fits = [fit_level(one, degree) for one in points]
    fits.sort(key=lambda fit: fit.amplitude_m)
    for lower, upper in pairwise(fits):
        if upper.amplitude_m <= lower.amplitude_m * (1.0 + _SAME_LEVEL):
            reason = f"two levels have the same amplitude of {upper.amplitude_m:g} m"
            raise IdentificationError(reason, field="responses")
    return tuple(fits)


def _at_level(surface: ForceSurface, points: LevelPoints) -> LevelPoints:
    """Correct the points for their deviations from the level's amplitude, each along its own lag."""
    level = float(np.log(np.median(points.amplitude_m)))
    off = np.log(points.amplitude_m) - level
    moves = np.zeros((2, off.size))
    for k in np.flatnonzero(np.abs(off) > _SAME_LEVEL):
        section = surface.section(float(np.degrees(np.angle(points.stiffness[k]))))
        if section.omega.size > 1:
            moves[:, k] = section.slopes(float(np.clip(level, *section.log_amplitude[[0, -1]])))
    # the slope of ln|S| is the slope of ln|F| minus that of ln X, which is one
    return points.moved(moves[0] * off, np.where(moves[0] == 0.0, 0.0, moves[1] - 1.0) * off)
