"""From a recording to experiments: which points, which channels, at which rate."""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, get_args

import numpy as np

from identification import Experiment, IdentificationError
from identification.signals.decimation import LARGEST_FACTOR
from identification.validation import positive
from rig.bench.configuration import validated
from rig.campaigns.evaluation.drift import of_the_result
from rig.campaigns.evaluation.point import Point, point_name, vibration_of
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import MultisineResult
from rig.errors import RecordingError
from rig.measurements import bench_of_recording, point_rows
from rig.measurements.experiments.periods import Periods, WantedPeriods, realisation
from rig.measurements.experiments.records import FEWEST_PERIODS, segment, sweep_pieces
from rig.measurements.experiments.signals import Signals
from rig.recording.reader import Recording

__all__ = ["KINDS", "default_rate_hz", "experiments", "rows_from_rest"]

KINDS = tuple(name for name, campaign in CAMPAIGNS.items() if campaign.experiments)
"""Kinds of recordings that hold experiments."""

SAMPLES_PER_PERIOD = 25
"""Of the highest excited frequency: the paper has 22.9 and 28.4."""
FEWEST_SAMPLES_PER_PERIOD = 2.5
"""Of the highest excited frequency: below, its lines are cut off with what would fold."""
_SAME_RATIO = 1e-12
_ROUND = (8.0, 5.0, 4.0, 2.5, 2.0, 1.0)


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
    """The accepted points of a recording as training or test data, in the order of the plan.

    A multisine's realisation becomes one settled period, begun where the signal begins, with as much of the period before
    ahead of it as ``transient_periods`` says. A sweep is taken whole, with all that led to it from rest
    ahead of it; one in which samples were lost in pieces.
    Of a point of a backbone, stepped phase, stepped sine or response-controlled test ``segment_periods`` periods are
    taken, whatever number of samples they have: their initial state is to be estimated.

    Parameters
    ----------
    recording
        An open recording.
    inputs, outputs
        Names or roles of channels; ``voltage`` is the output of the rig. Without ``outputs``: all motions, and the force where
        that is no input.
    rate_hz
        Sample rate of the experiments, at most the recording's; `default_rate_hz` if not given. A multisine's period must
        be whole samples then; elsewhere the ratio of the two rates one of whole numbers up to 1000.
    periods
        Of a multisine: the ``mean`` over its periods, or ``all`` of them.
    transient_periods
        Of a multisine, put ahead: as many as its plan waited for before it recorded, one at least, if not given. Fewer than
        a vibration takes to decay cost accuracy.
    segment_periods
        Of a settled point, at most.

    Raises
    ------
    RecordingError
        For a recording of a kind that holds no experiments.
    identification.IdentificationError
        Where nothing is left, a channel is not there, or the rate does not fit.
    """
    if recording.kind not in KINDS:
        raise RecordingError(f"{recording.path}: holds a {recording.kind}, wanted is a {' or a '.join(KINDS)}")
    if periods not in get_args(Periods):
        raise IdentificationError(f"periods: is '{periods}', allowed are {', '.join(get_args(Periods))}")
    if transient_periods is not None and not 0.0 <= transient_periods < math.inf:
        raise IdentificationError(f"transient_periods: is {transient_periods:g}, needs zero or more")
    if segment_periods < FEWEST_PERIODS:
        raise IdentificationError(f"segment_periods: is {segment_periods}, needs {FEWEST_PERIODS} at least")
    bench = bench_of_recording(recording)
    try:
        signals = Signals.chosen(bench, inputs, outputs)
    except IdentificationError as error:
        raise IdentificationError(f"{recording.path}: {error}") from None
    rate_hz = default_rate_hz(recording) if rate_hz is None else positive("rate_hz", rate_hz, "Hz")
    if rate_hz > bench.sample_rate_hz:
        raise IdentificationError(
            f"rate_hz: is {rate_hz:g} Hz, allowed is up to {bench.sample_rate_hz:g} Hz, as fast as was recorded"
        )
    if rate_hz <= FEWEST_SAMPLES_PER_PERIOD * (highest := _highest_hz(recording)):
        raise IdentificationError(
            f"rate_hz: is {rate_hz:g} Hz, {recording.path} is excited up to {highest:g} Hz; allowed is above "
            f"{FEWEST_SAMPLES_PER_PERIOD * highest:g} Hz"
        )
    ratio = rate_hz / bench.sample_rate_hz
    whole = Fraction(ratio).limit_denominator(LARGEST_FACTOR)
    if _made_of(recording) != "realisations" and abs(float(whole) / ratio - 1.0) > _SAME_RATIO:
        raise IdentificationError(
            f"rate_hz: is {rate_hz:.10g} Hz, {recording.path} was recorded at {bench.sample_rate_hz:g} Hz; allowed are ratios "
            f"of whole numbers up to {LARGEST_FACTOR}, such as {float(whole) * bench.sample_rate_hz:.10g} Hz"
        )
    if _made_of(recording) == "realisations":
        plan = validated(MultisinePlan, recording.configuration["plan"], "plan of the recording")
        ahead = max(1, plan.transient_periods) if transient_periods is None else transient_periods
        wanted = WantedPeriods(rate_hz=rate_hz, periods=periods, transient_periods=ahead)
        return tuple(
            realisation(
                signals,
                plan,
                point,
                point_rows(recording, point.number),
                wanted,
                f"{_called(recording.path.stem, point)}, realisation {(point.realisation or 0) + 1}",
            )
            for point in _accepted(recording, MultisineResult)
        )
    found = tuple(_records(recording, signals, _accepted(recording), rate_hz, segment_periods))
    if not found:
        raise IdentificationError(f"{recording.path}: no record without lost samples is long enough to be of use")
    return found


