"""Identify linear modes from multisines, time data, hammer tests or frequency responses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

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
from rig.bench import Bench
from rig.bench.user_code import named_code
from rig.campaigns.kinds import kinds_that_yield
from rig.drivers import make_daq
from rig.errors import RecordingError, RigError
from rig.measurements import Estimator, bench_of_recording, spectra
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.kind import Progress
from rig.results.kinds import KINDS
from rig.results.linear_modes.options import LinearOptions
from vibrolock.arrays import Complex

if TYPE_CHECKING:
    from identification import TimeRecords


def identify(paths: Sequence[Path], options: LinearOptions, progress: Progress | None = None) -> ModalAnalysis:
    """Identify linear modes from multisines or frequency responses. Several levels are extrapolated to zero force."""
    read = [_matrices(path, options.estimator) for path in paths]
    levels = [level for found, _ in read for level in found]
    if options.band_hz is not None:
        levels = [level.within(options.band_hz) for level in levels]
    levels.sort(key=lambda level: level.shown.input_rms or (0.0,))
    one_specimen(
        **{
            f"{level.shown.input_rms[0]:.3g} {level.shown.inputs[0].unit} RMS": level.shown.specimen
            for level in levels
            if level.shown.input_rms
        }
    )
    lowest = levels[0]
    weighting = options.weighting
    orders = None if options.order is None else range(2, options.order + 1, 2)
    try:
        diagram = stabilisation(lowest.fitted, orders, weighting=weighting)
        near = options.near or options.count
        found = [
            linear_modes(lowest.fitted, modes=near, diagram=diagram, weighting=weighting, error=lowest.image_error())
        ]
        found += [
            linear_modes(level.fitted, modes=found[0], weighting=weighting, error=level.image_error())
            for level in levels[1:]
        ]
    except IdentificationError as error:
        raise IdentificationError(
            str(error).replace("starting frequencies", "starting frequencies by `near`")
        ) from None
    modes = found[0] if len(found) == 1 else extrapolated_to_zero(*found)
    notes = [note for _, missing in read for note in missing]
    return ModalAnalysis(replace(modes, notes=(*notes, *modes.notes)), lowest.shown, diagram)


@dataclass(frozen=True, eq=False)
class _Level:
    """Frequency responses of one level, as they are shown and as they are fitted."""

    shown: FrequencyResponseMatrix
    fitted: FrequencyResponseMatrix
    bench: Bench | None = None

    def within(self, band_hz: tuple[float, float]) -> "_Level":
        low, high = band_hz
        return replace(
            self,
            shown=self.shown.select(lowest_hz=low, highest_hz=high),
            fitted=self.fitted.select(lowest_hz=low, highest_hz=high),
        )

    def image_error(self) -> Complex | None:
        """Error of ``fitted`` by images of the held output; None where the driver does not know them.

        It is also None for a recorded bench that names code, which would be imported: identifying trusts no recording.
        """
        if self.bench is None or named_code(self.bench):
            return None
        try:
            shares = make_daq(self.bench).image_shares(self.fitted.frequency_hz)
        except RigError:  # a driver that this computer does not have
            return None
        if not shares:
            return None
        none = np.zeros(self.fitted.frequency_hz.size, np.complex128)
        outputs, inputs = (
            1.0 + np.array([shares.get(channel.name, none) for channel in channels]).T
            for channels in (self.fitted.outputs, self.fitted.inputs)
        )
        return np.asarray(self.fitted.value * (1.0 - inputs[:, None, :] / outputs[:, :, None]))


def _matrices(path: Path, estimator: Estimator) -> tuple[list[_Level], tuple[str, ...]]:
    """Return the responses of each level, and notes on missing planned points.

    With the voltage as instrument, the fit uses force and motions over the voltage.
    """
    kind = kind_of(path)
    if kind in kinds_that_yield(PeriodicSpectra):
        with Recording(path) as recording:
            bench = bench_of_recording(recording)
            measured, missing = list(spectra(recording).values()), points_left_out(recording)
        specimen = bench.specimen.name
        shown = [best_linear_approximation(s, estimator=estimator, specimen=specimen) for s in measured]
        fitted = [_over_instrument(s, specimen) for s in measured] if estimator == "instrument" else shown
        return [_Level(*pair, bench) for pair in zip(shown, fitted, strict=True)], missing
    if kind == "time-data":
        from rig.results.simulated.data_files import time_records_in  # loads what other models need not wait for

        found = [
            _Level(*_responses_over_time(records, estimator)) for records in time_records_in(path).levels().values()
        ]
        return found, ()
    if kind in KINDS:
        loaded = load(path)
        matrix = loaded.responses if isinstance(loaded, HammerTest) else loaded
        if isinstance(matrix, FrequencyResponseMatrix):
            return [_Level(matrix, matrix)], ()
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
