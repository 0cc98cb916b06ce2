"""Compare predictions with measurements or other computations: one row of errors per response or sweep."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from identification.channels import MOTION_ORDER
from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.prediction.steady_prediction import FLAGGED_BEYOND, SteadyPrediction, peak_of
from vibrolock.arrays import Float
from vibrolock.results import Result

Over = Literal["frequency", "phase"]


@dataclass(frozen=True)
class PredictionError:
    """Relative errors of one predicted response or sweep: predicted over reference, minus one.

    Parameters
    ----------
    name
        Name of the prediction.
    peak_error, peak_frequency_error
        Errors of the largest amplitude and of its frequency; NaN if the prediction was cut off before it.
    envelope_error
        RMS difference of the amplitudes in the common range of both, over the largest amplitude of the reference.
    range_use
        Largest modal amplitude, or largest states, of the prediction over the largest in the identification; NaN if that is
        unknown.
    notes
        Remarks on this comparison, one line each.
    """

    name: str
    peak_error: float
    peak_frequency_error: float
    envelope_error: float
    range_use: float
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Whether the prediction is within the identified range of the model, extrapolated or unbounded, in words."""
        if np.isnan(self.range_use):
            return "identified range unknown"
        if self.range_use == np.inf:
            return "unbounded"
        if self.range_use <= 1.0:
            return "inside the identified range"
        return "extrapolated" if self.range_use <= FLAGGED_BEYOND else "extrapolated far"

    def row(self) -> dict[str, float | str | list[str] | None]:
        """Return the errors and the verdict by name, JSON-able; peak errors are None if unknown."""
        return {
            "name": self.name,
            "peak_error": None if np.isnan(self.peak_error) else self.peak_error,
            "peak_frequency_error": None if np.isnan(self.peak_frequency_error) else self.peak_frequency_error,
            "envelope_error": self.envelope_error,
            "range_use": self.range_use,
            "verdict": self.verdict,
            "notes": list(self.notes),
        }


def error_table(errors: Iterable[PredictionError]) -> str:
    """Format a plain-text table, one line per prediction, errors in percent; raise `IdentificationError` if there are none."""
    rows = list(errors)
    IdentificationError.raise_if(not rows, "is empty", field="errors", allowed="at least one comparison")
    width = max(len("prediction"), *(len(row.name) for row in rows))
    lines = [f"{'prediction':{width}}   peak %  frequency %  envelope %  range use  verdict"]
    for row in rows:
        peak, peak_hz = (
            "-" if np.isnan(error) else format(100 * error, pattern)
            for error, pattern in ((row.peak_error, "+.2f"), (row.peak_frequency_error, "+.3f"))
        )
        lines.append(
            f"{row.name:{width}}  {peak:>7}  {peak_hz:>11}  "
            f"{100 * row.envelope_error:10.2f}  {row.range_use:9.2f}  {row.verdict}"
        )
    return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Comparison(Result):
    """A predicted response and its reference.

    Parameters
    ----------
    error
        The errors, as a row of a table.
    reference
        The response with which it was compared.
    predicted_amplitude
        float[n], predicted peak amplitude at each point of the reference, in the unit of its response; NaN where the
        prediction has none.
    """

    error: PredictionError
    reference: FrequencyResponse
    predicted_amplitude: Float


