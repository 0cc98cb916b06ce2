"""Build experiments from a recording: select points, channels and sample rate."""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import get_args

import numpy as np

from identification import Experiment, IdentificationError
from identification.common import positive
from identification.signals import LARGEST_FACTOR
from rig.bench.configuration import validated
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.point import Point, Result, point_name, vibration_of
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MultisineResult
from rig.errors import RecordingError
from rig.measurements import bench_of_recording, point_rows
from rig.measurements.experiments.periods import Periods, realisation
from rig.measurements.experiments.records import FEWEST_PERIODS, segment, sweep_pieces
from rig.measurements.experiments.signals import Signals
from rig.recording.reader import Recording

SAMPLES_PER_PERIOD = 25
"""Samples per period of the highest excited frequency. The paper has 22.9 and 28.4."""
FEWEST_SAMPLES_PER_PERIOD = 2.5
"""Fewest samples per period of the highest excited frequency. With fewer, the anti-alias filter cuts off its lines."""
_SAME_RATIO = 1e-12  # relative difference of ratios that is rounding
_ROUND = (8.0, 5.0, 4.0, 2.5, 2.0, 1.0)  # leading digits of a round sample rate


def kinds_with_experiments() -> tuple[str, ...]:
    """Return the kinds of campaigns whose recordings hold data for nonlinear state-space models."""
    return tuple(name for name, campaign in CAMPAIGNS.items() if campaign.experiments)


def experiments(
    recording: Recording,
    *,
    inputs: Sequence[str] = ("force",),
    outputs: Sequence[str] | None = None,
    rate_hz: float | None = None,
    periods: Periods = "mean",
    transient_periods: float | None = None,
    segment_periods: int = 30,
) -> tuple[Experiment, ...]:
    """Return the accepted points of a recording as training or test data, in the order of the plan.

    A multisine's realisation becomes one settled period that begins where the signal begins. The last ``transient_periods`` of
    the periodic signal are put ahead of it. A sweep is taken whole, preceded by all rows that led to it from rest; if samples
    were lost, it is taken in pieces. Of a point of a backbone, stepped-phase, stepped-sine or response-controlled test,
    ``segment_periods`` periods are taken, with any number of samples; the initial state of such a segment has to be estimated.

    Parameters
    ----------
    recording
        An open recording.
    inputs, outputs
        Names or roles of channels; ``voltage`` is the output of the rig. Without ``outputs``: all motions, and the force if it
        is not an input.
    rate_hz
        Sample rate of the experiments, at most that of the recording; by default `default_rate_hz`. At this rate a multisine's
        period must be a whole number of samples. For other recordings the ratio of the two rates must be one of whole numbers
        up to 1000.
    periods
        For a multisine: the ``mean`` over its periods, or ``all`` of them.
    transient_periods
        For a multisine: number of periods put ahead; by default as many as the plan waited before recording, at least one.
        Fewer periods than a vibration takes to decay reduce the accuracy.
    segment_periods
        For a settled point: largest number of periods.

    Raises
    ------
    RecordingError
        If the kind of recording cannot give experiments.
    identification.IdentificationError
        If no data is left, a channel does not exist, or the rate does not fit.
    """
    if recording.kind not in (kinds := kinds_with_experiments()):
        raise RecordingError(f"{recording.path}: holds a {recording.kind}, expected a {' or a '.join(kinds)}")
    IdentificationError.unless_one_of("periods", periods, get_args(Periods))
    if transient_periods is not None and not 0.0 <= transient_periods < math.inf:
        raise IdentificationError(field="transient_periods", value=transient_periods, allowed="zero or more")
    IdentificationError.unless_at_least("segment_periods", segment_periods, FEWEST_PERIODS)
    bench = bench_of_recording(recording)
    try:
        signals = Signals.chosen(bench, inputs, outputs)
    except IdentificationError as error:
        raise IdentificationError.of(error, where=recording.path) from None
    rate_hz = default_rate_hz(recording) if rate_hz is None else positive("rate_hz", rate_hz, "Hz")
    if rate_hz > bench.sample_rate_hz:
        raise IdentificationError(
            field="rate_hz", value=rate_hz, allowed=f"up to {bench.sample_rate_hz:g} Hz, as fast as was recorded"
        )
    if rate_hz <= FEWEST_SAMPLES_PER_PERIOD * (highest := _highest_hz(recording)):
        raise IdentificationError(
            f"{recording.path} is excited up to {highest:g} Hz",
            field="rate_hz",
            value=rate_hz,
            allowed=f"above {FEWEST_SAMPLES_PER_PERIOD * highest:g} Hz",
        )
    ratio = rate_hz / bench.sample_rate_hz
    whole = Fraction(ratio).limit_denominator(LARGEST_FACTOR)
    if _made_of(recording) != "realisations" and abs(float(whole) / ratio - 1.0) > _SAME_RATIO:
        raise IdentificationError(
            f"{recording.path} was recorded at {bench.sample_rate_hz:g} Hz",
            field="rate_hz",
            value=rate_hz,
            allowed=f"ratios of whole numbers up to {LARGEST_FACTOR}, such as {float(whole) * bench.sample_rate_hz:.10g} Hz",
        )
    if _made_of(recording) == "realisations":
        plan = validated(MultisinePlan, recording.configuration["plan"], "plan of the recording")
        ahead = max(1, plan.transient_periods) if transient_periods is None else transient_periods
        return tuple(
            realisation(
                signals,
                plan,
                point,
                point_rows(recording, point.number),
                rate_hz=rate_hz,
                periods=periods,
                transient_periods=ahead,
                name=f"{_called(recording.path.stem, point)}, realisation {(point.realisation or 0) + 1}",
            )
            for point in _accepted(recording, points_of(recording, MultisineResult))
        )
    found = tuple(_records(recording, signals, _accepted(recording, points_of(recording)), rate_hz, segment_periods))
    if not found:
        raise IdentificationError(f"{recording.path}: no record without lost samples is long enough to be of use")
    return found


