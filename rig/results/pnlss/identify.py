"""Identify nonlinear state-space models from recordings: data, validation data, fit and errors."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from identification import FitSettings, fit_pnlss, identify_pnlss
from rig.errors import ConfigurationError, RecordingError
from rig.results.files import load_as
from rig.results.kind import Progress, Remark
from rig.results.pnlss.model import IdentifiedPnlss
from rig.results.pnlss.options import PnlssOptions
from rig.results.simulated.data_files import exciter_in, uses_of
from rig.results.simulated.fit_data import FitData, fit_data, fitted


def identify(paths: Sequence[Path], options: PnlssOptions, progress: Progress | None = None) -> IdentifiedPnlss:
    """Identify one model from all recordings together.

    After Ctrl-C, return the state reached; `PnlssOptions.resume` continues from it. Raises `RecordingError` for files with
    other contents, `identification.IdentificationError` if the data does not allow the identification.
    """
    begun, scatter = time.perf_counter(), None
    earlier = None if options.resume is None else _earlier(options.resume)
    if earlier is not None:
        earlier.check_trusted(options.resume, options.trust_code)
    data = fit_data(paths, options, "PNLSS", like=None if earlier is None else earlier.model)
    if options.constant_input:
        data = data.with_constant_input()
    data = replace(data, notes=(*data.notes, *_remarks(data, paths)))
    if earlier is not None and earlier.fit is not None:
        if earlier.scatter is not None or options.scatter:
            raise ConfigurationError(f"{options.resume}: a fit with scatter does not go on; leave `resume` out")
        _check_resumed(options, earlier, data)
    settings = FitSettings(iterations=options.iterations)
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
        how = partial(
            identify_pnlss,
            states=options.states,
            degrees=options.chosen_degrees,
            output_degrees=None if options.output_polynomials else (),
            saturating=options.saturating_features,
            function=options.function,
            settings=settings,
            progress=progress,
        )
        fit, scatter = fitted(how, data, options.scatter)
    found = IdentifiedPnlss(
        model=fit.model,
        fit=fit,
        scatter=scatter,
        seconds=time.perf_counter() - begun,
        notes=data.notes,
        data=data.fingerprint,
        uses=uses_of(data.training, data.validation),
    )
    return found.judged(data.training, data.validation, fit.initial_states, data.runs)


def remark(found: IdentifiedPnlss, path: Path) -> Remark | None:
    """Return how a fit that did not converge goes on."""
    if found.fit is None or not (found.fit.limited or found.fit.interrupted):
        return None
    if found.fit.interrupted:
        return Remark(f"interrupted; the best so far is in {path}, and --resume continues the fit", unfinished=True)
    return Remark(f"the fit was {found.fit.message}; --resume with more --iterations continues it")


def _remarks(data: FitData, paths: Sequence[Path]) -> list[str]:
    first, said = data.training[0], []
    if not data.validation:
        said.append("no validation data: the last iterate is taken, whatever its error on other data")
    if "force" not in [channel.role for channel in (*first.input_channels, *first.output_channels)]:
        said.append("the force is neither input nor output: the model predicts multisines alone; add it to the outputs")
    if "voltage" in [channel.name for channel in first.input_channels]:
        benches = " and ".join(dict.fromkeys(exciter_in(path) for path in paths))
        said.append(f"the input is the voltage: the model holds for the exciter of {benches} alone")
    return said


def _earlier(path: Path) -> IdentifiedPnlss:
    if not path.exists():
        raise RecordingError(f"{path}: there is nothing to resume; leave `resume` out")
    found: IdentifiedPnlss = load_as(IdentifiedPnlss, path)
    if found.fit is None:
        raise RecordingError(f"{path}: holds a model from elsewhere and no fit that could go on")
    return found


def _check_resumed(options: PnlssOptions, earlier: IdentifiedPnlss, data: FitData) -> None:
    """Refuse to continue with other data: validation data, which chose the iterate, might become training data."""
    if earlier.data and earlier.data != data.fingerprint:
        uses = [run.use for run in earlier.runs]
        raise ConfigurationError(
            f"{options.resume}: was fitted to other data ({uses.count('training')} experiments in training, "
            f"{uses.count('validation')} in validation, the first {earlier.runs[0].name}); give the same files, `hold_out`, "
            "`validation` and `relative`"
        )
    done = 0 if earlier.fit is None else earlier.fit.history.iterations
    if "iterations" in options.model_fields_set and options.iterations <= done:
        raise ConfigurationError(f"`iterations` = {options.iterations}: {done} are done; allowed is more")