def compare(
    prediction: SteadyPrediction,
    reference: FrequencyResponse,
    *,
    channel: str | None = None,
    over: Over = "frequency",
    phase_window_deg: float = 90.0,
) -> Comparison:
    """Compare a predicted frequency response with a measured or otherwise computed one.

    Raises `IdentificationError` if prediction and reference have no point in common, or the channel was not predicted.

    Parameters
    ----------
    prediction
        The prediction.
    reference
        The reference; amplitudes are compared in its unit, at the frequencies or phase lags of its points.
    channel
        Predicted channel that corresponds to the response; the drive point if None.
    over
        ``frequency``: the stable prediction at each frequency of the reference; of two, the one nearer to the reference. A
        response to the recorded force is compared point by point, unstable states included. ``phase``: the prediction at each
        phase lag of the reference; the phase distinguishes all branches, including unstable ones.
    phase_window_deg
        Only points of the reference whose lag differs by at most this from 90 degrees count in the envelope error.
    """
    IdentificationError.unless_one_of("over", over, get_args(Over))
    order = MOTION_ORDER[reference.kind]
    scale = (2.0 * np.pi * prediction.frequency_hz) ** order
    amplitude = prediction.amplitude_m(channel) * scale
    used = np.abs(reference.phase_lag_deg - 90.0) <= phase_window_deg
    if over == "phase":
        predicted = _at_lags(prediction, amplitude, channel, reference.phase_lag_deg)
    elif prediction.force == "recorded" and np.array_equal(prediction.frequency_hz, reference.frequency_hz):
        predicted = amplitude
    else:
        predicted = _at_frequencies(prediction, amplitude, reference)
    used &= np.isfinite(predicted)
    if not np.any(used):
        raise IdentificationError(
            f"no point in common with the prediction over {over}; check ranges and signs", field="reference"
        )
    measured = np.abs(reference.response)
    notes = list(prediction.notes)
    top, top_hz = peak_of(measured, reference.frequency_hz)
    main = prediction.branch == 0
    if not prediction.peak_reached(channel, order=order):
        peak = peak_hz = float("nan")
        notes.append("the prediction is largest where it was cut off: it has no peak to compare")
    elif over == "frequency" and top_hz in (reference.frequency_hz.min(), reference.frequency_hz.max()):
        where = int(np.argmax(np.where(used, predicted, -np.inf)))
        peak, peak_hz = float(predicted[where]), float(reference.frequency_hz[where])
        notes.append("the reference is largest at an end of its frequencies: compared is the largest within them")
    else:
        peak, peak_hz = peak_of(amplitude[main], prediction.frequency_hz[main])
    if missing := used.size - int(np.count_nonzero(used)):
        notes.append(f"{missing} of {used.size} points of the reference are not compared")
    error = PredictionError(
        name=reference.label or prediction.name,
        peak_error=peak / top - 1.0,
        peak_frequency_error=peak_hz / top_hz - 1.0,
        envelope_error=float(np.sqrt(np.mean((predicted - measured)[used] ** 2))) / top,
        range_use=float(np.max(prediction.range_use[main])),
        notes=tuple(notes),
    )
    return Comparison(error, reference, predicted)


def _at_lags(prediction: SteadyPrediction, amplitude: Float, channel: str | None, lag_deg: Float) -> Float:
    """Return the amplitudes of the main branch at phase lags; NaN outside its range."""
    main = prediction.branch == 0
    lag = prediction.phase_lag_deg(channel)[main]
    order = np.argsort(lag, kind="stable")
    return np.asarray(np.interp(lag_deg, lag[order], amplitude[main][order], left=np.nan, right=np.nan))


def _at_frequencies(prediction: SteadyPrediction, amplitude: Float, reference: FrequencyResponse) -> Float:
    """Return stable amplitudes at the frequencies of the reference; of two, the nearer to it; NaN if there is none."""
    measured = np.abs(reference.response)
    best = np.full(measured.size, np.nan)
    frequency, stable = prediction.frequency_hz, prediction.stable
    linked = stable[1:] & stable[:-1] & (prediction.branch[1:] == prediction.branch[:-1])
    for k in np.flatnonzero(linked):
        low, high = sorted((frequency[k], frequency[k + 1]))
        hit = (reference.frequency_hz >= low) & (reference.frequency_hz <= high)
        width = frequency[k + 1] - frequency[k]
        share = (reference.frequency_hz[hit] - frequency[k]) / width if width else 0.0
        value = amplitude[k] + share * (amplitude[k + 1] - amplitude[k])
        nearer = ~(np.abs(best[hit] - measured[hit]) <= np.abs(value - measured[hit]))
        best[hit] = np.where(nearer, value, best[hit])
    return best
