"""Predictions beyond the training data: how far the input goes there, and bands that hold what the data leave open.

How far a prediction goes is told by its input (`trained_range`), not by the model's own motion.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.errors import ExtrapolationError, IdentificationError
from identification.models.structured.alternatives import alternatives
from identification.models.structured.fit import StructuredFit
from identification.models.structured.model import StructuredModel
from identification.models.structured.trained_range import trained_force_n
from identification.prediction.steady_prediction import ResponseBand, SteadyPrediction, widened

LARGEST_INPUT_USE = 2.0
"""Input up to which bands are given, over that of the training data."""
ROUNDING = 1.01
AMPLITUDE, FREQUENCY = (2.0, 24.0), (8.0, 100.0)
"""Error of amplitude, over that of the training, and of frequency, over the same times the damping ratio, at the level of
the training data, and what is added at twice that level. Chosen on wrong laws with training errors of 0.3 to 4 % (hysteresis
of Bouc and Wen by Masing's rule, joints and a stop by polynomials): so far they were off beyond what alternatives explain."""
_LARGEST_SPAN, _LARGEST_SHIFT = 2.0, 1.2
"""Upper end of a band of amplitude and of frequency over the lower end, above which a prediction is refused. Chosen."""


def response_use(model: StructuredModel, response: SteadyPrediction) -> float:
    """Return the force at the peak of a response over `trained_force_n`; NaN if that is unknown."""
    frequency_hz = response.frequency_hz
    known = trained_force_n(model, 0.5 * float(np.min(frequency_hz)), 2.0 * float(np.max(frequency_hz)))
    return float(response.fundamental_n[int(np.argmax(response.amplitude_m()))]) / known


def judged_by_input(model: StructuredModel, response: SteadyPrediction) -> SteadyPrediction:
    """Return a response whose range use is that of its force, where this is above 1 and above that of its motion."""
    use, own = response_use(model, response), float(np.nanmax(response.range_use, initial=0.0))
    if not use > max(own, 1.0) or own == 0.0:
        return response
    said = (
        f"range use is that of the force, {use:.2f} times the training data; by the model's own motion it is {own:.2f}"
    )
    return replace(response, range_use=response.range_use * (use / own), notes=(*response.notes, said))


def check_response(model: StructuredModel, response: SteadyPrediction) -> float:
    """Return the use of the training data by a response's force (`response_use`).

    Raises `ExtrapolationError` for a response that ends before its peak, or with a force above twice that of the training data.
    """
    use = response_use(model, response)
    if not response.peak_reached():
        raise _refused(response, use, "its model leaves the range that is allowed before the peak")
    if use > LARGEST_INPUT_USE * ROUNDING:
        raise _refused(response, use, f"above {LARGEST_INPUT_USE:g} nothing is known of the error")
    return use


def with_what_is_open(
    fit: StructuredFit,
    band: ResponseBand,
    response: SteadyPrediction,
    respond: Callable[[StructuredModel], SteadyPrediction],
) -> ResponseBand:
    """Return a band that also holds the laws that the training data leave open, and the error that the fit left.

    Raises `ExtrapolationError` if these laws differ too much, or the force is above twice that of the training data.

    Parameters
    ----------
    fit
        The fit.
    band
        That of the covariance of the fit.
    response
        That of the fitted model.
    respond
        The same response of another model, however far it goes.
    """
    use = check_response(fit.model, response)
    families: dict[str, list[SteadyPrediction]] = {}
    for family, model in alternatives(fit.model):
        try:
            families.setdefault(family, []).append(respond(model))
        except IdentificationError:
            raise _refused(response, use, f"a {family} that fits these data as well has no such response") from None
    beyond = max(use - 1.0, 0.0) if np.isfinite(use) else 0.0
    amplitude, frequency = (fit.training_error * (one + more * beyond) for one, more in (AMPLITUDE, FREQUENCY))
    found = widened(band, response, list(families.values()), amplitude, frequency * _damping_ratio(fit.model, response))
    top = int(np.argmin(np.abs(found.phase_lag_deg - 90.0)))
    (low, high), (low_hz, high_hz) = found.amplitude_m[:, top], found.frequency_hz[:, top]
    if high > _LARGEST_SPAN * low or high_hz > _LARGEST_SHIFT * low_hz:
        between = f"from {1e3 * low:.3g} to {1e3 * high:.3g} mm, {low_hz:.4g} to {high_hz:.4g} Hz"
        raise _refused(response, use, f"models that fit these data as well resonate at anything {between}")
    return found


def _refused(response: SteadyPrediction, use: float, reason: str) -> ExtrapolationError:
    at = f"is {use:.2f} times the force of the training data, and " if np.isfinite(use) else ""
    return ExtrapolationError(f"{response.name}: {at}{reason}; train the model at a higher level")


def _damping_ratio(model: StructuredModel, response: SteadyPrediction) -> float:
    """Return the damping ratio at the peak, by the power of the force there."""
    at_rest, peak = model.linearised(), response.peak()
    top = int(np.argmax(response.amplitude_m()))
    mode = int(np.argmin(np.abs(at_rest.frequency_hz - peak.frequency_hz)))
    shape = float(at_rest.input_shapes[mode, 0])
    omega = 2.0 * np.pi * peak.frequency_hz
    return 0.5 * float(response.fundamental_n[top]) * shape**2 / (omega**2 * peak.amplitude_m)