def _records(
    recording: Recording, signals: Signals, points: Sequence[Point[object]], rate_hz: float, segment_periods: int
) -> Iterable[Experiment]:
    for point in points:
        rows, name = point_rows(recording, point.number), _called(recording.path.stem, point)
        if _made_of(recording) == "sweeps":
            start_hz = float(recording.configuration["plan"]["start_hz"])
            lead = rows_from_rest(recording, point.number, Fraction(rate_hz / signals.bench.sample_rate_hz))
            rows = np.concatenate([lead, rows])
            yield from sweep_pieces(
                signals, point.level, rows, lead.size, start_hz=start_hz, rate_hz=rate_hz, name=name
            )
        else:
            name = f"{name}, {point_name(point.number)}"
            found = segment(signals, point, rows, rate_hz=rate_hz, periods=segment_periods, name=name)
            if found is not None:
                yield found


def rows_from_rest(recording: Recording, number: int, ratio: Fraction) -> np.ndarray:
    """Return the rows that lead to a point, from the last row without output before it.

    ``number`` is the stored number of the point, from 0. Further rows are included so that a sample at the new rate falls on
    the first row of the point.
    """
    step = ratio.limit_denominator(LARGEST_FACTOR).denominator
    for part in reversed(recording.parts):
        points = [point_from(table) for table in part.points]
        for point in points:
            if point.number == number and point.rows is not None:
                first = point.rows.first_sample
                ends = [one.rows.end_sample for one in points if one.rows is not None]
                begin = max((end for end in ends if end <= first), default=0)
                begin = max(begin, StoredSamples(part).unbroken_from(first))
                rows = part.read(begin, first)
                quiet = np.flatnonzero(np.abs(rows["command_v"]) == 0.0)
                if not quiet.size:
                    return rows[:0]
                lead = -(-(rows.size - int(quiet[-1])) // step) * step
                return rows[max(rows.size - lead, rows.size % step) :]
    raise RecordingError(f"{point_name(number)}: nothing was recorded of it")


def default_rate_hz(recording: Recording) -> float:
    """Return a round sample rate just below 25 samples per period of the highest excited frequency.

    The rate is at most that of the recording. For a multisine it gives a whole number of samples per period. Raises
    `IdentificationError` if no point was accepted.
    """
    bench = bench_of_recording(recording)
    plan = recording.configuration["plan"]
    most = min(SAMPLES_PER_PERIOD * _highest_hz(recording), bench.sample_rate_hz)
    if most == bench.sample_rate_hz:
        return most
    decade = 10.0 ** math.floor(math.log10(most))
    rate_hz = next(factor * decade for factor in _ROUND if factor * decade <= most * (1.0 + 1e-12))
    if _made_of(recording) == "realisations":
        period_s = round(bench.sample_rate_hz / float(plan["resolution_hz"])) / bench.sample_rate_hz
        if abs(rate_hz * period_s - round(rate_hz * period_s)) > 1e-9:
            return math.floor(most * period_s) / period_s
    return rate_hz


def _highest_hz(recording: Recording) -> float:
    plan = recording.configuration["plan"]
    if _made_of(recording) == "realisations":
        return float(plan["highest_hz"])
    if _made_of(recording) == "sweeps":
        return max(float(plan["start_hz"]), float(plan["stop_hz"]))
    return max(vibration_of(point).frequency_hz for point in _accepted(recording, points_of(recording)))


def _made_of(recording: Recording) -> str | None:
    return CAMPAIGNS[recording.kind].experiments


def _accepted(recording: Recording, points: Iterable[Point[Result]]) -> list[Point[Result]]:
    """Return the accepted points of the current plan, without the repetition of the first point."""
    found = [point for point in without_repetition(points) if point.accepted]
    IdentificationError.raise_if(not found, "none of the recording was accepted", where=recording.path, field="points")
    return found


def _called(stem: str, point: Point[object]) -> str:
    return f"{stem}, {point.level:.4g} {point.level_unit}"
