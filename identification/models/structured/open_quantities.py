"""Bands of what runs over time and backbones give, with what the training data leave open beyond their range.

They are made as those of frequency responses are (`extrapolation`): what models by the covariance of the fit give, what each
kind of law that the data leave open gives, and the error that the fit left, all added.
"""

from collections.abc import Callable

import numpy as np

from identification.errors import ExtrapolationError, IdentificationError
from identification.models.structured.alternatives import alternatives
from identification.models.structured.extrapolation import AMPLITUDE, FREQUENCY, LARGEST_INPUT_USE, ROUNDING
from identification.models.structured.fit import StructuredFit, drawn
from identification.models.structured.model import StructuredModel
from vibrolock.arrays import Float

WAVEFORM = (3.0, 30.0)
"""Error of a waveform over that of the training, at the level of the training data, and what is added at twice that. Chosen."""
_DRAWS = 20
"""Models by the covariance of the fit. Chosen: their scatter is the smaller part beyond the data."""
_TWO_SIDED_95 = 1.96
_LARGEST_SPAN = 2.0
"""Upper end of a band over its lower end, from which a prediction is refused. Chosen."""


def grown(factors: tuple[float, float], use: float) -> float:
    """Return the error over that of the training: at its level, and what is added at twice that level, in proportion."""
    return factors[0] + factors[1] * (max(use - 1.0, 0.0) if np.isfinite(use) else 0.0)


def refused(name: str, use: float, reason: str) -> ExtrapolationError:
    """Return the error of a prediction that is beyond what the data say."""
    at = f"is {use:.2f} times the force of the training data, and " if np.isfinite(use) else ""
    return ExtrapolationError(f"{name}: {at}{reason}; train the model at a higher level")


def check_input(name: str, use: float) -> None:
    """Raise `ExtrapolationError` for an input above twice that of the training data."""
    if use > LARGEST_INPUT_USE * ROUNDING:
        raise refused(name, use, f"above {LARGEST_INPUT_USE:g} nothing is known of the error")


def open_band(
    fit: StructuredFit,
    name: str,
    use: float,
    own: Float,
    errors: Float,
    respond: Callable[[StructuredModel], Float],
) -> Float:
    """float[2, k]: ends of 95 % intervals of quantities of a prediction.

    Raises `ExtrapolationError` if the input is above twice that of the training data, or a model that fits these data as well
    gives no such prediction.

    Parameters
    ----------
    fit
        The fit.
    name
        What is predicted, for messages.
    use
        Input of the prediction over that of the training data; NaN if unknown.
    own
        float[k], what the fitted model gives.
    errors
        float[k], what the error that the fit left makes of it, for an error in training of 1.
    respond
        Gives the same of another model.
    """
    check_input(name, use)
    scatter = 0.0
    drawn_values = []
    for model in drawn(fit, _DRAWS):
        try:
            drawn_values.append(respond(model) - own)
        except IdentificationError:
            continue
    if len(drawn_values) > _DRAWS // 2:
        scatter = _TWO_SIDED_95 * np.sqrt(np.mean(np.square(drawn_values), axis=0))
    down, up = -scatter - fit.training_error * errors, scatter + fit.training_error * errors
    families: dict[str, list[Float]] = {}
    for family, model in alternatives(fit.model):
        try:
            families.setdefault(family, []).append(respond(model) - own)
        except IdentificationError:
            raise refused(name, use, f"a {family} that fits these data as well gives no such prediction") from None
    for moved in families.values():
        down, up = down + np.minimum(np.min(moved, axis=0), 0.0), up + np.maximum(np.max(moved, axis=0), 0.0)
    return np.asarray([own + down, own + up])


def run_band(
    fit: StructuredFit, name: str, use: float, outputs: Float, respond: Callable[[StructuredModel], Float]
) -> tuple[Float, Float, Float]:
    """Return ends of RMS and peak of outputs, float[2, n_outputs] each, and their largest relative RMS error, float[n_outputs].

    Raises `ExtrapolationError` as `open_band` does, and if an upper end of an RMS or a peak is above twice the lower one.

    Parameters
    ----------
    fit, name, use
        As for `open_band`.
    outputs
        float[n_outputs, n], outputs of the fitted model where they count.
    respond
        Gives the same of another model.
    """
    size = np.sqrt(np.mean(outputs**2, axis=1))
    count = len(outputs)

    def quantities(found: Float) -> Float:
        if not np.isfinite(found).all():
            raise IdentificationError("the run is not bounded")
        away = np.sqrt(np.mean((found - outputs) ** 2, axis=1))
        return np.concatenate([np.sqrt(np.mean(found**2, axis=1)), np.max(np.abs(found), axis=1), away / size])

    own = quantities(outputs)
    amplitude, waveform = grown(AMPLITUDE, use), grown(WAVEFORM, use)
    errors = np.concatenate([amplitude * own[: 2 * count], np.full(count, waveform)])
    low, high = open_band(fit, name, use, own, errors, lambda model: quantities(respond(model)))
    low = np.maximum(low, 0.0)
    if np.any(high[: 2 * count] > _LARGEST_SPAN * low[: 2 * count]):
        worst = int(np.argmax(high[: 2 * count] / np.maximum(low[: 2 * count], 1e-300)))
        what = ("RMS", "largest value")[worst // count]
        channel = fit.model.outputs[worst % count]
        between = f"{what} of {channel.name} anything from {low[worst]:.3g} to {high[worst]:.3g} {channel.unit}"
        raise refused(name, use, f"models that fit these data as well give a {between}")
    rms, peak = (np.array([low[part], high[part]]) for part in (slice(count), slice(count, 2 * count)))
    return rms, peak, high[2 * count :]


def peak_band(
    fit: StructuredFit,
    name: str,
    use: float,
    own: tuple[float, float],
    damping_ratio: float,
    respond: Callable[[StructuredModel], tuple[float, float]],
) -> Float:
    """float[2, 2]: ends of the largest amplitude (m) of a sweep and of its frequency (Hz), lower ends first.

    Raises `ExtrapolationError` as `open_band` does, and if the upper end of the amplitude is above twice the lower one.

    Parameters
    ----------
    fit, name, use
        As for `open_band`.
    own
        Largest amplitude of the fitted model and its frequency.
    damping_ratio
        Damping ratio there: a wrong law moves the frequency in proportion.
    respond
        Gives the same of another model.
    """
    values = np.array(own)
    errors = values * np.array([grown(AMPLITUDE, use), damping_ratio * grown(FREQUENCY, use)])
    found = open_band(fit, name, use, values, errors, lambda model: np.array(respond(model)))
    found[0] = np.maximum(found[0], 0.0)
    if found[1, 0] > _LARGEST_SPAN * found[0, 0]:
        between = f"from {1e3 * found[0, 0]:.3g} to {1e3 * found[1, 0]:.3g} mm"
        raise refused(name, use, f"models that fit these data as well reach anything {between}")
    return found
