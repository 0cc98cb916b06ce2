"""Curves of predictions that can be laid over recordings: frequency responses and sweeps, with the references they hold."""

import numpy as np

from identification import FrequencyResponse, Predictions, SteadyPrediction, SweepPrediction, Transient
from identification.models import as_recorded
from rig.drawing.curves import DISPLACEMENT, FORCE, FREQUENCY, LAG, Curves, Line, Panel, Quantity, Trace, View
from vibrolock.arrays import Float


def responses(predictions: Predictions, view: View) -> Curves | None:
    """Return amplitude and phase lag over frequency of the predicted frequency responses; None if there are none.

    Raises `IdentificationError` if the channel of the view was not predicted.
    """
    if not predictions.steady:
        return None
    view.only("channel", of="the file holds the fundamentals alone")
    traces = [_response(one, view) for one in predictions.steady]
    if not view.channel:
        traces += [_measured(one) for one in predictions.steady_references if one is not None]
    across = Quantity(f"displacement amplitude at {view.channel}", "m", "amplitude") if view.channel else DISPLACEMENT
    panels = (Panel(FREQUENCY, across), Panel(FREQUENCY, LAG))
    return Curves(panels, tuple(traces), predictions.specimen, _count(len(predictions.sweeps), "predicted sweep"))


def sweeps(predictions: Predictions, view: View) -> Curves | None:
    """Return amplitude and force over frequency of the predicted sweeps; None if there are none."""
    if not predictions.sweeps:
        return None
    view.only(of="the file holds the fundamental of the drive point alone")
    traces = []
    for sweep, recorded, error in zip(
        predictions.sweeps, predictions.sweep_references, predictions.sweep_errors, strict=True
    ):
        name = sweep.origin.removeprefix("planned ") if error is None else error.name
        traces += _sweep(sweep, recorded, name)
    panels = (Panel(FREQUENCY, DISPLACEMENT), Panel(FREQUENCY, FORCE))
    return Curves(
        panels, tuple(traces), predictions.specimen, _count(len(predictions.steady), "predicted frequency response")
    )


def _response(one: SteadyPrediction, view: View) -> Trace:
    """Return a predicted response; its line is interrupted between branches."""
    between = np.flatnonzero(np.diff(one.branch)) + 1
    unstable = np.insert(~one.stable, between, False)
    channel = view.channel or None
    lines = tuple(
        Line(np.insert(one.frequency_hz, between, np.nan), np.insert(values, between, np.nan), None, unstable)
        for values in (one.amplitude_m(channel), _unwrapped(one.phase_lag_deg(channel)))
    )
    return Trace(one.name, lines, "model")


def _measured(one: FrequencyResponse) -> Trace:
    lines = (Line(one.frequency_hz, one.amplitude_m), Line(one.frequency_hz, _unwrapped(one.phase_lag_deg)))
    return Trace(one.label or f"{one.level:g} {one.level_unit}", lines, "reference")


def _sweep(sweep: SweepPrediction, recorded: Transient | None, name: str) -> list[Trace]:
    """Return a predicted sweep and, if there is one, what was recorded of it."""
    if recorded is None:
        amplitude, force = np.abs(sweep.drive_m), np.abs(sweep.force)
        return [Trace(name, (Line(sweep.frequency_hz, amplitude), Line(sweep.frequency_hz, force)), "model")]
    measured, amplitude, force = as_recorded(sweep, recorded)
    predicted = (Line(sweep.frequency_hz, amplitude), Line(sweep.frequency_hz, force))
    reference = (Line(recorded.frequency_hz, measured), Line(recorded.frequency_hz, np.abs(recorded.force)))
    return [Trace(name, predicted, "model"), Trace(name, reference, "reference")]


def _unwrapped(lag_deg: Float) -> Float:
    """Return a lag between -90 and 270 deg, so that a curve has no jump at rest and at 180 deg."""
    return np.asarray((lag_deg + 90.0) % 360.0 - 90.0)


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'' if number == 1 else 's'}" if number else ""
