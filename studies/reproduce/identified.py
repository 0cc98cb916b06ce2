"""Models of a study. Each is identified once and stored as soon as it is finished."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from identification import (
    Experiment,
    LinearModes,
    ModelJob,
    PnlssFit,
    RunScatter,
    StructuredFit,
    fit_structured,
    fit_with_scatter,
    identify_many,
    identify_pnlss,
    linear_modes,
    realisation_combinations,
)
from rig.errors import RecordingError
from rig.measurements import response_matrices
from rig.recording.reader import Recording
from rig.results.files import load_as, save
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.simulated.data_files import uses_of
from rig.results.structured.model import IdentifiedStructured
from rig.text.durations import duration
from studies.reproduce.options import Options
from studies.reproduce.recordings import exciter_of, recorded

_CHOOSES = 3
"""Every third of the experiments besides the multisines is not fitted; together with the held-out multisines it chooses the
iterate."""


@dataclass(frozen=True, eq=False)
class Models:
    """All models of a study."""

    jobs: tuple[ModelJob, ...]
    """Data from which each model was identified."""
    fits: Mapping[str, PnlssFit | StructuredFit]
    """Fits by name of the model."""
    failures: Mapping[str, str]
    """Why models could not be identified, by name of the model."""
    scatter: Mapping[str, RunScatter]
    """Shifts from run to run by name of the model; empty if no model has any."""

    def times(self) -> list[dict[str, Any]]:
        """Return for each training set: the number of models, and the times and iterations of their fits."""
        found = []
        for training_set in dict.fromkeys(job.training_set for job in self.jobs):
            fits = [self.fits[j.name] for j in self.jobs if j.training_set == training_set and j.name in self.fits]
            if not fits:
                continue
            numbers = [
                (fit.history.seconds[-1], fit.history.iterations, fit.chosen)
                if isinstance(fit, PnlssFit)
                else (fit.seconds, fit.evaluations, fit.evaluations)
                for fit in fits
            ]
            seconds, iterations, chosen = np.array(numbers, float).T
            found.append(
                {
                    "training_set": training_set,
                    "models": len(fits),
                    "seconds_mean": float(seconds.mean()),
                    "seconds_most": float(seconds.max()),
                    "iterations_mean": float(iterations.mean()),
                    "seconds_per_iteration": float(seconds.sum() / max(1, iterations.sum())),
                    "chosen_mean": float(chosen.mean()),
                }
            )
        return found


def identify_all(
    options: Options,
    levels: Mapping[str, Sequence[Experiment]],
    beside: Sequence[Experiment],
    say: Callable[[str], None],
) -> Models:
    """Identify the models that are not in the folder yet. After `KeyboardInterrupt`, the finished models are in the folder."""
    jobs = realisation_combinations(
        levels,
        models=options.counts,
        mixed=options.mixed,
        most=options.realisations,
        beside=[one for index, one in enumerate(beside) if index % _CHOOSES != 1],
        beside_validation=beside[1::_CHOOSES],
    )
    by_name = {job.name: job for job in jobs}
    files = {job.name: options.models_folder / f"{job.name.replace(' ', '-')}.h5" for job in jobs}
    kept = {name: _kept(options, path) for name, path in files.items() if path.exists()}
    fits: dict[str, Any] = {name: one.fit for name, one in kept.items()}
    scatter = {name: one.scatter for name, one in kept.items() if one.scatter is not None}
    failures: dict[str, str] = {}
    identify: Callable[..., Any] = _structured(options, say) if options.model == "structured" else _pnlss(options)
    fit_all = partial(_fit, identify, options.shifts)
    begun, kept_count = time.perf_counter(), len(fits)
    for found in identify_many(jobs, fit_all, n_jobs=options.jobs, done=fits):
        if found.fit is None:
            failures[found.name] = found.reason
        else:
            fits[found.name], shifts = found.fit
            if shifts is not None:
                scatter[found.name] = shifts
            data, fit = (by_name[found.name].training, by_name[found.name].validation), fits[found.name]
            kind = _kind(options)
            one = kind(model=fit.model, fit=fit, seconds=found.seconds, uses=uses_of(*data), scatter=shifts)
            save(one.on(*data, _runs(*data) if shifts else ()), files[found.name])
        done = len(fits) + len(failures)
        count = f"model {done:>3}/{len(jobs)}  {found.name:12}"
        left = _time_left(time.perf_counter() - begun, done - kept_count, len(jobs) - done)
        said = _outcome(fits.get(found.name), scatter.get(found.name), found.reason)
        say(f"{count}  {said}  {found.seconds:.1f} s{left}")
    return Models(jobs, fits, failures, scatter)


def _time_left(taken_s: float, done: int, left: int) -> str:
    """Return how long the models that are left take at the pace of those that are done, in words; empty if none is left."""
    return f", the other {left} some {duration(taken_s / done * left)}" if left else ""


def _runs(training: Sequence[Experiment], validation: Sequence[Experiment]) -> list[str]:
    """Names of the runs: with scatter each realisation is one."""
    return [one.name for one in (*training, *validation)]


def _fit(
    identify: Callable[..., Any], shifts: bool, training: Sequence[Experiment], *, validation: Sequence[Experiment]
) -> tuple[Any, RunScatter | None]:
    """Identify one model, with ``shifts`` together with the shifts of its runs."""
    if shifts:
        return fit_with_scatter(identify, training, validation=validation, runs=_runs(training, validation))
    return identify(training, validation=validation), None


def _pnlss(options: Options) -> Callable[..., PnlssFit]:
    specimen = options.specimen
    return partial(
        _identify,
        states=options.model_states,
        degrees=() if options.saturating else specimen.degrees,
        # The voltage acts on the states alone; monomials of the outputs fit no better, and extrapolate far worse.
        output_degrees=() if options.input == "voltage" or options.saturating else specimen.degrees,
        saturating=options.saturating,
        band_hz=specimen.excited_hz,
        seed=options.seed,
        settings=options.fit_settings,
    )


def _structured(options: Options, say: Callable[[str], None]) -> Callable[..., StructuredFit]:
    """Return the fit of structured models, with modes and suspension from recordings of their own."""
    with Recording(recorded(options, options.specimen.modes_plan, say)) as recording:
        lowest = next(iter(response_matrices(recording).values()))
    modes = linear_modes(lowest, modes=options.specimen.modes)
    known = exciter_of(options, say).suspension_stiffness_n_m if options.specimen.support else 0.0
    return partial(_identify_structured, modes=modes, laws=options.specimen.laws, support=known)


def _identify_structured(
    training: Sequence[Experiment], *, validation: Sequence[Experiment], modes: LinearModes, **how: Any
) -> StructuredFit:
    """Fit one model; a structured model needs no validation data."""
    return fit_structured(modes, training, **how)


def _identify(training: Sequence[Experiment], *, validation: Sequence[Experiment], **how: Any) -> PnlssFit:
    """Identify one model; raise `KeyboardInterrupt` if Ctrl-C has cut the fit short."""
    fit: PnlssFit = identify_pnlss(training, validation=validation, **how)
    if fit.interrupted:
        raise KeyboardInterrupt
    return fit


def _kind(options: Options) -> type[IdentifiedPnlss] | type[IdentifiedStructured]:
    return IdentifiedPnlss if options.model == "pnlss" else IdentifiedStructured


def _kept(options: Options, path: Path) -> IdentifiedPnlss | IdentifiedStructured:
    found = load_as(_kind(options), path)
    if found.fit is None:
        raise RecordingError(f"{path}: holds a model without its fit; remove the file, and it is identified again")
    return found


def _outcome(fit: PnlssFit | StructuredFit | None, scatter: RunScatter | None, reason: str) -> str:
    if fit is None:
        return f"FAILED: {reason}"
    shifts = "" if scatter is None else f"  frequencies shift by {100 * scatter.widths[0].width:.3g} %"
    if isinstance(fit, StructuredFit):
        return f"training {100 * fit.training_error:6.3f} %  {fit.evaluations} simulations{shifts}"
    return (
        f"training {100 * fit.training_error:6.3f} %  validation {100 * fit.validation_error:6.3f} %  iteration "
        f"{fit.chosen} of {fit.history.iterations}{shifts}"
    )
