"""Figures of predictions with their references: frequency responses, sweeps and multisines."""

from typing import Any

import numpy as np

from identification import Predictions, ResponseBand
from rig.drawing.areas import areas, broad, is_narrow
from rig.drawing.steady_curve import BEYOND, UNSTABLE, draw_curve, draw_ends, why_it_ends
from rig.drawing.style import MARKERS, REJECTED, Axes, Figure, length_factor, shade, title
from rig.results.predictions.runs_figure import draw_runs
from rig.results.predictions.sweeps_figure import draw_sweeps, sweeps_shown

_MOST_NAMED = 12
"""Largest number of names in a legend; chosen for legibility."""
_NEAR = 1.3  # the limit of the identified amplitudes is drawn up to this multiple of the top; chosen
_MARGIN = 0.15  # empty part on either side of the measured frequencies, over their span; chosen
_MARKED = {"mfc": "white", "mec": "black", "mew": 0.8, "ls": "none"}
"""Looks of measured points: not of the colour of any curve."""


def draw_predictions(page: Figure, predictions: Predictions) -> None:
    """Draw the predictions that exist, frequency responses and multisines above, sweeps below."""
    narrow = is_narrow(page)
    kinds = [kind for kind in ("steady", "runs", "sweeps") if getattr(predictions, kind)]
    alone = len(kinds) == 1
    shown = sweeps_shown(page, predictions, narrow, alone)
    for kind, area in _areas(page, kinds, shown, narrow).items():
        if kind == "steady":
            _steady_on(area, predictions, beside=not (narrow or alone))
        elif kind == "sweeps":
            draw_sweeps(area, predictions, shown, narrow=narrow)
        else:
            draw_runs(area, predictions)
    counts = [
        f"{n} {name}{'s' if n > 1 else ''}"
        for n, name in (
            (len(predictions.steady), "frequency response"),
            (len(predictions.sweeps), "sweep"),
            (len(predictions.runs), "multisine"),
        )
        if n
    ]
    title(page, f"{predictions.specimen or 'specimen'}: predicted, {', '.join(counts)}")


def _areas(page: Figure, kinds: list[str], sweeps: int, narrow: bool) -> dict[str, Any]:
    panels = {"steady": 3, "sweeps": 3 * sweeps + 1, "runs": 2}
    if narrow:
        return dict(zip(kinds, areas(page, [panels[kind] for kind in kinds], [1.0] * len(kinds)), strict=True))
    above = [kind for kind in kinds if kind != "sweeps"]
    rows = areas(page, [1] * (bool(above) + (sweeps > 0)), [1.0] * (bool(above) + (sweeps > 0)))
    out = {"sweeps": rows[-1]} if sweeps else {}
    widths = [2.0 if kind == "steady" else 1.0 for kind in above]
    if above:
        out |= dict(zip(above, rows[0].subfigures(1, len(above), width_ratios=widths, squeeze=False)[0], strict=True))
    return out


def _steady_on(area: Any, predictions: Predictions, *, beside: bool) -> None:
    if beside:
        size, phase = area.subplots(1, 2)
    else:
        size, phase = area.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    top = max(response.amplitude_m().max() for response in predictions.steady)
    scale, unit = length_factor(np.array([top]))
    count = len(predictions.steady)
    for index, response in enumerate(predictions.steady):
        colour, amplitude, lag = shade(index, count), scale * response.amplitude_m(), response.phase_lag_deg()
        measured, band = predictions.steady_references[index], predictions.steady_bands[index]
        draw_curve(size, response, amplitude, colour, _name(predictions, index))
        draw_curve(phase, response, lag, colour)
        size.plot(response.fold_frequency_hz, scale * response.fold_amplitude_m, "x", color=colour, mew=1.5)
        if band is not None:
            _uncertainty(size, phase, band, scale, colour)
        if measured is not None:
            mark = MARKERS[index % len(MARKERS)]
            name = "measured" if count == 1 else f"measured, curve {index + 1}" if count <= _MOST_NAMED else None
            size.plot(measured.frequency_hz, scale * measured.amplitude_m, mark, label=name, **_MARKED)
            phase.plot(measured.frequency_hz, measured.phase_lag_deg % 360.0, mark, **_MARKED)
        else:
            draw_ends(size, response, amplitude, colour)
            draw_ends(phase, response, lag, colour)
    _limit(size, predictions, scale, scale * top)
    _explain(size, predictions)
    size.set(ylabel=f"displacement, {unit}", xlabel="frequency, Hz" if beside else "")
    size.set_ylim(bottom=0.0)
    _show_references(size, predictions)
    if beside:
        phase.set_xlim(size.get_xlim())
    narrow = is_narrow(area.get_figure(root=True))
    area.legend(*size.get_legend_handles_labels(), loc="outside upper left", ncols=1 if narrow else 3)
    phase.set(xlabel="frequency, Hz", ylabel="phase lag, deg")
    phase.axhline(90.0, color=REJECTED, lw=0.8)