def _records(
    recording: Recording, signals: Signals, points: Sequence[Point[Any]], rate_hz: float, segment_periods: int
) -> Iterable[Experiment]:
    """Experiments of all that is no multisine."""
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
    """The rows before a point, by its stored ``number`` from 0, from the last one without an output on: how it was approached.

    With as many more as it takes for a sample at the new rate to fall on the point's first.
    """
    step = ratio.limit_denominator(LARGEST_FACTOR).denominator
    for part in reversed(recording.parts):
        points = [point_from(table) for table in part.points]
        for point in points:
            if point.number == number and point.rows is not None:
                first = point.rows.first_sample
                ends = [one.rows.end_sample for one in points if one.rows is not None]
                begin = max((end for end in ends if end <= first), default=0)
                rows = part.read(begin, first)
                quiet = np.flatnonzero(np.abs(rows["command_v"]) == 0.0)
                if not quiet.size:
                    return rows[:0]
                lead = -(-(rows.size - int(quiet[-1])) // step) * step
                return rows[max(rows.size - lead, rows.size % step) :]
    raise RecordingError(f"{point_name(number)}: nothing was recorded of it")


def default_rate_hz(recording: Recording) -> float:
    """A round number of samples per second, the nearest below 25 a period of the highest frequency that is excited.

    At most the recording's own, and for a multisine such that a period has a whole number of samples. Raises
    `IdentificationError` where no point was accepted.
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
    """The highest frequency that is excited."""
    plan = recording.configuration["plan"]
    if _made_of(recording) == "realisations":
        return float(plan["highest_hz"])
    if _made_of(recording) == "sweeps":
        return max(float(plan["start_hz"]), float(plan["stop_hz"]))
    return max(vibration_of(point).frequency_hz for point in _accepted(recording))


def _made_of(recording: Recording) -> str | None:
    return CAMPAIGNS[recording.kind].experiments


def _accepted(recording: Recording, result: type[Any] | None = None) -> list[Point[Any]]:
    """The accepted points that the plan in force asks for, without the first one repeated at the end."""
    points = points_of(recording) if result is None else points_of(recording, result)
    found = [point for point in of_the_result(points) if point.accepted]
    if not found:
        raise IdentificationError(f"{recording.path}: points: none of the recording was accepted")
    return found


def _called(stem: str, point: Point[Any]) -> str:
    return f"{stem}, {point.level:.4g} {point.level_unit}"
