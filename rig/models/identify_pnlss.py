"""From recordings to nonlinear state-space models: data, what is held out, the fit, and its errors."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification import (
    Experiment,
    FitProgress,
    FitSettings,
    PnlssFit,
    error_spectra,
    fit_pnlss,
    identify_pnlss,
    simulated_run,
)
from identification.validation import one_specimen
from rig.errors import RecordingError
from rig.experiments import default_rate_hz, experiments
from rig.experiments.build import KINDS
from rig.models.files import load_as
from rig.models.pnlss import PNLSS, IdentifiedPnlss
from rig.models.pnlss_request import PnlssOptions
from rig.models.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording

__all__ = ["identified_pnlss"]

Progress = Callable[[FitProgress], None]

_EVERY = 4
"""One of so many settled points chooses the iterate."""
_FEWEST_POINTS = 5
"""Settled points of a recording from which on one of them does."""


@dataclass(frozen=True, eq=False)
class _Data:
    """What the fit is given."""

    training: tuple[Experiment, ...]
    validation: tuple[Experiment, ...]
    notes: tuple[str, ...]


def identified_pnlss(paths: Sequence[Path], options: PnlssOptions, progress: Progress | None = None) -> IdentifiedPnlss:
    """The model in recordings, all taken together; after Ctrl-C what was reached, which `PnlssOptions.resume` goes on with.

    Raises `RecordingError` for files that hold something else, `identification.IdentificationError` where the data does not
    allow it.
    """
    begun = time.perf_counter()
    earlier = None if options.resume is None else _earlier(options.resume)
    data = _data(paths, options, earlier)
    settings = FitSettings() if options.iterations is None else FitSettings(iterations=options.iterations)
    if earlier is not None and earlier.fit is not None:
        fit = fit_pnlss(
            earlier.fit.last,
            data.training,
            validation=data.validation,
            settings=settings,
            progress=progress,
            resume=earlier.fit,
        )
        begun -= earlier.seconds
    else:
        fit = identify_pnlss(
            data.training,
            states=2 if options.states is None else options.states,
            degrees=options.chosen_degrees,
            output_degrees=() if options.output_polynomials is False else None,
            saturating=options.saturating or 0,
            validation=data.validation,
            settings=settings,
            progress=progress,
        )
    return _with_errors(fit, data, time.perf_counter() - begun)


def _earlier(path: Path) -> IdentifiedPnlss:
    """The fit that is to go on."""
    if not path.exists():
        raise RecordingError(f"{path}: there is nothing to resume; leave --resume out")
    found: IdentifiedPnlss = load_as(PNLSS, path)
    if found.fit is None:
        raise RecordingError(f"{path}: holds a model from elsewhere and no fit that could go on")
    return found


def _data(paths: Sequence[Path], options: PnlssOptions, earlier: IdentifiedPnlss | None) -> _Data:
    """Experiments of all files at one rate, and those that choose the iterate."""
    for path in (*paths, *options.validation):
        if (kind := kind_of(path)) not in KINDS:
            raise RecordingError(f"{path}: holds a {kind}; a PNLSS model comes from a {' or a '.join(KINDS)}")
    channels = options.channels
    if earlier is not None:
        rate_hz = earlier.model.sample_rate_hz
        channels = {
            "inputs": tuple(channel.name for channel in earlier.model.inputs),
            "outputs": [channel.name for channel in earlier.model.outputs],
        }
    else:
        rate_hz = options.rate_hz or _common_rate_hz(paths)
    held = options.hold_out if options.hold_out is not None else (0 if options.validation else 1)
    training: list[Experiment] = []
    validation: list[Experiment] = []
    notes: list[str] = []
    for path in paths:
        with Recording(path) as recording:
            found = experiments(recording, rate_hz=rate_hz, **channels)
            notes += points_left_out(recording)
        kept, out = _held_out(found, held)
        training += kept
        validation += out
    for path in options.validation:
        with Recording(path) as recording:
            validation += experiments(recording, rate_hz=rate_hz, **channels)
    one_specimen(**{one.name: one.specimen for one in (*training, *validation)})
    if not validation:
        notes.append("no data to choose the iterate by: the last one is taken, however it does on other data")
    if options.relative:
        training, validation = list(_relative(training)), list(_relative(validation) if validation else ())
    return _Data(tuple(training), tuple(validation), tuple(notes))


def _common_rate_hz(paths: Sequence[Path]) -> float:
    """The highest of what the recordings ask for, and no more than the slowest of them was recorded at."""
    rates, most = [], float("inf")
    for path in paths:
        with Recording(path) as recording:
            rates.append(default_rate_hz(recording))
            most = min(most, float(recording.configuration["bench"]["sample_rate_hz"]))
    return min(max(rates), most)


def _held_out(found: Sequence[Experiment], count: int) -> tuple[list[Experiment], list[Experiment]]:
    """What chooses the iterate apart from the others: the last realisations of each level, and every fourth settled point.

    One realisation stays. Without settled points an iterate would be taken that is good at the multisine's levels alone.
    """
    alike: dict[tuple[float, int], list[Experiment]] = {}
    for one in found:
        if one.period_samples:
            alike.setdefault((one.level, one.period_samples), []).append(one)
    out = [one for same in alike.values() for one in same[max(1, len(same) - count) :] if count]
    settled = [one for one in found if not one.period_samples]
    if count and len(settled) >= _FEWEST_POINTS:
        out += settled[_EVERY // 2 : -1 : _EVERY]
    chosen = {id(one) for one in out}
    return [one for one in found if id(one) not in chosen], out


def _relative(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Weighted so that errors of all count relative to their own outputs, whatever the level: by the mean square ratio."""
    power = np.array([np.mean(one.counted_outputs**2, axis=1) for one in experiments])
    pooled = np.mean(power, axis=0)
    pooled = np.where(pooled > 0.0, pooled, 1.0)
    return tuple(
        one.weighted(1.0 / max(float(np.mean(own / pooled)), 1e-12))
        for one, own in zip(experiments, power, strict=True)
    )


def _with_errors(fit: PnlssFit, data: _Data, seconds: float) -> IdentifiedPnlss:
    """The fit, its errors on all data, and spectra of the last periodic experiment, of validation where there is one."""
    both = [(one, "training") for one in data.training] + [(one, "validation") for one in data.validation]
    begins = iter(fit.initial_states)
    known = [next(begins) if use == "training" and one.initial_state == "estimated" else None for one, use in both]
    runs = tuple(
        simulated_run(fit.model, one, initial_state=begin, use=use)
        for (one, use), begin in zip(both, known, strict=True)
    )
    linear = fit.linear
    linear_runs = () if linear is None else tuple(simulated_run(linear, one, use=use) for one, use in both)
    periodic = [one for one in data.validation if one.period_samples]
    periodic = periodic or [one for one in data.training if one.period_samples]
    spectra = error_spectra(fit.model, linear, periodic[-1]) if periodic else None
    return IdentifiedPnlss(
        model=fit.model,
        fit=fit,
        runs=runs,
        linear_runs=linear_runs,
        spectra=spectra,
        seconds=seconds,
        notes=data.notes,
    )
