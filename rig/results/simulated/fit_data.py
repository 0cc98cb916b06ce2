"""Training and validation data of models that are fitted over time: experiments of all files at one sample rate."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import TypeVar, cast

import numpy as np

from identification import Experiment, PnlssFit, RunScatter, StructuredFit, fit_with_scatter
from identification.common import one_specimen
from identification.experiments import Simulator
from rig.errors import ConfigurationError, RecordingError
from rig.recording.arrays import kind_of
from rig.results.simulated.data_files import KINDS, experiments_in, features_of, rates_hz_in, specimen_in
from rig.results.simulated.options import FitDataOptions, RunEffect

Fit = TypeVar("Fit", StructuredFit, PnlssFit)

_EVERY = 4
"""Every how many settled points one is used as validation data."""
_FEWEST_POINTS = 5
"""Fewest settled points of a recording from which validation points are taken."""


@dataclass(frozen=True, eq=False)
class FitData:
    """Data of a fit."""

    training: tuple[Experiment, ...]
    """Experiments to which the model is fitted."""
    validation: tuple[Experiment, ...]
    """Experiments by which the model is judged."""
    runs: tuple[str, ...]
    """Recording of each experiment, of the training and then of the validation data."""
    notes: tuple[str, ...]
    """Remarks on the data for the user, one line each."""

    def with_constant_input(self) -> "FitData":
        """Return the data with an input of 1 in every experiment."""
        training, validation = (
            tuple(one.with_constant_input() for one in several) for several in (self.training, self.validation)
        )
        return replace(self, training=training, validation=validation)

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the data, including use and weight of each experiment."""
        digest = hashlib.sha256()
        for use, several in (("training", self.training), ("validation", self.validation)):
            for one in several:
                digest.update(f"{use} {one.weight:.5e} {features_of(one)}".encode())
        return digest.hexdigest()


def fit_data(
    paths: Sequence[Path],
    options: FitDataOptions,
    what: str,
    *,
    like: Simulator | None = None,
    kinds: Sequence[str] = KINDS,
) -> FitData:
    """Return the experiments of all files at one sample rate, split into training and validation data.

    ``what`` names the kind of model in messages, ``like`` is an earlier model whose sample rate and channels are used, and
    ``kinds`` are those of recordings that such a model is fitted to. Raises `RecordingError` for files with other contents,
    `ConfigurationError` for files and options that do not fit together, `identification.IdentificationError` if the data does
    not allow the identification.
    """
    _check_files(paths, options.validation, what, kinds, needs_lines=like is None)
    inputs, outputs = options.inputs, options.outputs
    if like is not None:
        rate_hz = like.sample_rate_hz
        inputs = tuple(channel.name for channel in like.inputs)
        outputs = tuple(channel.name for channel in like.outputs)
    else:
        rates = [] if options.rate_hz else [rates_hz_in(path) for path in paths]
        rate_hz = options.rate_hz or min(max(suitable for suitable, _ in rates), min(known for _, known in rates))
    held = options.hold_out if options.hold_out is not None else (0 if options.validation else 1)
    training: list[Experiment] = []
    validation: list[Experiment] = []
    recordings: dict[int, str] = {}
    notes: list[str] = []
    most = 0
    for path in paths:
        found, missing = experiments_in(path, rate_hz, inputs, outputs)
        recordings |= {id(one): str(path) for one in found}
        notes += missing
        most = max(most, *(len(same) for same in _alike(found)), 0)
        kept, out = _held_out(found, held)
        training += kept
        validation += out
    if options.hold_out is not None and options.hold_out >= max(most, 2):
        raise ConfigurationError(
            f"`hold_out` = {options.hold_out}: no level has more than {most} realisations; allowed is 0 to {max(most - 1, 1)}"
        )
    for path in options.validation:
        found, _ = experiments_in(path, rate_hz, inputs, outputs)
        recordings |= {id(one): str(path) for one in found}
        validation += found
    _check_alive([*training, *validation])
    runs = tuple(recordings[id(one)] for one in (*training, *validation))
    if options.relative:
        training, validation = list(_relative(training)), list(_relative(validation) if validation else ())
    return FitData(tuple(training), tuple(validation), runs, tuple(notes))