def _name(predictions: Predictions, index: int) -> str | None:
    """Return the name of a curve with its error. Of many curves only the first and the last are named."""
    count = len(predictions.steady)
    if count > _MOST_NAMED and 0 < index < count - 1:
        return None
    measured, error = predictions.steady_references[index], predictions.steady_errors[index]
    name = (measured.label if measured else "") or predictions.steady[index].name
    if error is None:
        return f"{name}, predicted"
    error_text = f"peak {100 * error.peak_error:+.2g} %" if np.isfinite(error.peak_error) else "no peak"
    return f"{name}, predicted: {error_text}"


def _uncertainty(size: Axes, phase: Axes, band: ResponseBand, scale: float, colour: Any) -> None:
    """Draw the 95 % band as areas: between the limits of amplitude, and between the limits of frequency."""
    middle_hz, middle_m = band.frequency_hz.mean(axis=0), band.amplitude_m.mean(axis=0)
    peak = int(np.argmax(middle_m))
    size.fill(
        np.concatenate([middle_hz, middle_hz[::-1]]),
        scale * np.concatenate([band.amplitude_m[0], band.amplitude_m[1][::-1]]),
        color=colour,
        alpha=0.25,
        lw=0,
    )
    for side in (slice(None, peak + 1), slice(peak, None)):  # one area of both would cross itself
        size.fill_betweenx(scale * middle_m[side], *band.frequency_hz[:, side], color=colour, alpha=0.25, lw=0)
    phase.fill_betweenx(band.phase_lag_deg, *band.frequency_hz, color=colour, alpha=0.25, lw=0)


def _limit(size: Axes, predictions: Predictions, scale: float, top: float) -> None:
    highest = max(predictions.steady, key=lambda response: float(response.range_use.max()))
    where = int(np.argmax(highest.range_use))
    limit = scale * float(highest.amplitude_m()[where] / highest.range_use[where])
    if limit < _NEAR * top and np.isfinite(highest.modal_amplitude).all():  # models with states have no modal amplitude
        size.axhline(limit, color=REJECTED, lw=0.9, ls="--", label="largest amplitude identified")


def _show_references(size: Axes, predictions: Predictions) -> None:
    found = [reference.frequency_hz for reference in predictions.steady_references if reference is not None]
    if len(found) == len(predictions.steady):
        every = np.concatenate(found)
        margin = _MARGIN * np.ptp(every)
        size.set_xlim(every.min() - margin, every.max() + margin)


def _explain(size: Axes, predictions: Predictions) -> None:
    if not all(response.stable.all() for response in predictions.steady):
        size.plot([], [], ls=UNSTABLE, color=REJECTED, label="unstable")
    if any(response.fold_frequency_hz.size for response in predictions.steady):
        size.plot([], [], "x", color=REJECTED, mew=1.5, label="fold: a sweep jumps here")
    if any(response.range_use.max() > BEYOND for response in predictions.steady):
        size.plot([], [], color=REJECTED, lw=broad(), alpha=0.25, label="beyond the identified range")
    if any(band is not None for band in predictions.steady_bands):
        size.fill([], [], color=REJECTED, alpha=0.25, lw=0, label="95 % by the model's errors")
    alone = zip(predictions.steady, predictions.steady_references, strict=True)
    for reason in dict.fromkeys(why for one, reference in alone if reference is None for why in why_it_ends(one)):
        size.plot([], [], "s", color=REJECTED, label=f"ends here: {reason}")
