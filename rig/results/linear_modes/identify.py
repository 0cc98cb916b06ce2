"""Identify linear modes from multisines, time data, hammer tests or frequency responses."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from identification import (
    FrequencyResponseMatrix,
    HammerTest,
    IdentificationError,
    ModalAnalysis,
    PeriodicSpectra,
    best_linear_approximation,
    extrapolated_to_zero,
    linear_modes,
    stabilisation,
)
from identification.common import one_specimen
from rig.campaigns.kinds import kinds_that_yield
from rig.errors import RecordingError
from rig.measurements import Estimator, bench_of_recording, spectra
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.kind import Progress
from rig.results.kinds import KINDS
from rig.results.linear_modes.options import LinearOptions

if TYPE_CHECKING:
    from identification import TimeRecords


def identify(paths: Sequence[Path], options: LinearOptions, progress: Progress | None = None) -> ModalAnalysis:
    """Identify linear modes from multisines or frequency responses. Several levels are extrapolated to zero force."""
    read = [_matrices(path, options.estimator) for path in paths]
    pairs = [pair for found, _ in read for pair in found]
    if options.band_hz is not None:
        low, high = options.band_hz
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
    weighting = options.weighting
    orders = None if options.order is None else range(2, options.order + 1, 2)
    try:
        diagram = stabilisation(fitted, orders, weighting=weighting)
        found = [linear_modes(fitted, modes=options.near or options.count, diagram=diagram, weighting=weighting)]
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
