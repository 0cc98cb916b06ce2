"""Fit of the plant near one mode to measured frequency responses from voltage."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

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
STRAYED = 3.0
"""Logarithm of the frequency over the centre, and of the damping ratio, at which a fit has left the band, or the modes."""
LARGEST_LOGARITHM, FAR = 300.0, 1e9  # of the squared shape, kg^-1; weighted residuals beyond both
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
    frequency, h_f, h_a = _checked(frequency_hz, force_per_v, acceleration_per_v)
    s: Complex = 2j * np.pi * frequency.astype(np.complex128)
    weight_f = 1.0 / np.broadcast_to(_rms(h_f) if force_std is None else np.asarray(force_std, float), h_f.shape)
    weight_a = 1.0 / np.broadcast_to(_rms(h_a) if acceleration_std is None else np.asarray(acceleration_std), h_a.shape)
    errors = _checked_covariance(covariance, frequency.size)
    centre, start = _start(s, h_f, h_a, weight_f, weight_a)
    problem = _Problem(s, centre, h_f, h_a, weight_f, weight_a, 1e-3 * float(np.max(np.abs(start[9:]))), exciter_prior)
    found = _best_fit(problem, [start] if exciter_prior is None else [start, _light(start)])
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
        "fit_error": max(
            _beyond_noise(model - h, None if errors is None else errors[:, row, row].real) / _rms(h)
            for row, (model, h) in enumerate([(model_f, h_f), (model_a, h_a)])
        ),
    }


class _Problem(NamedTuple):
    """Weighted residuals of both FRFs, real parts first, and of the exciter's prior."""

    s: Complex
    centre: float
    force_per_v: Complex
    acceleration_per_v: Complex
    weight_f: Float
    weight_a: Float
    least_mass: float
    """Least moving mass to which the prior refers, V s^2/m."""
    exciter_prior: float | None

    def residuals(self, x: Float) -> Float:
        if max(abs(x[0]), x[1]) > STRAYED or abs(x[2]) > LARGEST_LOGARITHM:  # a step that goes there is taken back
            return np.full(4 * self.s.size + (0 if self.exciter_prior is None else 2), FAR)
        model_f, model_a = _model(x, self.s, self.centre)
        of_f, of_a = (model_f - self.force_per_v) * self.weight_f, (model_a - self.acceleration_per_v) * self.weight_a
        error = np.concatenate([of_f, of_a])
        return np.concatenate([error.real, error.imag, self._prior(x)])

    def jacobian(self, x: Float) -> Float:
        of_f, of_a = _derivatives(x, self.s, self.centre)
        error = np.concatenate([of_f * self.weight_f, of_a * self.weight_a], axis=1)
        return np.concatenate([error.real, error.imag, self._derivatives_of_prior(x)], axis=1).T

    def _prior(self, x: Float) -> Float:
        if self.exciter_prior is None:
            return np.zeros(0)
        return np.asarray(x[[9, 12]] / (self.exciter_prior * max(abs(x[11]), self.least_mass)))

    def _derivatives_of_prior(self, x: Float) -> Float:
        if self.exciter_prior is None:
            return np.zeros((x.size, 0))
        out = np.zeros((x.size, 2))
        out[[9, 12], [0, 1]] = 1.0 / (self.exciter_prior * max(abs(x[11]), self.least_mass))
        if abs(x[11]) > self.least_mass:
            out[11] = -self._prior(x) / x[11]
        return out


def _best_fit(problem: _Problem, starts: Sequence[Float]) -> Any:
    """Return the result of `scipy.optimize.least_squares` with the least cost, from these start values."""
    from scipy.optimize import least_squares

    scale = np.maximum(np.abs(starts[0]), 1e-3 * np.max(np.abs(starts[0][5:])))
    settings: Any = {"jac": problem.jacobian, "method": "lm", "x_scale": scale, "max_nfev": MOST_STEPS}
    with np.errstate(all="ignore"):  # far from a plant the model may have no value
        fits = [least_squares(problem.residuals, start, **settings) for start in starts]
    return min(fits, key=lambda fit: float(fit.cost))


def _beyond_noise(residuals: Complex, variance: Float | None) -> float:
    """Root mean square of what the variance [n] of the lines does not explain; at least what n lines may show by chance."""
    squared = float(np.mean(np.abs(residuals) ** 2))
    if variance is not None:
        noise = float(np.mean(variance))
        squared = min(squared, max(squared - noise, noise / math.sqrt(residuals.size)))
    return math.sqrt(squared)


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


def _start(s: Complex, h_f: Complex, h_a: Complex, weight_f: Float, weight_a: Float) -> tuple[float, Float]:
    """Return the scaling frequency (rad/s), and start values of log w, log D, log phi_d^2, residuals, alpha, beta."""
    y = h_a / h_f
    centre = float(np.abs(s[np.argmin(np.abs(h_f) * weight_f / (np.abs(h_a) * weight_a))]))
    z = s / centre
    residuals = np.stack([np.ones_like(z), z**2], axis=1)
    if _rms(y - residuals @ _real_least_squares(residuals, y)) <= NO_MODE * _rms(y):
        raise ValueError(NO_RESONANCE)
    powers: Complex = z ** np.arange(5)[:, None]
    weight: Float = weight_a / np.max(weight_a)
    for _ in range(12):
        # (z^2 + c z + k) h_a = (n_0 + n_1 z ... n_4 z^4) h_f: real unknowns k, c, n_0 ... n_4
        terms: list[Complex] = [h_a, z * h_a, *(-powers * h_f)]
        columns: Complex = np.stack(terms, axis=1) * weight[:, None]
        k, c, *numerator = _real_least_squares(columns, -(z**2) * h_a * weight)
        weight = 1.0 / np.hypot(np.abs(z**2 + c * z + k) / weight_a, np.abs(np.asarray(numerator) @ powers) / weight_f)
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