def fitted(fit: Callable[..., Fit], data: FitData, scatter: Sequence[RunEffect]) -> tuple[Fit, RunScatter | None]:
    """Call ``fit(training, validation=...)``, with the shifts of the recordings if they are asked for."""
    if not scatter:
        return fit(data.training, validation=data.validation), None
    if len(set(data.runs)) < 2:
        raise ConfigurationError("`scatter`: needs two recordings at least, each of which is a run; add others")
    found, shifts = fit_with_scatter(fit, data.training, validation=data.validation, runs=data.runs, kinds=scatter)
    return cast(Fit, found), shifts


def _check_alive(experiments: Sequence[Experiment]) -> None:
    """Refuse an output that is zero throughout an experiment, because relative errors of it are undefined."""
    for one in experiments:
        for channel, values in zip(one.output_channels, one.counted_outputs, strict=True):
            if not np.any(values):
                raise ConfigurationError(
                    f"{one.name}: output {channel.name} is zero throughout (dead channel); leave it out with `outputs`"
                )


def _check_files(
    paths: Sequence[Path], validation: Sequence[Path], what: str, wanted: Sequence[str], *, needs_lines: bool
) -> None:
    kinds = {path: kind_of(path) for path in (*paths, *validation)}
    for path, kind in kinds.items():
        if kind not in wanted:
            raise RecordingError(
                f"{path}: is a file of kind {kind}; a {what} model comes from recordings: {', '.join(wanted)}"
            )
    for path in validation:
        if any(path.samefile(other) for other in paths):
            raise ConfigurationError(
                f"`validation` = {path}: is among the files that the model is fitted to; leave it out for `hold_out`, or take "
                "another recording"
            )
    if twice := next((one for one, other in combinations(validation, 2) if one.samefile(other)), None):
        raise ConfigurationError(f"`validation` = {twice}: is given twice; each file once")
    if needs_lines and not {"multisine", "time-data"} & {kinds[path] for path in paths}:
        raise ConfigurationError(
            f"{', '.join(f'{path} ({kinds[path]})' for path in paths)}: no multisine among them, which a fit begins with; "
            "add one (or imported time data)"
        )
    one_specimen(**{str(path): specimen_in(path) for path in kinds})


def _held_out(found: Sequence[Experiment], count: int) -> tuple[list[Experiment], list[Experiment]]:
    """Separate validation data: the last realisations of each level, and every fourth settled point.

    At least one realisation of each level stays in training. Without settled points in validation, the chosen iterate would be
    good only at the multisine's levels.
    """
    out = [one for same in _alike(found) for one in same[max(1, len(same) - count) :] if count]
    settled = [
        one for one in found if not one.period_samples and one.initial_state == "estimated"
    ]  # without sweeps from rest
    if count and len(settled) >= _FEWEST_POINTS:
        out += settled[_EVERY // 2 : -1 : _EVERY]
    chosen = {id(one) for one in out}
    return [one for one in found if id(one) not in chosen], out


def _alike(found: Sequence[Experiment]) -> list[list[Experiment]]:
    alike: dict[tuple[float, int], list[Experiment]] = {}
    for one in found:
        if one.period_samples:
            alike.setdefault((one.level, one.period_samples), []).append(one)
    return list(alike.values())


def _relative(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Weight experiments by the mean square of their outputs, so that errors count relative to them at every level."""
    power = np.array([np.mean(one.counted_outputs**2, axis=1) for one in experiments])
    pooled = np.mean(power, axis=0)
    pooled = np.where(pooled > 0.0, pooled, 1.0)
    return tuple(
        one.weighted(1.0 / max(float(np.mean(own / pooled)), 1e-12))
        for one, own in zip(experiments, power, strict=True)
    )
