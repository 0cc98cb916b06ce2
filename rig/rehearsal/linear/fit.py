"""Fit of the linear rig to measured responses, together with what is known beforehand.

Every parameter has a prior, wide for what nobody knows; it bounds the directions that the data do not determine. Masses,
stiffnesses and all else that is positive are fitted and drawn by their logarithms.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy

from rig.errors import ConfigurationError
from rig.rehearsal.linear.model import LinearRig, Prior, Responses
from rig.rehearsal.linear.parameters import ParameterTable, parameters_of, start_values
from rig.rehearsal.linear.posterior import Linearisation, Posterior
from rig.rehearsal.linear.slopes import weighted_slopes
from vibrolock.arrays import Complex, Float
from vibrolock.one_thread import one_thread

_MIN_UNEXPLAINED = 4.0  # misfit over its expectation above which a further mode is sought; chosen
_MAX_LEFT = 0.5  # largest part of that misfit that may be left for the further mode to be kept; chosen
_MAX_NEIGHBOURS = 3  # largest number of modes beside the tested one; chosen
_MODEL_FLOOR = 2e-3
"""Smallest relative standard deviation of a response that is believed; chosen: the accuracy of calibrated sensors."""
_MAX_EVALUATIONS, _TOLERANCE = 100, 1e-7
"""Evaluations and relative tolerance of one fit; chosen: far below the standard errors."""
_HALVED = 0.25  # variance over that of the prior below which the data have at least halved a standard deviation


def posterior(
    channels: Sequence[str], start: Mapping[str, float], priors: Mapping[str, Prior], responses: Responses | None
) -> Posterior:
    """Return the posterior of the linear rig by responses and priors together.

    Parameters
    ----------
    channels
        Names of the response channels.
    start
        Start values of a mode, and of the exciter as far as they are known.
    priors
        Priors by name; without one, a shaker that suits the specimen is assumed.
    responses
        Measured responses; None leaves the priors as they are.

    Raises
    ------
    ConfigurationError
        If the responses are not those of such a rig.

    The fit starts from several shakers, because it may have more than one minimum.
    """
    neighbours_hz: list[float] = []
    parameters = parameters_of(channels, start, priors, responses, neighbours_hz)
    found, worst_hz = _fit(parameters, responses, start_values(start))
    while responses is not None and found.inflation > _MIN_UNEXPLAINED and len(neighbours_hz) < _MAX_NEIGHBOURS:
        neighbours_hz.append(worst_hz)
        parameters = parameters_of(channels, start, priors, responses, neighbours_hz)
        better, worst_hz = _fit(parameters, responses, [found.rig().values])
        if better.inflation > _MAX_LEFT * found.inflation:
            break
        found = better
    return found


def _fit(
    table: ParameterTable, responses: Responses | None, starts: Sequence[Mapping[str, float]]
) -> tuple[Posterior, float]:
    """Return the best of the fits from several starts, and the line (Hz) that fits worst."""
    centre, std = np.array(table.centre), np.array(table.std)
    if responses is None:
        return _posterior(table, centre, np.diag(std**2)), 0.0
    scale = np.sqrt(np.mean(np.abs(responses.value) ** 2, axis=0))
    sigma = np.sqrt(
        responses.std**2 + (_MODEL_FLOOR * np.abs(responses.value)) ** 2 + (0.2 * _MODEL_FLOOR * scale) ** 2
    )

    def misses(x: Float) -> Complex:
        return np.asarray(_model(table, x, responses) - responses.value)

    def residuals(x: Float) -> Float:
        error = (misses(x) / sigma).ravel()
        return np.concatenate([error.real, error.imag, (x - centre) / std])

    def derivatives(x: Float) -> Float:
        return np.concatenate([weighted_slopes(_rig(table, x), table.names, responses, sigma), np.diag(1.0 / std)])

    bounds = table.bounds
    with np.errstate(over="ignore", invalid="ignore"):
        vectors = [np.clip(_with_measured_force(table, table.vector(start), responses), *bounds) for start in starts]
    found, remaining, slope = _best_fit(residuals, derivatives, vectors, bounds, std)
    if not np.all(np.isfinite(remaining)):
        raise ConfigurationError("the responses are not those of a shaker, a stinger and a structure near one mode")
    error = misses(found)
    expected = max(2 * error.size - centre.size, 1)
    inflation = float(np.sum(np.abs(error / sigma) ** 2)) / expected
    jacobian = slope[: 2 * error.size] / np.sqrt(max(1.0, inflation))
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.diag(std**-2.0))
    relative = np.abs(error) / scale
    best = replace(
        _posterior(table, found, covariance),
        misfit=float(np.sqrt(np.mean(relative**2))),
        inflation=inflation,
        determined=float(np.mean(np.linalg.eigvalsh(covariance / np.outer(std, std)) < _HALVED)),
        linearisation=Linearisation(responses, sigma * np.sqrt(max(1.0, inflation)), jacobian, std, bounds),
    )
    return best, float(responses.frequency_hz[int(np.argmax(relative[:, 1]))])


def _best_fit(
    residuals: Callable[[Float], Float],
    derivatives: Callable[[Float], Float],
    starts: Sequence[Float],
    bounds: tuple[Float, Float],
    scale: Float,
) -> tuple[Float, Float, Float]:
    """Return the fit with the smallest sum of squares of those from several starts: parameters, residuals, Jacobian."""
    least_squares = scipy.optimize.least_squares  # loads the libraries whose threads are limited
    with one_thread(), np.errstate(over="ignore", invalid="ignore"):
        fits = [
            least_squares(
                residuals,
                start,
                derivatives,
                bounds=bounds,
                x_scale=scale,
                max_nfev=_MAX_EVALUATIONS,
                ftol=_TOLERANCE,
                xtol=_TOLERANCE,
            )
            for start in starts
        ]
    best = min(fits, key=lambda fit: float(fit.cost))
    return np.asarray(best.x), np.asarray(best.fun), np.asarray(best.jac)


def _model(table: ParameterTable, x: Float, responses: Responses) -> Complex:
    return _rig(table, x).responses(responses.frequency_hz, responses.sample_rate_hz)


def _rig(table: ParameterTable, x: Float) -> LinearRig:
    return _posterior(table, x, np.empty(0)).rig()


def _posterior(table: ParameterTable, x: Float, covariance: Float) -> Posterior:
    return Posterior(tuple(table.names), np.array(table.positive), x, covariance, table.channels)


def _with_measured_force(table: ParameterTable, x: Float, responses: Responses) -> Float:
    """Return start values with the force per volt at which the median force is the measured one."""
    model = _model(table, x, responses)
    ratio = float(np.median(np.abs(responses.value[:, 0]) / np.abs(model[:, 0])))
    out = x.copy()
    out[table.names.index("force_per_volt_n_v")] += np.log(ratio)
    return out
