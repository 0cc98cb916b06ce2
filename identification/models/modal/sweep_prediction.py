"""A predicted sweep, and its errors against a recorded one."""

from dataclasses import dataclass

import numpy as np

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.models.modal.sweep_inputs import BY_ZERO_CROSSINGS
from identification.prediction.comparison import PredictionError
from identification.signals.transients import Transient
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result


@dataclass(frozen=True, eq=False, kw_only=True)
class SweepPrediction(Result):
    """Fundamentals of a predicted sweep over time, peak values, against the phase of the imposed force or voltage.

    Parameters
    ----------
    time_s, frequency_hz
        float[n], instants of the input, and its instantaneous frequency.
    modal_amplitude
        complex[n], modal amplitude Q, kg^1/2 m.
    drive_m, drive_m_s, drive_m_s2
        complex[n], displacement, velocity and acceleration of the drive point. In a fast sweep ``|A|`` differs from
        ``W^2 |X|``, because the phase of X changes at a rate of some percent of the frequency.
    force
        complex[n], force at the drive point, N.
    largest_identified
        Largest modal amplitude in the identification of the model.
    window_periods
        Window over which the input was smoothed, in periods; the prediction is then smoothed too.
    origin
        Name of the imposed input.
    notes
        Remarks on this prediction, one line each.
    simulated_range_use
        For a nonlinear state-space model, whose modal amplitude is NaN: largest state or input over the largest in its
        training data; inf for an unbounded run. None for nonlinear modes.
    unbounded_at_s
        Time at which the simulated run became unbounded, before which the prediction ends; None if it stayed bounded.
    peak_band_m, peak_band_hz
        Ends of the 95 % intervals of the largest displacement of the drive point and of its frequency; None if unknown.
    """

    time_s: Float
    frequency_hz: Float
    modal_amplitude: Complex
    drive_m: Complex
    drive_m_s: Complex
    drive_m_s2: Complex
    force: Complex
    largest_identified: float
    window_periods: int
    origin: str
    notes: tuple[str, ...] = ()
    simulated_range_use: float | None = None
    unbounded_at_s: float | None = None
    peak_band_m: tuple[float, float] | None = None
    peak_band_hz: tuple[float, float] | None = None

    @property
    def range_use(self) -> float:
        """Largest modal amplitude over the largest identified, or ``simulated_range_use``."""
        if self.simulated_range_use is not None:
            return self.simulated_range_use
        return float(np.max(np.abs(self.modal_amplitude))) / self.largest_identified

    def peak(self, sweep: Transient | None = None) -> tuple[float, float]:
        """Return the largest displacement of the drive point (m) and its frequency (Hz).

        If the recorded ``sweep`` is given and the force is by zero crossings, it is the frequency of the sweep at that
        instant, because the frequency between zero crossings jumps.
        """
        where = int(np.argmax(np.abs(self.drive_m)))
        return float(abs(self.drive_m[where])), float(self.swept_hz(sweep)[where])

    def swept_hz(self, sweep: Transient | None = None) -> Float:
        """float[n]: frequency at each instant, Hz; that of the recorded ``sweep`` if the force is by zero crossings."""
        if sweep is None or self.origin != BY_ZERO_CROSSINGS:
            return self.frequency_hz
        return np.asarray(np.interp(self.time_s, sweep.time_s, sweep.frequency_hz))

    def smoothed(self, values: Complex, window_periods: int) -> Complex:
        """Smooth ``values`` (complex[n]) as `identification.demodulate` does: a mean over half the window, twice."""
        turned = np.concatenate([[0.0], np.cumsum(0.5 * (self.frequency_hz[1:] + self.frequency_hz[:-1]))])
        turned *= (self.time_s[-1] - self.time_s[0]) / max(self.time_s.size - 1, 1)
        reach = 0.25 * window_periods
        for _ in range(2 if window_periods else 0):
            means = 0.5 * (values[1:] + values[:-1]) * np.diff(turned)
            total = np.concatenate([[0.0], np.cumsum(means)])
            low, high = np.maximum(turned - reach, turned[0]), np.minimum(turned + reach, turned[-1])
            values = (np.interp(high, turned, total) - np.interp(low, turned, total)) / (high - low)
        return np.asarray(values)


def as_recorded(prediction: SweepPrediction, sweep: Transient) -> tuple[Float, Float, Float]:
    """Return comparable amplitudes of a recorded sweep and of its prediction.

    These are the recorded drive-point displacement (m) at the instants of ``sweep``, the predicted one, and the predicted
    force (N), both at the instants of ``prediction`` and smoothed like the recording. See `compare_sweep`.
    """
    row = find_role(sweep.channels, "drive")
    order = MOTION_ORDER[sweep.channels[row].motion]
    measured = np.abs(sweep.fundamentals[row]) / (2.0 * np.pi * sweep.frequency_hz) ** order
    if prediction.origin == BY_ZERO_CROSSINGS:
        return measured, np.abs(prediction.drive_m), np.abs(prediction.force)
    motion = (prediction.drive_m, prediction.drive_m_s, prediction.drive_m_s2)[order]
    window = 0 if prediction.window_periods else sweep.window_periods
    smoothed = np.abs(prediction.smoothed(motion, window))
    predicted = smoothed / (2.0 * np.pi * prediction.frequency_hz) ** order
    return measured, predicted, np.abs(prediction.smoothed(prediction.force, window))


def compare_sweep(prediction: SweepPrediction, sweep: Transient, *, name: str = "") -> PredictionError:
    """Compare a predicted sweep with the corresponding recorded one, on the same time axis.

    Parameters
    ----------
    prediction
        The predicted sweep.
    sweep
        The recorded sweep, with a drive channel.
    name
        Name of the recording in the result.

    Notes
    -----
    The fundamental of the drive channel (displacement, velocity or acceleration) is divided by the power of the instantaneous
    W that converts it to a displacement. The prediction is smoothed like the recording, which lowers the peak of a fast
    sweep. If the force is by zero crossings, its frequency and phase jump. The predicted displacement is then not smoothed,
    and the peak frequency is that of the recorded sweep at the instant of the peak.

    Errors of an unbounded run are NaN. Raises `IdentificationError` if the two have no time in common, or the recording has
    no drive channel.
    """
    if prediction.unbounded_at_s is not None:
        nothing = float("nan")
        return PredictionError(
            name or prediction.origin, nothing, nothing, nothing, prediction.range_use, prediction.notes
        )
    measured, predicted, _ = as_recorded(prediction, sweep)
    common = (sweep.time_s >= prediction.time_s[0]) & (sweep.time_s <= prediction.time_s[-1])
    if not common.any():
        raise IdentificationError(
            f"lasts from {sweep.time_s[0]:g} to {sweep.time_s[-1]:g} s, the prediction from "
            f"{prediction.time_s[0]:g} to {prediction.time_s[-1]:g} s",
            field="sweep",
        )
    there, here = int(np.argmax(measured)), int(np.argmax(predicted))
    difference = np.interp(sweep.time_s[common], prediction.time_s, predicted) - measured[common]
    return PredictionError(
        name=name or prediction.origin,
        peak_error=float(predicted[here] / measured[there]) - 1.0,
        peak_frequency_error=float(prediction.swept_hz(sweep)[here] / sweep.frequency_hz[there]) - 1.0,
        envelope_error=float(np.sqrt(np.mean(difference**2)) / measured[there]),
        range_use=prediction.range_use,
        notes=prediction.notes,
    )
