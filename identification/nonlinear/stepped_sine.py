"""Modal frequency and damping from stepped-sine responses, one level at a time.

If the controller holds the response amplitude, stiffness and damping of the mode belong to that amplitude at every frequency
of the level. The response is then that of a linear mode, and one mode with constant w and z can be fitted to it. (Under force
control the amplitude varies along the level, and such a fit is not valid.) The dynamic stiffness S = F / X, with the
displacement X, obeys

    S exp(-i beta) = m (w^2 - W^2 + 2 i W w z),

where m is the apparent mass (``1 / (phi_force phi_response)``) and beta is the phase of the modal constant. For a given beta
this is linear in ``m w^2``, ``m`` and ``2 m w z``. After eliminating these, ``cos beta, sin beta`` is the eigenvector of the
smaller eigenvalue of a 2 x 2 matrix, so that the fit needs neither start values nor iterations. Equations are weighted by
``1 / |S|``, which suits noise in proportion to the force.

The apparent mass is that of a linear mode and so the same at all levels. Where stiffness or damping change with the lag (a
joint that other modes load, harmonics of the force), the slope over the frequency is not that of the mass alone: the fitted
mass moves away from that of the smallest level, and the damping by as much. The residual of one level does not show it.

beta is needed because damping localised in a joint makes the modal constant complex; a phase skew between the two sensors or
a drifting resonance has the same effect. With beta held at zero this mismatch would bias the modal frequency.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS, NonlinearMode
from vibrolock.arrays import Complex, Float

_LEVEL_TOLERANCE = 0.02  # relative deviation from the level up to which a point counts as held; chosen
_ENOUGH_POINTS = 5  # with fewer points the window is widened
_MIN_POINTS = 3  # six equations for four unknowns
_SAID_APART = 2e-4  # relative distance of phase resonance from the modal frequency above which a note is made


@dataclass(frozen=True)
class _LevelFit:
    """One mode fitted to one level: w in rad/s, z, m in kg, beta in rad, standard errors, relative RMS residual."""

    omega: float
    damping: float
    mass_kg: float
    beta: float
    omega_std: float
    damping_std: float
    residual: float
    widest_deg: float
    """Largest distance of a point from phase resonance, degrees."""


def stepped_sine_mode(
    responses: Sequence[FrequencyResponse], *, phase_window_deg: float = 60.0, complex_constant: bool = True
) -> NonlinearMode:
    """Identify a nonlinear mode from the response-controlled levels of a stepped-sine test.

    Returns one entry per level, in the given order; ``amplitude_m`` is the displacement of the measured response at
    its level, ``frequency_hz`` the modal frequency, ``phase_lag_deg`` is ``90 + beta``, ``force_n`` the fitted force
    at the modal frequency. ``modal_amplitude`` is NaN without a mass-normalised shape; the amplitudes of the measured
    point and ``apparent_mass_kg`` suffice to predict responses there. Power, purity and MAC are NaN, because
    fundamentals alone do not determine them. Random standard errors treat the residual of the fit as noise and are
    enlarged for few points: 1.96 standard errors are half of Student's 95 % interval. Systematic ones are the distance of
    phase resonance from the modal frequency where the modal constant is complex, and, for the damping, the relative
    difference of the apparent mass from that of the smallest level. Levels to which no mode can be fitted are left out
    and named in the notes.

    Raises `IdentificationError` if there are no response-controlled levels, or if every level has fewer than three
    usable points or no resonance.

    Parameters
    ----------
    responses
        Measured levels; levels that are not response-controlled are left out and counted in the notes.
    phase_window_deg
        Largest distance of the phase lag from 90 degrees; points farther away, or whose response is not within 2 % of the
        level, are left out. If fewer than five points remain, the five nearest to 90 degrees are used, at most 90 degrees
        away. At least three points are needed.
    complex_constant
        Whether the modal constant may be complex; False holds its phase beta at zero.
    """
    if not 0.0 < phase_window_deg <= 90.0:
        raise IdentificationError(field="phase_window_deg", value=phase_window_deg, allowed="above 0 to 90")
    levels = [item for item in responses if item.controlled == "response"]
    if not levels:
        kinds = ", ".join(sorted({item.controlled for item in responses})) or "no levels"
        raise IdentificationError(
            f"none is response-controlled ({kinds} given); a fit of one linear mode per level needs a "
            "constant response amplitude",
            field="responses",
        )
    fitted, refusals = _fitted(levels, phase_window_deg, complex_constant)
    left_out = len(responses) - len(levels)
    levels, fits = [level for level, _ in fitted], [fit for _, fit in fitted]
    unknown = np.full(len(fits), np.nan, np.complex128)
    omega, damping = np.array([fit.omega for fit in fits]), np.array([fit.damping for fit in fits])
    mass, beta = np.array([fit.mass_kg for fit in fits]), np.array([fit.beta for fit in fits])
    held = [np.median(np.abs(level.response)) for level in levels]
    motion = np.array(held) / omega ** np.array([MOTION_ORDER[level.kind] for level in levels])
    force = 2j * mass * np.exp(1j * beta) * damping * omega**2 * motion
    errors = _errors(fits, motion)
    return NonlinearMode(
        force_n=np.abs(force),
        frequency_hz=omega / (2.0 * np.pi),
        phase_lag_deg=np.degrees(np.angle(force)),
        amplitude_m=motion,
        modal_frequency_hz=omega / (2.0 * np.pi),
        damping_ratio=damping,
        **errors,
        apparent_mass_kg=mass,
        fit_residual=np.array([fit.residual for fit in fits]),
        force_harmonics=np.column_stack([unknown, force]),
        response_harmonics_m=np.column_stack([unknown, motion]),
        source="stepped sine",
        specimen=levels[0].specimen,
        notes=_notes(len(responses), left_out, refusals, fitted, phase_window_deg),
    )


def _errors(fits: Sequence[_LevelFit], motion: Float) -> dict[str, Any]:
    """Standard errors and intervals of modal frequency and damping, by field name of `NonlinearMode`."""
    omega, damping = np.array([fit.omega for fit in fits]), np.array([fit.damping for fit in fits])
    mass, beta = np.array([fit.mass_kg for fit in fits]), np.array([fit.beta for fit in fits])
    hertz = 0.5 / np.pi
    parts = {
        "modal_frequency_hz": (
            hertz * omega,
            hertz * np.array([fit.omega_std for fit in fits]),
            hertz * omega * np.abs(damping * np.tan(beta)),
        ),
        "damping_ratio": (
            damping,
            np.array([fit.damping_std for fit in fits]),
            damping * np.abs(mass / mass[int(np.argmin(motion))] - 1.0),
        ),
    }
    shape = (len(fits), len(QUANTITIES))
    systematic_std, random_std, interval_95 = (np.full(size, np.nan) for size in (shape, shape, (*shape, 2)))
    out = {"systematic_std": systematic_std, "random_std": random_std, "interval_95": interval_95}
    for name, (middle, random, systematic) in parts.items():
        column, std = QUANTITIES.index(name), np.hypot(random, systematic)
        systematic_std[:, column], random_std[:, column] = systematic, random
        interval_95[:, column] = np.column_stack([middle - 1.96 * std, middle + 1.96 * std])
        out[STANDARD_ERRORS[name]] = std
    return out


def _fitted(
    levels: Sequence[FrequencyResponse], window_deg: float, complex_constant: bool
) -> tuple[list[tuple[FrequencyResponse, _LevelFit]], list[str]]:
    """Return the levels with their fits, and why other levels have none; raise the first reason if no level has a fit."""
    fitted, refusals = [], []
    for level in levels:
        try:
            fitted.append((level, _fit_level(level, window_deg, complex_constant)))
        except IdentificationError as error:
            refusals.append(str(error))
    if not fitted:
        others = f" (no other of {len(levels)} levels fits either)" if len(refusals) > 1 else ""
        raise IdentificationError(refusals[0] + others)
    return fitted, refusals


def _used(level: FrequencyResponse, window_deg: float, name: str) -> NDArray[np.bool_]:
    """bool[n]: points held at their level and within the window; if these are few, those nearest to phase resonance."""
    held = np.abs(np.abs(level.response) / np.median(np.abs(level.response)) - 1.0) <= _LEVEL_TOLERANCE
    away_deg = np.where(held, np.abs(level.phase_lag_deg - 90.0), np.inf)
    used = away_deg <= window_deg
    if np.count_nonzero(used) < _ENOUGH_POINTS:
        used = np.zeros(held.size, bool)
        used[np.argsort(away_deg, kind="stable")[:_ENOUGH_POINTS]] = True
        used &= away_deg <= 90.0
    distinct = np.unique(level.frequency_hz[used]).size
    if distinct < _MIN_POINTS:
        reason = (
            f"points at {distinct} frequencies of {held.size} points have a lag of 0 to 180 deg and the "
            f"response at its level within {100 * _LEVEL_TOLERANCE:g} %"
        )
        raise IdentificationError(reason, where=name, allowed=f"at least {_MIN_POINTS}")
    return used


def _fit_level(level: FrequencyResponse, window_deg: float, complex_constant: bool) -> _LevelFit:
    """Fit m w^2, m and 2 m w z by weighted linear least squares, with beta eliminated; the module gives the equations."""
    name = f"level '{level.label}'" if level.label else f"level {level.level:g} {level.level_unit}"
    used = _used(level, window_deg, name)
    omega = 2.0 * np.pi * level.frequency_hz[used]
    stiffness = level.force[used] / level.displacement_m[used]
    scale = float(np.mean(omega))
    x = omega / scale
    weight = 1.0 / np.abs(stiffness)
    design = _stacked(np.column_stack([np.ones_like(x), -(x**2), 1j * x]) * weight[:, None])
    unit = stiffness * weight
    pair = _stacked(np.column_stack([unit, -1j * unit]))  # exp(-i beta) S = cos(beta) S + sin(beta) (-i S)
    solution = np.linalg.lstsq(design, pair, rcond=None)[0]
    turn = np.array([1.0, 0.0])
    if complex_constant:
        left = pair - design @ solution
        turn = np.linalg.eigh(left.T @ left)[1][:, 0]
    a, mass, c = solution @ turn
    if mass < 0.0:
        a, mass, c, turn = -a, -mass, -c, -turn
    if a <= 0.0 or c <= 0.0:
        raise IdentificationError("no damped resonance fits", where=name, hint="check sign and reference of the phase")
    w = float(np.sqrt(a / mass))
    z = float(c / (2.0 * mass * w))
    misfit = design @ np.array([a, mass, c]) - pair @ turn
    covariance = _covariance(x, w, z, mass, weight, misfit, complex_constant)
    return _LevelFit(
        omega=w * scale,
        damping=z,
        mass_kg=float(mass) / scale**2,
        beta=float(np.arctan2(turn[1], turn[0])),
        omega_std=float(np.sqrt(covariance[0, 0])) * scale,
        damping_std=float(np.sqrt(covariance[1, 1])),
        residual=float(np.linalg.norm(misfit) / np.sqrt(x.size)),
        widest_deg=float(np.max(np.abs(level.phase_lag_deg[used] - 90.0))),
    )


def _stacked(values: Complex | Float) -> Float:
    return np.concatenate([values.real, values.imag])


def _covariance(x: Float, w: float, z: float, mass: float, weight: Float, misfit: Float, turned: bool) -> Float:
    """Covariance of w, z, m (and beta), with the residual taken as white noise and Student's factor for few points."""
    from scipy.stats import t

    model = mass * (w**2 - x**2 + 2j * x * w * z)
    columns = [mass * (2.0 * w + 2j * x * z), 2j * mass * x * w, model / mass]
    if turned:
        columns.append(1j * model)
    jacobian = _stacked(np.column_stack(columns) * weight[:, None])
    freedom = misfit.size - len(columns)
    variance = float(np.sum(misfit**2)) / freedom * (float(t.ppf(0.975, freedom)) / 1.96) ** 2
    return np.asarray(variance * np.linalg.inv(jacobian.T @ jacobian))


