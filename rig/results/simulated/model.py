"""What files of models that are simulated have in common: errors by experiment, spectra and a stretch of one experiment."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from identification import (
    ErrorSpectra,
    Experiment,
    IdentificationError,
    OutputStretch,
    ResponseBand,
    RunScatter,
    SimulatedRun,
    SteadyPrediction,
    error_spectra,
    output_stretch,
    simulated_run,
)
from identification.common import Arrays, Attributes, stored
from identification.experiments import Simulator, unsettled
from rig.errors import ConfigurationError
from vibrolock.results import Result

if TYPE_CHECKING:
    from rig.results.simulated.open_bands import OpenBands


def _check_parts(_: Arrays, attributes: Attributes) -> None:
    if not {"fit", "model"} & attributes.keys():
        raise IdentificationError("file of a model: holds neither a fit nor a model")
    if "runs" not in attributes:
        raise IdentificationError("runs: is missing")


@stored(shared={"model": "fit"}, upgrade=_check_parts)
@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedModel(Result):
    """A model with its errors on the data with which it was identified."""

    model: Simulator
    runs: tuple[SimulatedRun, ...] = ()
    """Every experiment as simulated by the model."""
    linear_runs: tuple[SimulatedRun, ...] = ()
    """The same by the linear start; may be empty."""
    spectra: ErrorSpectra | None = None
    """Spectra of one periodic experiment, of validation data if there is any; None if there is no periodic experiment."""
    stretch: OutputStretch | None = None
    """A short stretch of one experiment over time, of validation data if there is any; None if it was not kept."""
    seconds: float = float("nan")
    """Wall time of the identification; NaN if unknown."""
    notes: tuple[str, ...] = ()
    """Remarks on the data for the user, one line each."""
    data: str = ""
    """Fingerprint that identifies the data of the fit; empty if unknown."""
    uses: Mapping[str, str] = field(default_factory=dict)
    """``training`` or ``validation``, by the fingerprint of each experiment; empty if unknown."""
    scatter: RunScatter | None = None
    """Shifts of the model from run to run; None if it has none. Then ``model`` is that of a run in the middle."""

    @property
    def linear(self) -> Simulator | None:
        """Linear start of the fit; None if unknown."""
        return None

    @property
    def functions(self) -> list[str]:
        """Functions of the user, ``module:name``, that the model names. To simulate it, they are imported."""
        return []

    @property
    def steps_left(self) -> float:
        """Share of the errors of the model's steps that its fit has not made up for; 1 if unknown."""
        return 1.0

    @property
    def fit_is_missing(self) -> bool:
        """Whether bands need a covariance that is unknown."""
        return self.scatter is None and self.allowed_by_fit(0) is None

    def allowed_by_fit(self, count: int) -> list[Simulator] | None:
        """Return models drawn by the covariance of the fit; None if it is unknown."""
        return None

    def with_what_is_open(
        self, band: ResponseBand, response: SteadyPrediction, respond: Callable[[Any], SteadyPrediction]
    ) -> ResponseBand:
        """Return the band of `allowed_by_fit` with what the data leave open; raise `IdentificationError` if it is too much."""
        return band

    def open_bands(self, asked: bool, allowed: bool) -> "OpenBands | None":
        """Return what is to be said of predictions beyond the training data; None for models that say nothing of them.

        ``asked``: whether bands are asked for; ``allowed``: whether such predictions are allowed without a band.
        """
        return None

    def check_trusted(self, path: Path | None, trusted: bool) -> None:
        """Raise `ConfigurationError` if the model names code of a user that is not trusted."""
        if self.functions and not trusted:
            raise ConfigurationError(
                f"{path}: function = {self.functions[0]!r}: is code that the model names, and is not imported unless you trust "
                "it: `trust_code`"
            )

    def judged(
        self,
        training: Sequence[Experiment],
        validation: Sequence[Experiment],
        initial_states: Iterable[np.ndarray] = (),
        recordings: Sequence[str] = (),
    ) -> Self:
        """Return it with its errors on all data, with spectra and a stretch over time.

        ``initial_states``: those of the training experiments that do not begin at rest, in their order. ``recordings``: that of
        each experiment, whose own shifts the model then has.
        """
        every = [(one, "training") for one in training] + [(one, "validation") for one in validation]
        begins = iter(initial_states)
        states = [
            next(begins) if use == "training" and one.initial_state == "estimated" else None for one, use in every
        ]
        models = [self._of(recording) for recording in recordings] or [self.model] * len(every)
        moved = [bool(np.all(np.any(one.counted_outputs != 0.0, axis=1))) for one, _ in every]
        still = [
            f"{one.name}: an output is zero throughout, so that it has no errors"
            for (one, _), is_moved in zip(every, moved, strict=True)
            if not is_moved
        ]
        linear = self.linear
        runs = tuple(
            simulated_run(model, one, initial_state=begin, use=use, steps_left=self.steps_left)
            for (one, use), begin, model in compress(zip(every, states, models, strict=True), moved)
        )
        if untold := unsettled(training):
            runs = tuple(replace(run, over_noise=np.full(run.error.shape, np.nan)) for run in runs)
        found = replace(
            self,
            runs=runs,
            linear_runs=()
            if linear is None
            else tuple(simulated_run(linear, one, use=use) for one, use in compress(every, moved)),
            notes=(*self.notes, *still, *untold),
        )
        return found.on(training, validation, recordings)

    def _of(self, recording: str) -> Simulator:
        return self.model if self.scatter is None else self.scatter.model_of(cast(Any, self.model), recording)

    def on(
        self, training: Sequence[Experiment], validation: Sequence[Experiment], recordings: Sequence[str] = ()
    ) -> Self:
        """Return it with spectra and a stretch over time of the last experiment, preferably periodic and of validation data."""
        every = [*training, *validation]
        periodic = [one for one in validation if one.period_samples] or [one for one in training if one.period_samples]
        shown = (periodic or every)[-1]
        at = next(index for index, one in enumerate(every) if one is shown)
        model = self._of(recordings[at]) if recordings else self.model
        spectra = error_spectra(model, self.linear, shown) if periodic else None
        return replace(self, spectra=spectra, stretch=output_stretch(model, shown))


def exported(found: SimulatedModel) -> list[Simulator]:
    """Return what is exported of a file: the model."""
    return [found.model]
