"""Identify models from recordings."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from identification import (
    Backbone,
    ContinuousBackbone,
    DecayBackbone,
    Exciter,
    FrequencyResponse,
    FrequencyResponseMatrix,
    HammerTest,
    IdentificationError,
    LinearModes,
    ModalAnalysis,
    NonlinearMode,
    PeriodicSpectra,
    best_linear_approximation,
    combined,
    extrapolated_to_zero,
    identify_exciter,
    linear_modes,
    nonlinear_mode,
    stabilisation,
    stepped_sine_mode,
)
from identification.common import one_specimen
from identification.linear import Weighting
from rig.campaigns.kinds import kinds_that_yield
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import (
    STEPPED,
    Estimator,
    backbone,
    bench_of_recording,
    continuous_backbones,
    frequency_responses,
    spectra,
)
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.decay_backbone.identify import identified_decay
from rig.results.decay_backbone.kind import DECAY
from rig.results.files import load, load_as
from rig.results.force_surface.kind import MeasuredSurface
from rig.results.frequency_responses.kind import FREQUENCY_RESPONSES
from rig.results.identify_request import Request
from rig.results.kinds import KINDS
from rig.results.linear_modes.kind import LINEAR_MODES

if TYPE_CHECKING:
    from identification import FitProgress, TimeRecords


def identify_model(
    paths: Sequence[Path], request: Request, *, progress: "Callable[[FitProgress], None] | None" = None
) -> Any:
    """Identify a model in recordings or imported measurements.

    ``progress`` is called after every iteration when a PNLSS model is fitted. Raises `RecordingError` for files with other
    contents, `identification.IdentificationError` if the data does not allow the identification.
    """
    for index, path in enumerate(paths):
        if any(path.exists() and other.exists() and path.samefile(other) for other in paths[:index]):
            raise ConfigurationError(f"{path}: is given twice; each file once")
    if request.kind == "pnlss":
        from rig.results.pnlss.identify import identified_pnlss  # a second, which the other models need not wait for

        return identified_pnlss(paths, request.pnlss, request.data, progress)
    if request.kind == "decay":
        return identified_decay(paths, request.decay, request.near_hz)
    if request.kind == "structured" and request.modes is not None:
        from rig.results.structured.identify import identified_structured  # as above

        return identified_structured(paths, request.modes, request.structured, request.data)
    return _MODELS[request.kind](paths, request)


def modes_in(path: Path) -> LinearModes:
    """Load the linear modes from the file of a modal analysis."""
    return cast(ModalAnalysis, load_as(LINEAR_MODES, path)).modes


def _nonlinear_mode(paths: Sequence[Path], request: Request) -> NonlinearMode:
    """Identify a nonlinear mode from one or several backbones, or from stepped sines (imported or response-controlled)."""
    kinds = {kind_of(path): path for path in paths}
    modes = None if request.modes is None else modes_in(request.modes)
    if set(kinds) == {DECAY.name}:
        return _mode_of_decay(paths, request)
    if request.near_hz:
        raise ConfigurationError("`near`: names a mode of a decay, and the files are none; leave it out")
    if set(kinds) <= {FREQUENCY_RESPONSES.name, *STEPPED}:
        if modes is not None:
            raise ConfigurationError("`modes`: stepped sines of one sensor have no use for mode shapes; leave it out")
        return _stepped_mode(paths)
    identified = []
    for path in paths:
        runs, notes = _backbones(path)
        for run in runs:
            found = (
                run.nonlinear_mode(modes=modes)
                if isinstance(run, ContinuousBackbone)
                else nonlinear_mode(run, modes=modes)
            )
            identified.append(replace(found, notes=(*notes, *found.notes)))
    return identified[0] if len(identified) == 1 else combined(identified)


def _mode_of_decay(paths: Sequence[Path], request: Request) -> NonlinearMode:
    """Return one mode of a decay, or of several decays, as a nonlinear mode."""
    if len(request.near_hz) > 1:
        raise ConfigurationError(f"`near`: {len(request.near_hz)} given, a nonlinear mode is one")
    near = next(iter(request.near_hz), None)
    found = [cast(DecayBackbone, load_as(DECAY, path)).nonlinear_mode(near) for path in paths]
    return found[0] if len(found) == 1 else combined(found)


def _stepped_mode(paths: Sequence[Path]) -> NonlinearMode:
    """Identify a nonlinear mode from levels of a held response; refuse stepped sines at force or voltage levels.

    At such levels the amplitude of the mode varies along each response.
    """
    stepped, missing = _stepped(paths)
    if all(item.controlled != "response" for item in stepped):
        raise ConfigurationError(
            f"{', '.join(map(str, paths))}: frequency responses at levels of force or voltage, not a mode (`rig plot` shows "
            "them); a nonlinear mode comes from backbones, or from levels of a held response"
        )
    try:
        found = stepped_sine_mode(stepped)
    except IdentificationError as error:
        raise IdentificationError(
            f"{error}; `kind` force-surface takes levels of held displacement as they are"
        ) from None
    return replace(found, notes=(*missing, *found.notes))


def _stepped(paths: Sequence[Path]) -> tuple[list[FrequencyResponse], tuple[str, ...]]:
    """Return stepped sines, recorded or imported, and notes on planned points that are missing."""
    measured: list[FrequencyResponse] = []
    notes: tuple[str, ...] = ()
    for path in paths:
        kind = kind_of(path)
        if kind == FREQUENCY_RESPONSES.name:
            measured += load(path)
        elif kind in STEPPED:
            with Recording(path) as recording:
                measured += frequency_responses(recording)
                notes += points_left_out(recording)
        else:
            raise RecordingError(
                f"{path}: holds a {kind}; a force surface comes from response-controlled or stepped sines"
            )
    return measured, notes


def _force_surface(paths: Sequence[Path], request: Request) -> MeasuredSurface:
    """Build a force surface from levels of held displacement, taking all files together."""
    measured, missing = _stepped(paths)
    one_specimen(**{response.label: response.specimen for response in measured})
    found = MeasuredSurface(tuple(measured), missing)
    found.surface  # noqa: B018 refused here, not when the file is read
    return found


def _backbones(path: Path) -> tuple[Sequence[Backbone | ContinuousBackbone], tuple[str, ...]]:
    """Backbones in a recording, one for each repeat of a continuous backbone, and a note on planned points that are missing."""
    kind = kind_of(path)
    if kind in KINDS and isinstance(measured := load(path), Backbone):
        return (measured,), ()
    if kind not in kinds_that_yield(Backbone):
        raise RecordingError(
            f"{path}: holds a {kind}; a nonlinear mode comes from backbones, or from stepped sines alone"
        )
    with Recording(path) as recording:
        notes = points_left_out(recording)
        continuous = kind in kinds_that_yield(ContinuousBackbone)
        return (continuous_backbones(recording) if continuous else (backbone(recording),)), notes


def _linear(paths: Sequence[Path], request: Request) -> ModalAnalysis:
    """Identify linear modes from multisines or frequency responses. Several levels are extrapolated to zero force."""
    estimator = cast(Estimator, request.estimator)
    read = [_matrices(path, estimator) for path in paths]
    pairs = [pair for found, _ in read for pair in found]
    if request.band_hz is not None:
        low, high = request.band_hz
        pairs = [
            (shown.select(lowest_hz=low, highest_hz=high), fitted.select(lowest_hz=low, highest_hz=high))
            for shown, fitted in pairs
        ]
    pairs.sort(key=lambda pair: pair[0].input_rms or (0.0,))
    one_specimen(
        **{
            f"{shown.input_rms[0]:.3g} {shown.inputs[0].unit} RMS": shown.specimen
            for shown, _ in pairs
            if shown.input_rms
        }
    )
    lowest, fitted = pairs[0]
    weighting = cast(Weighting, request.weighting)
    orders = None if request.order is None else range(2, request.order + 1, 2)
    try:
        diagram = stabilisation(fitted, orders, weighting=weighting)
        found = [linear_modes(fitted, modes=request.near_hz or request.count, diagram=diagram, weighting=weighting)]
        found += [linear_modes(higher, modes=found[0], weighting=weighting) for _, higher in pairs[1:]]
    except IdentificationError as error:
        raise IdentificationError(
            str(error).replace("starting frequencies", "starting frequencies by `near`")
        ) from None
    modes = found[0] if len(found) == 1 else extrapolated_to_zero(*found)
    notes = [note for _, missing in read for note in missing]
    return ModalAnalysis(replace(modes, notes=(*notes, *modes.notes)), lowest, diagram)


def _matrices(
    path: Path, estimator: Estimator
) -> tuple[list[tuple[FrequencyResponseMatrix, FrequencyResponseMatrix]], tuple[str, ...]]:
    """Return the responses of each level, as they are shown and as they are fitted, and notes on missing planned points.

    With the voltage as instrument, the fit uses force and motions over the voltage.
    """
    kind = kind_of(path)
    if kind in kinds_that_yield(PeriodicSpectra):
        with Recording(path) as recording:
            specimen = bench_of_recording(recording).specimen.name
            measured, missing = list(spectra(recording).values()), points_left_out(recording)
        shown = [best_linear_approximation(s, estimator=estimator, specimen=specimen) for s in measured]
        if estimator != "instrument":
            return [(matrix, matrix) for matrix in shown], missing
        return [(matrix, _over_instrument(s, specimen)) for matrix, s in zip(shown, measured, strict=True)], missing
    if kind == "time-data":
        from rig.results.simulated.data_files import time_records_in  # loads what other models need not wait for

        found = [_responses_over_time(records, estimator) for records in time_records_in(path).levels().values()]
        return found, ()
    if kind in KINDS:
        loaded = load(path)
        matrix = loaded.responses if isinstance(loaded, HammerTest) else loaded
        if isinstance(matrix, FrequencyResponseMatrix):
            return [(matrix, matrix)], ()
    raise RecordingError(
        f"{path}: holds a {kind}; a linear model comes from multisines, time data, hammer tests or frequency response "
        "matrices"
    )


def _responses_over_time(
    records: "TimeRecords", estimator: Estimator
) -> tuple[FrequencyResponseMatrix, FrequencyResponseMatrix]:
    """Return the responses of one level of time data, as shown and as fitted: over the instrument, if there is one."""
    from identification import time_responses, time_spectra

    shown = time_responses(records, estimator=estimator)
    if not records.period_samples or not records.instrument or estimator != "instrument":
        return shown, shown
    return shown, _over_instrument(time_spectra(records), records.specimen, records.instrument)


def _over_instrument(measured: PeriodicSpectra, specimen: str, instrument: str = "voltage") -> FrequencyResponseMatrix:
    names = [channel.name for channel in measured.channels if channel.role in ("force", "drive", "response")]
    return best_linear_approximation(
        measured, inputs=(instrument,), instruments=(instrument,), outputs=names, specimen=specimen
    )


def _exciter(paths: Sequence[Path], request: Request) -> Exciter:
    """Identify an exciter from the highest level of one multisine recording."""
    if len(paths) != 1:
        raise ConfigurationError(f"`kind` exciter: {len(paths)} files given, allowed is one multisine recording")
    kind = kind_of(paths[0])
    if kind not in kinds_that_yield(PeriodicSpectra):
        raise RecordingError(f"{paths[0]}: holds a {kind}; an exciter model comes from a multisine")
    low, high = request.band_hz or (None, None)
    with Recording(paths[0]) as recording:
        bench = bench_of_recording(recording)
        _, at_level = max(spectra(recording).items())
        notes = points_left_out(recording)
    found = identify_exciter(
        at_level,
        lowest_hz=low,
        highest_hz=high,
        sample_rate_hz=bench.sample_rate_hz,
        stinger_stiffness_n_m=request.stinger_stiffness_n_m,
        resistance_ohm=request.resistance_ohm,
        amplifier_gain=1.0 if request.amplifier_gain is None else request.amplifier_gain,
        source=f"{bench.name}, {bench.specimen.name}",
    )
    return replace(found, notes=(*notes, *found.notes))


_MODELS: dict[str, Callable[[Sequence[Path], Request], Any]] = {
    "nonlinear-mode": _nonlinear_mode,
    "linear": _linear,
    "force-surface": _force_surface,
    "exciter": _exciter,
}
