"""Fit of the plant near one mode to measured frequency responses from voltage."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from controller.tuning.plant_errors import parameter_covariance
from vibrolock.arrays import Complex, Float
from vibrolock.errors import InputError

NO_RESONANCE = "force_per_v, acceleration_per_v: their ratio shows no damped resonance inside the band"
UNRESOLVED = 3.0  # lines: width of a resonance below which its damping cannot be told from noise
NARROWEST = 0.2  # of the spacing of the lines: width from which the fit begins then
NO_MODE = 0.15
"""Largest relative misfit of the residual terms alone at which the accelerance counts as showing no mode.

If the residuals of other modes explain the accelerance to within this fraction, there is no mode inside the band: the
equations for the pole then contain only noise or rounding. With a mode inside the band the misfit is 0.8 or more."""
MOST_STEPS = 300
"""Of a fit that creeps along what the lines hardly determine; others take some ten."""
UNDETERMINED = 1e3  # standard error over alpha, where the lines say nothing of it


def fitted(
    frequency_hz: ArrayLike,
    force_per_v: ArrayLike,
    acceleration_per_v: ArrayLike,
    force_std: ArrayLike | None = None,
    acceleration_std: ArrayLike | None = None,
    covariance: ArrayLike | None = None,
    *,
    exciter_prior: float | None = None,
) -> dict[str, Any]:
    """Fit the FRFs [n] in a band around one mode; return the identified fields of a `PlantModel`.

    The mode is taken at the peak of the accelerance. Linear least squares give the start values: for the accelerance by the
    iteration of Sanathanan and Koerner (1963), for the exciter from ``1 = alpha H_F + beta H_A``. Nonlinear least squares then
    fit both FRFs, weighted by their standard deviations ([n] or one number each; by default the root mean square of each FRF).
    Near one mode, with small residuals, force and motion of the exciter cannot be separated: ``beta + x (z^2 + 2 D w z +
    w^2)/z^2`` with ``alpha - x phi_d^2`` has the same FRFs for any x, for an attached mass whose spring tunes it to the mode is
    not seen. ``exciter_prior`` then decides: it is the standard deviation of the exciter's spring, and of its jerk term,
    relative to its moving mass. It counts little where the data decide. None: no prior.

    Coefficients are real, so that ``H(-i w)`` is the conjugate of ``H(i w)`` by construction.

    ``covariance`` complex[n, 2, 2] is that of the errors of both FRFs, ``E[e e^H]`` line by line: it gives the standard errors
    of the mode, increased where the model fits worse than the noise explains (`controller.tuning.plant_errors`). Without it
    the noise is taken from the residuals.

    Raises `ValueError` if the FRFs or their covariance are not finite, differ in length, have too few lines, or show
    no resonance of the structure.
    """
    from scipy.optimize import least_squares

    frequency, h_f, h_a = _checked(frequency_hz, force_per_v, acceleration_per_v)
    s: Complex = 2j * np.pi * frequency.astype(np.complex128)
    weight_f = 1.0 / np.broadcast_to(_rms(h_f) if force_std is None else np.asarray(force_std, float), h_f.shape)
    weight_a = 1.0 / np.broadcast_to(_rms(h_a) if acceleration_std is None else np.asarray(acceleration_std), h_a.shape)
    errors = _checked_covariance(covariance, frequency.size)
    centre, start = _start(s, h_f, h_a)

    def residuals(x: Float) -> Float:
        model_f, model_a = _model(x, s, centre)
        error = np.concatenate([(model_f - h_f) * weight_f, (model_a - h_a) * weight_a])
        return np.concatenate([error.real, error.imag, prior(x)])

    least_mass = 1e-3 * float(np.max(np.abs(start[9:])))

    def prior(x: Float) -> Float:
        if exciter_prior is None:
            return np.zeros(0)
        return np.asarray(x[[9, 12]] / (exciter_prior * max(abs(x[11]), least_mass)))

    def jacobian_of(x: Float) -> Float:
        of_f, of_a = _derivatives(x, s, centre)
        error = np.concatenate([of_f * weight_f, of_a * weight_a], axis=1)
        of_prior = np.zeros((x.size, 0))
        if exciter_prior is not None:
            of_prior = np.zeros((x.size, 2))
            of_prior[[9, 12], [0, 1]] = 1.0 / (exciter_prior * max(abs(x[11]), least_mass))
            if abs(x[11]) > least_mass:
                of_prior[11] = -prior(x) / x[11]
        return np.concatenate([error.real, error.imag, of_prior], axis=1).T

    starts = [start] if exciter_prior is None else [start, _light(start)]
    try:
        fits = [
            least_squares(
                residuals,
                begin,
                jac=jacobian_of,
                method="lm",
                x_scale=np.maximum(np.abs(start), 1e-3 * np.max(np.abs(start[5:]))),
                max_nfev=MOST_STEPS,
            )
            for begin in starts
        ]
    except OverflowError:  # a mode of no or infinite damping fits best
        raise ValueError(NO_RESONANCE) from None
    found = min(fits, key=lambda fit: float(fit.cost))
    x = found.x
    weights, jacobian = np.stack([weight_f, weight_a]), np.asarray(found.jac)
    frequency_std, damping_std, shape_std = np.sqrt(
        np.diag(parameter_covariance(jacobian, found.fun, weights, errors))[:3]
    )
    lines = 4 * frequency.size  # a prior says nothing of what was measured
    alone = parameter_covariance(jacobian[:lines], found.fun[:lines], weights, errors)
    model_f, model_a = _model(x, s, centre)
    return {
        "frequency_rad_s": centre * math.exp(x[0]),
        "damping_ratio": math.exp(x[1]),
        "drive_shape": math.exp(0.5 * x[2]),
        # of the logarithms of frequency, damping and squared shape
        "frequency_std_rad_s": _finite(centre * math.exp(x[0]) * float(frequency_std)),
        "damping_ratio_std": _finite(math.exp(x[1]) * float(damping_std)),
        "drive_shape_std": _finite(0.5 * math.exp(0.5 * x[2]) * float(shape_std)),
        "force_v_n_std": _alpha_std(x[5:9], alone[5:9, 5:9], math.exp(x[0])),
        "residual_per_kg": (float(x[3]), float(x[4])),
        "force_v_n": tuple(map(float, x[5:9])),
        "acceleration_v_s2_m": tuple(map(float, x[9:13])),
        "centre_rad_s": centre,
        "band_hz": (float(frequency.min()), float(frequency.max())),
        "fit_error": max(_rms(model_f - h_f) / _rms(h_f), _rms(model_a - h_a) / _rms(h_a)),
    }


def _alpha_std(coefficients: Float, covariance: Float, z: float) -> float:
    """Standard error of ``|alpha|`` at ``s = i z`` (relative to the centre), from the covariance [4, 4] of its coefficients.

    If the lines do not determine alpha at all, this is `UNDETERMINED` times alpha: nothing may be concluded from it.
    """
    parts = np.array([[1.0, 0.0, -(z**2), 0.0], [0.0, z, 0.0, -(z**3)]])
    undetermined = UNDETERMINED * float(np.linalg.norm(parts @ coefficients))
    if not np.isfinite(covariance).all():
        return undetermined
    variance = float(np.trace(parts @ covariance @ parts.T))
    return math.sqrt(variance) if 0.0 <= variance < undetermined**2 else undetermined


def _finite(std: float) -> float | None:
    return std if math.isfinite(std) else None


def _checked(frequency_hz: ArrayLike, force: ArrayLike, acceleration: ArrayLike) -> tuple[Float, Complex, Complex]:
    frequency = np.asarray(frequency_hz, float)
    h_f, h_a = np.asarray(force, np.complex128), np.asarray(acceleration, np.complex128)
    if frequency.ndim != 1 or h_f.shape != frequency.shape or h_a.shape != frequency.shape:
        shapes = f"{frequency.shape}, {h_f.shape} and {h_a.shape}"
        reason = f"shapes {shapes}"
        raise InputError(reason, field="frequency_hz, force_per_v, acceleration_per_v", allowed="three equal rows")
    if frequency.size < 20:
        raise InputError(f"{frequency.size} lines", field="frequency_hz", allowed="at least 20 around the mode")
    if not (np.all(np.isfinite(h_f)) and np.all(np.isfinite(h_a)) and np.all(frequency > 0.0)):
        allowed = "finite numbers, frequencies above 0"
        raise InputError(field="frequency_hz, force_per_v, acceleration_per_v", allowed=allowed)
    return frequency, h_f, h_a


def _checked_covariance(covariance: ArrayLike | None, lines: int) -> Complex | None:
    if covariance is None:
        return None
    found = np.asarray(covariance, np.complex128)
    if found.shape != (lines, 2, 2) or not np.all(np.isfinite(found)):
        raise InputError(f"shape {found.shape}", field="covariance", allowed=f"finite numbers of shape {(lines, 2, 2)}")
    return found


def _rms(values: Complex) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def _model(x: Float, s: Complex, centre: float) -> tuple[Complex, Complex]:
    z = s / centre
    w = math.exp(x[0])
    accelerance = math.exp(x[2]) * z**2 / (z**2 + 2.0 * math.exp(x[1]) * w * z + w**2) + x[3] + x[4] * z**2
    alpha = x[5] + z * (x[6] + z * (x[7] + z * x[8]))
    beta = (x[9] + z * (x[10] + z * (x[11] + z * x[12]))) / z**2
    force = 1.0 / (alpha + beta * accelerance)
    return force, accelerance * force


def _derivatives(x: Float, s: Complex, centre: float) -> tuple[Complex, Complex]:
    """Return the derivatives of `_model` by each parameter, complex[13, n] each."""
    z = s / centre
    w, damped = math.exp(x[0]), 2.0 * math.exp(x[1] + x[0]) * z
    pole = z**2 + damped + w**2
    mode = math.exp(x[2]) * z**2 / pole
    force, acceleration = _model(x, s, centre)
    accelerance = acceleration / force
    beta = (x[9] + z * (x[10] + z * (x[11] + z * x[12]))) / z**2
    powers = z ** np.arange(-2, 4)[:, None]
    of_accelerance = np.zeros((x.size, z.size), np.complex128)
    of_accelerance[:5] = (-mode / pole * (damped + 2.0 * w**2), -mode / pole * damped, mode, np.ones_like(z), z**2)
    of_exciter = beta * of_accelerance
    of_exciter[5:9] += powers[2:]
    of_exciter[9:] += powers[:4] * accelerance
    of_force = -(force**2) * of_exciter
    return of_force, of_accelerance * force + accelerance * of_force


def _start(s: Complex, h_f: Complex, h_a: Complex) -> tuple[float, Float]:
    """Return the scaling frequency (rad/s), and start values of log w, log D, log phi_d^2, residuals, alpha, beta."""
    y = h_a / h_f
    centre = float(np.abs(s[np.argmax(np.abs(y))]))
    z = s / centre
    residuals = np.stack([np.ones_like(z), z**2], axis=1)
    if _rms(y - residuals @ _real_least_squares(residuals, y)) <= NO_MODE * _rms(y):
        raise ValueError(NO_RESONANCE)
    weight = np.abs(h_f)
    for _ in range(12):
        # (z^2 + c z + k) y = n_0 + n_2 z^2 + n_4 z^4 + damping terms: real unknowns k, c, n_0 ... n_4
        columns = np.stack([y, z * y, *(-(z**power) for power in range(5))], axis=1) * weight[:, None]
        k, c, *_ = _real_least_squares(columns, -(z**2) * y * weight)
        weight = np.abs(h_f) / np.abs(z**2 + c * z + k)
    spacing = float(np.median(np.diff(np.abs(z))))
    if abs(c) <= UNRESOLVED * spacing:  # narrower than the lines can tell: noise alone decides the sign
        c = max(c, NARROWEST * spacing)
    if k <= 0.0 or c <= 0.0 or not np.min(np.abs(z)) < math.sqrt(k) < np.max(np.abs(z)):
        raise ValueError(NO_RESONANCE)
    columns = np.stack([z**2 / (z**2 + c * z + k), np.ones_like(z), z**2], axis=1) * np.abs(h_f)[:, None]
    shape_squared, lower, upper = _real_least_squares(columns, y * np.abs(h_f))
    if shape_squared <= 0.0:
        reason = "the resonance pulls instead of pushing (phi_d^2 < 0); check the polarity of force and acceleration"
        raise InputError(reason, field="force_per_v, acceleration_per_v")
    columns = np.stack([*(h_f * z**power for power in range(4)), *(h_a * z**power for power in range(-2, 2))], axis=1)
    exciter = _real_least_squares(columns, np.ones_like(z))
    mode = [0.5 * math.log(k), math.log(0.5 * c / math.sqrt(k)), math.log(shape_squared), lower, upper]
    return centre, np.concatenate([mode, exciter])


def _light(start: Float) -> Float:
    """Return start values of the same responses whose exciter has neither spring nor jerk term.

    The prior is relative to the moving mass. From a spring and a mass that together tune an attached mass to the mode, a fit
    does not find its way to an exciter that has neither: their ratio, and so the prior, stays as it is on that way.
    """
    out = start.copy()
    w, damping, shape_squared = math.exp(start[0]), math.exp(start[1]), math.exp(start[2])
    constant, rising = start[9] / w**2, start[12]
    for power, part in ((0, constant), (1, rising)):
        out[5 + power] += part * shape_squared
        out[9 + power : 12 + power] -= part * np.array([w**2, 2.0 * damping * w, 1.0])
    return out


def _real_least_squares(columns: Complex, target: Complex) -> Float:
    """Return the real least-squares solution x of the complex equations ``columns x = target``; columns are normalised."""
    left, right = np.vstack([columns.real, columns.imag]), np.concatenate([target.real, target.imag])
    scale = np.linalg.norm(left, axis=0)
    return np.asarray(np.linalg.lstsq(left / scale, right, rcond=None)[0] / scale)
