"""Predictions of frequency responses at constant force, cut from a force surface."""

from pathlib import Path

import numpy as np

from identification import ConstantForceCurve, FrequencyResponse, Predictions, ResponseBand, SteadyPrediction, compare
from rig.errors import RecordingError
from rig.results.files import load_as
from rig.results.force_surface.model import MeasuredSurface
from rig.results.force_surface.options import ForceSurfacePrediction
from rig.results.predictions.references import Compared, predictions_of, stepped_sines

_INTERVAL = 1.96
"""Half of a 95 % interval of a normal distribution, in standard deviations."""


def predict(model: Path, request: ForceSurfacePrediction) -> Predictions:
    """Return the curves at the requested forces and at those of the references, with errors over the phase.

    The frequency is not suitable for the comparison: where a curve ends at the lowest level, points of the branch beyond have
    no counterpart. Raises `RecordingError` for references
    whose fundamental force was not held, `identification.IdentificationError` for forces beyond the measured levels.
    """
    measured = load_as(MeasuredSurface, model)
    references = [one for path in request.references for one in stepped_sines(path)]
    for measured_at in references:
        if measured_at.controlled != "force":
            raise RecordingError(
                f"`references`: '{measured_at.label}' is not at constant force; a force surface is compared with responses "
                "whose fundamental force was held"
            )
    forces: list[tuple[float, FrequencyResponse | None]] = [
        (force, None) for force in request.forces_without_reference(references, "fundamental")
    ]
    forces += [(one.level, one) for one in references]
    steady = []
    for force_n, reference in forces:
        curve = measured.surface.constant_force(force_n)
        predicted = _as_prediction(curve, measured)
        error = None if reference is None else compare(predicted, reference, over="phase").error
        steady.append(Compared(predicted, reference, error, _band(curve)))
    others = {one.specimen for one in references} - {"", measured.surface.specimen}
    strangers = [f"the model is of {measured.surface.specimen}, a reference of {other}" for other in sorted(others)]
    return predictions_of(measured.surface.specimen, steady, notes=(*measured.notes, *strangers))


def _as_prediction(curve: ConstantForceCurve, measured: MeasuredSurface) -> SteadyPrediction:
    """Convert a curve to a prediction. Its modal amplitude is unknown, because a force surface needs no mode shape."""
    response = curve.response
    amplitude = response.amplitude_m
    turned = amplitude * np.exp(-1j * np.radians(response.phase_lag_deg))
    turns = np.flatnonzero(np.diff(curve.stable.astype(int)))
    return SteadyPrediction(
        force_n=response.level,
        force="fundamental",
        channels=("drive",),
        frequency_hz=response.frequency_hz,
        modal_amplitude=np.full(amplitude.size, np.nan),
        fundamental_n=response.force_n,
        displacement_m=np.asarray(turned, np.complex128)[:, None],
        stable=curve.stable,
        branch=np.zeros(amplitude.size, dtype=np.int64),
        range_use=amplitude / float(measured.surface.amplitude_m.max()),
        fold_frequency_hz=0.5 * (response.frequency_hz[turns] + response.frequency_hz[turns + 1]),
        fold_amplitude_m=0.5 * (amplitude[turns] + amplitude[turns + 1]),
        fold_modal_amplitude=np.full(turns.size, np.nan),
        notes=(*curve.notes, *_interpolated(curve)),
    )


def _interpolated(curve: ConstantForceCurve) -> tuple[str, ...]:
    if not np.isfinite(curve.amplitude_change).any():
        return ()
    amplitude = 100.0 * float(np.nanmax(curve.amplitude_change))
    frequency = 100.0 * float(np.nanmax(curve.frequency_change_hz / curve.response.frequency_hz))
    return (
        f"leaving out every second level changes amplitudes by up to {amplitude:.2g} %, frequencies by up to "
        f"{frequency:.2g} %: the interpolation between all levels is more accurate than that",
    )


def _band(curve: ConstantForceCurve) -> ResponseBand:
    """Return 95 % intervals computed from the scatter of the measured points."""
    response = curve.response
    top = int(np.argmax(response.amplitude_m))
    ends = _INTERVAL * np.array([[-1.0], [1.0]])
    return ResponseBand(
        phase_lag_deg=response.phase_lag_deg,
        amplitude_m=response.amplitude_m + ends * curve.amplitude_std_m,
        frequency_hz=response.frequency_hz + ends * curve.frequency_std_hz,
        peak_amplitude_std_m=float(curve.amplitude_std_m[top]),
        peak_frequency_std_hz=float(curve.frequency_std_hz[top]),
        draws=0,
    )
