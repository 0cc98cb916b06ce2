"""Fit of a model whose linear part shifts from run to run."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, same_channels
from identification.fitting.threads import threads
from identification.models.pnlss.fitting.result import PnlssFit
from identification.models.simulated_runs import run_of
from identification.models.structured.fit import StructuredFit
from identification.scatter.own_shifts import own_shift
from identification.scatter.run_scatter import RunScatter
from identification.scatter.shifts import Effect, Scattered, effects_of, shifted
from identification.scatter.widths import width_of
from vibrolock.arrays import Float

Fit = StructuredFit | PnlssFit

_SETTLED, _SEEN = 0.02, 0.1
"""Largest change of the shifts in a round that ends the fit: relative to the width of their distribution, and to the shift
that changes the outputs by as much as the misfit."""
_FASTEST = 5.0
"""Largest factor on a step of the shifts."""


def fit_with_scatter(
    fit: Callable[..., Fit],
    training: Sequence[Experiment],
    *,
    validation: Sequence[Experiment] = (),
    runs: Sequence[str] | None = None,
    kinds: Sequence[str] = ("frequency", "damping"),
    rounds: int = 8,
    progress: Callable[[str], None] | None = None,
) -> tuple[Fit, RunScatter]:
    """Fit a model together with the run-to-run changes of its linear part.

    The two steps of Lindstrom and Bates (Biometrics 46, 1990, 673) in turn. With given shared parameters, every run's shifts
    are least squares on its own data; the width of their distribution follows from them (`identification.scatter.widths`), and
    draws each towards the middle. Then the shared parameters are fitted to outputs without what the shifts do to them, so any
    fit serves, unchanged. The first fit is to the run with the largest outputs alone, as one run has no scatter in it.

    What a model gets wrong in the same way in all runs stays in the shared parameters. What it gets wrong differently, at
    different levels say, counts as scatter. Shifts of different effects are taken for independent of each other.

    Returns the fit of the shared parameters; its model is that of a run in the middle of the distribution. Its covariance
    does not hold the scatter: the standard error of a shared frequency is at least the ``mean_std`` of its width.

    Raises `IdentificationError` if there are fewer than two runs, names do not match the experiments, or the model has
    no mode in the excited band.

    Parameters
    ----------
    fit
        Called as ``fit(training, validation=...)``; usually `identification.fit_structured` or `identification.identify_pnlss`
        with other arguments bound.
    training, validation
        Experiments. Shifts are estimated for those of the validation too.
    runs
        Name of the run to which each experiment belongs, of the training and then of the validation data; every experiment is
        a run of its own if None.
    kinds
        What shifts: ``frequency``, ``damping`` of the modes in the excited band, and ``gain``.
    rounds
        Largest number of fits.
    progress
        Called with a line after each round.
    """
    everything = [*training, *validation]
    same_channels(everything)
    named = [f"run {index + 1}" for index in range(len(everything))] if runs is None else list(runs)
    if len(named) != len(everything):
        reason = f"are {len(named)} names"
        raise IdentificationError(reason, field="runs", allowed=f"{len(everything)}, one for each experiment")
    names = tuple(dict.fromkeys(named))
    if len(names) < 2:
        raise IdentificationError("is one", field="runs", allowed="two at least to tell what changes from run to run")
    IdentificationError.unless_at_least("rounds", rounds, 2)
    scale = _rms([one.counted_outputs for one in training])
    by_run = [[one for one, name in zip(everything, named, strict=True) if name == run] for run in names]
    loudest = named[int(np.argmax([float(np.max(_rms([one.counted_outputs]) / scale)) for one in training]))]
    found = fit([one for one, name in zip(training, named, strict=False) if name == loudest], validation=())
    effects = effects_of(found.model, everything, kinds)
    shifts, step, speed = np.zeros((len(names), len(effects))), np.zeros((0, 0)), np.ones(len(effects))
    data, settled, count = everything, False, 1
    while True:
        with threads() as workers, ThreadPoolExecutor(workers) as pool:
            own = [*pool.map(own_shift, repeat(found.model), repeat(effects), by_run, repeat(scale), shifts)]
        estimates, variances = np.array([one.shift for one in own]), np.array([one.variance for one in own])
        widths = tuple(width_of(*columns) for columns in zip(estimates.T, variances.T, strict=True))
        size, middle = np.array([width.width for width in widths]), np.array([width.mean for width in widths])
        drawn = (estimates - middle) * size**2 / np.maximum(size**2 + variances, 1e-300)
        step, speed = drawn - shifts, _speed(drawn - shifts, step, speed)
        shifts = shifts + speed * step
        if progress is not None:
            said = ", ".join(f"{effect} {100 * width:.3g} %" for effect, width in zip(effects, size, strict=True))
            progress(f"fit {count}, widths: {said}")
        change, visible = speed * _rms([step.T]), np.median([one.visible for one in own], axis=0)
        settled = count > 1 and bool(np.all(change <= np.maximum(_SETTLED * size, _SEEN * visible)))
        if settled or count == rounds or (isinstance(found, PnlssFit) and found.interrupted):
            break
        base = shifted(found.model, effects, middle)
        data = _without_shifts(base, effects, everything, [shifts[names.index(name)] for name in named])
        found, count = fit(data[: len(training)], validation=data[len(training) :]), count + 1
    left = [run_of(found.model, one).outputs[:, one.counted_from :] - one.counted_outputs for one in data]
    return found, RunScatter(
        effects=effects,
        widths=widths,
        runs=names,
        shifts=shifts,
        estimates=estimates,
        variances=variances,
        misfit=_rms(left[: len(training)]),
        fits=count,
        settled=settled,
    )


def _rms(parts: Sequence[Float]) -> Float:
    """float[n_rows]: RMS of the rows of all parts together."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(parts, axis=1) ** 2, axis=1)))


def _speed(step: Float, before: Float, speed: Float) -> Float:
    """float[n_effects]: factor on a step of the fixed-point iteration, from the step before and its factor.

    Aitken's factor for vectors (Irons and Tuck, Int. J. Numer. Meth. Eng. 1, 1969, 275), for each effect.
    """
    if before.shape != step.shape:
        return speed
    change = step - before
    found = -speed * np.sum(before * change, axis=0) / np.maximum(np.sum(change**2, axis=0), 1e-300)
    return np.asarray(np.clip(found, 1.0, _FASTEST))


def _without_shifts(
    model: Scattered, effects: Sequence[Effect], experiments: Sequence[Experiment], shifts: Sequence[Float]
) -> list[Experiment]:
    def without(experiment: Experiment, shift: Float) -> Experiment:
        change = run_of(shifted(model, effects, shift), experiment).outputs - run_of(model, experiment).outputs
        return replace(experiment, outputs=experiment.outputs - change) if np.all(np.isfinite(change)) else experiment

    with threads() as count, ThreadPoolExecutor(count) as pool:
        return list(pool.map(without, experiments, shifts))