def _notes(
    count: int,
    left_out: int,
    refusals: Sequence[str],
    fitted: Sequence[tuple[FrequencyResponse, _LevelFit]],
    window_deg: float,
) -> tuple[str, ...]:
    notes = ["modal amplitude, harmonics, power and MAC cannot be computed from the fundamentals of one point alone"]
    if left_out:
        notes.append(f"{left_out} of {count} levels left out: not response-controlled")
    notes += [f"left out: {why}" for why in refusals]
    widened = [fit.widest_deg for _, fit in fitted if fit.widest_deg > window_deg]
    if widened:
        notes.append(
            f"{len(widened)} of {len(fitted)} levels have fewer than {_ENOUGH_POINTS} points within {window_deg:g} deg of "
            f"phase resonance: points up to {max(widened):.0f} deg away are used"
        )
    # Force and velocity are in phase where the angle of w^2 - W^2 + 2 i W w z is 90 deg - beta, near W = w (1 - z tan beta).
    apart = max(abs(fit.damping * math.tan(fit.beta)) for _, fit in fitted)
    if apart > _SAID_APART:
        turned = max(abs(math.degrees(fit.beta)) for _, fit in fitted)
        notes.append(
            f"the modal constant turns by up to {turned:.1f} deg: phase resonance lies up to {100.0 * apart:.2f} % from the "
            "modal frequency, which its standard error includes"
        )
    for level, fit in fitted:
        if not level.frequency_hz.min() <= fit.omega / (2.0 * np.pi) <= level.frequency_hz.max():
            notes.append(
                f"level {level.level:g} {level.level_unit}: its modal frequency lies outside the measured range"
            )
    return tuple(notes)
