"""The low-level multisine of a tuning, raised from a safe voltage until the responses stand out of the noise.

All levels go through the ordinary runner into one recording; each further level is a change of the plan.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification import FrequencyResponseMatrix, PeriodicSpectra
from rig.bench import Bench
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.level_search import LevelSearch, MultisineSeries, Seen, share_of_limits
from rig.errors import ConfigurationError
from rig.measurements import point_rows, spectra
from rig.recording.reader import Recording
from rig.text.durations import duration
from rig.tick.safety.layout import EndReason
from rig.tuning.converter_bits import OutputBits, output_bits, periodic_beyond
from rig.tuning.plant import TuningError, coherence_of, densities, near, voltage_responses

BAND = (0.4, 2.5)  # of the linear frequency: other modes that a loop could excite lie inside
LINES = 400.0  # number of lines up to the linear frequency while the level is searched for
LINES_PER_BANDWIDTH = 4.0  # lines of the multisine in a half-power bandwidth; chosen
REALISATIONS = 3  # of the last multisine
PERIODS = 2  # of each realisation that are evaluated
TRANSIENT_PERIODS = 1
PLAYED_PERIODS = PERIODS + TRANSIENT_PERIODS
REFINEMENT = 8.0  # of the spacing of the lines where those of the search show no resonance; chosen
MAX_REFINEMENT = 32.0  # most by which the spacing of the lines is reduced after the search
GOOD_COHERENCE = 0.9998  # coherence: 1.4 % of noise in a line of one period's response
MIN_COHERENCE = 0.9  # least coherence of a level chosen by the user, or of the highest that the limits allow
MAX_CREST_FACTOR = 4.0  # largest expected ratio of peak to RMS of a multisine's response
MAX_DISTORTION = 0.005  # distortion relative to the linear response of the force
OTHER = 2.0  # factor between the levels of a test and of a second one; chosen
AFTER_TRIP = 0.25  # level of the search after one that has tripped, over that one; chosen
LIMITS = tuple(
    reason.name.lower() for reason in (EndReason.FORCE_LIMIT, EndReason.RESPONSE_LIMIT, EndReason.DISPLACEMENT_LIMIT)
)
"""Ends of a run at a limit of force or motion."""
STUCK = EndReason.SENSOR_STUCK.name.lower()
SEARCH = LevelSearch(safe_share=0.5, least_rise=1.05, most_levels=12)  # see `LevelSearch`; chosen


@dataclass(frozen=True, eq=False)
class LinearTest:
    """Result of the multisine."""

    level_rms_v: float
    """Level that was used, V RMS."""
    responses: FrequencyResponseMatrix
    """Responses per volt, with covariance: force, drive acceleration, and the accelerations of all response channels."""
    lead_samples: float
    """Samples from an output to its effect in the inputs: block, queue and filters of the device."""
    coherence: tuple[float, float]
    """Coherence of force and drive with the voltage for one period, median over the band around the mode."""
    distortion: float
    """Ratio of the nonlinear to the linear part of the force response, median over the same band; 0 if noise hides it."""
    force_density: float
    """One-sided noise density of the force near the mode, N^2/Hz."""
    acceleration_density: float
    """One-sided noise density of the drive acceleration near the mode, (m/s^2)^2/Hz."""
    bits: OutputBits
    """Force that the last bits of the output converter cause, at frequencies other than the output's."""
    levels_tried_v: tuple[float, ...]
    """All levels that were played in the search, V RMS."""
    share_of_limits: float
    """Largest peak of output and channels relative to its limit."""
    tripped: str = ""
    """How a level of the search has tripped, after which a quarter of it was played; empty if none has."""

    @property
    def other_levels_v(self) -> tuple[float, ...]:
        """Levels for a second test, V RMS: twice this one where limits and distortion allow, half of it where noise does."""
        up = OTHER * self.share_of_limits <= SEARCH.safe_share and self.distortion <= MAX_DISTORTION
        down = 1.0 / (1.0 + OTHER**2 * (1.0 / min(self.coherence) - 1.0)) >= MIN_COHERENCE
        return (OTHER * self.level_rms_v,) * up + (self.level_rms_v / OTHER,) * down


def measure(
    series: MultisineSeries,
    bench_name: str,
    damping_of: Callable[[FrequencyResponseMatrix, float], float],
    level_rms_v: float | None = None,
    highest_hz: float | None = None,
) -> LinearTest:
    """Raise the level until the coherence suffices, then measure with a line spacing that the damping requires.

    ``bench_name`` is the name of the bench in the recorded plan. ``damping_of`` returns the damping ratio from coarse responses
    and the number of samples between an output and the input that responds to it. With ``level_rms_v`` there is no search.
    ``highest_hz``: highest frequency of the multisine, by default 2.5 times that of the mode.

    Raises `TuningError` if a run was stopped or no level within half of the bench's limits suffices, `ConfigurationError` for a
    level beyond the limits.
    """
    bench, runs = series.bench, _Runs(series, bench_name, highest_hz)
    if level_rms_v is None:
        tried, enough = SEARCH.search(bench, runs.search_at)
        if not enough:
            _audible(bench, tried[-1], runs.coherence, "at half of the bench's limits")
    else:
        runs.listen(level_rms_v)
        tried = (level_rms_v,)
        _audible(bench, level_rms_v, runs.coherence, "at the level asked for")
    level, damping_ratio = _level_with_a_mode(runs, tried, damping_of)
    resolution = 2.0 * damping_ratio * bench.specimen.linear_frequency_hz / LINES_PER_BANDWIDTH
    # the damping of a resonance between two lines is a guess
    resolution = max(resolution, _coarse(bench) / MAX_REFINEMENT)
    found = runs.at(level, _on_samples(bench, min(resolution, _coarse(bench))), REALISATIONS)
    matrix = voltage_responses(bench, found)
    around = near(bench, matrix.frequency_hz)
    nonlinear = np.maximum(matrix.total_std[around, 0, 0] ** 2 - matrix.noise_std[around, 0, 0] ** 2, 0.0)
    noise = densities(bench, found)
    return LinearTest(
        level_rms_v=level,
        responses=matrix,
        lead_samples=runs.lead_samples,
        coherence=coherence_of(bench, found),
        distortion=float(np.median(np.sqrt(nonlinear) / np.abs(matrix.value[around, 0, 0]))),
        force_density=noise[0],
        acceleration_density=noise[1],
        bits=output_bits(bench, matrix, runs.force_beyond_n),
        levels_tried_v=tried,
        share_of_limits=runs.share_of_limits,
        tripped=runs.tripped,
    )


def _level_with_a_mode(
    runs: "_Runs", tried: tuple[float, ...], damping_of: Callable[[FrequencyResponseMatrix, float], float]
) -> tuple[float, float]:
    """Return the highest level of the search whose responses show a mode, V RMS, and the mode's damping ratio.

    Where the responses of the last level show none, one realisation of finer lines is played at this level, then at lower ones:
    a light resonance lies between two lines of the search, and where a stop is met, a higher level shows no mode. Raises the
    `TuningError` of the last level if no level shows one.
    """
    last = tried[-1]
    with suppress(TuningError):
        return last, damping_of(voltage_responses(runs.bench, runs.measured), runs.lead_samples)
    refusals = []
    for level in [last, *(level for level in reversed(tried) if level < last)]:
        found = runs.at(level, _on_samples(runs.bench, _coarse(runs.bench) / REFINEMENT), 1)
        try:
            return level, damping_of(voltage_responses(runs.bench, found), runs.lead_samples)
        except TuningError as refusal:
            refusals.append(refusal)
    raise refusals[0]


def expected_duration(bench: Bench, *, by_the_clock: bool) -> str:
    """Return how long the multisines take, in words: with one level in the search, and with all that it may try."""
    played_s = PLAYED_PERIODS * LINES / bench.specimen.linear_frequency_hz
    least, most = (duration((levels + REALISATIONS) * played_s) for levels in (1, SEARCH.most_levels))
    resolved = LINES_PER_BANDWIDTH / (2.0 * LINES)
    clock = "" if by_the_clock else ", but a virtual rig does not wait for the clock"
    return (
        f"{least} of multisine, {most} if the level must rise far, longer below {100.0 * resolved:.2g} % damping{clock}"
    )


class _LimitError(TuningError):
    """A multisine has tripped at a limit of force or motion."""


class SilentError(TuningError):
    """A multisine has tripped because a channel read nothing."""


class _UnsteadyError(TuningError):
    """The first period of a multisine differs from the others."""


class _Runs:
    """The multisines of a tuning, and the measurements of the last one."""

    measured: PeriodicSpectra
    """Spectra of the last multisine."""
    rows: NDArray[np.void]
    """Telemetry rows of the last multisine."""
    lead_samples: float
    """Lead of the device, samples."""
    force_beyond_n: float
    """RMS of the periodic force above the excited band, N: distortion, and what the output's last bits cause there."""
    coherence: tuple[float, float]
    """Coherence of force and drive at the last coarse level."""
    share_of_limits = math.nan
    """Largest peak relative to its limit there; NaN before a level was evaluated."""

    tripped = ""
    """How a level of the search has tripped; empty if none has."""

    raised = False
    """Whether a level of the search was raised because too little was read at it."""

    def __init__(self, series: MultisineSeries, bench_name: str, highest_hz: float | None) -> None:
        self.series, self.bench, self.name = series, series.bench, bench_name
        lowest, highest = (part * self.bench.specimen.linear_frequency_hz for part in BAND)
        self.band_hz = (lowest, max(highest, highest_hz or 0.0))

    def at(self, level_rms_v: float, resolution_hz: float, realisations: int) -> PeriodicSpectra:
        """Play a level and return its spectra."""
        (lowest, highest), allowed = self.band_hz, self.bench.limits.frequency_hz
        plan = MultisinePlan(
            bench=self.name,
            description="low-level multisine of a tuning",
            levels_rms_v=(level_rms_v,),
            lowest_hz=max(lowest, allowed[0]),
            highest_hz=min(highest, allowed[1]),
            resolution_hz=resolution_hz,
            realisations=realisations,
            transient_periods=TRANSIENT_PERIODS,
            periods=PERIODS,
        )
        with self.series.play(plan, after_silence=self.raised) as recording:
            _ended_well(recording, level_rms_v)
            self.lead_samples = float(recording.parts[-1].information["about"]["lead_samples"])
            self.measured = spectra(recording)[level_rms_v]
            number = next(point.number for point in points_of(recording) if point.accepted)
            self.rows = point_rows(recording, number)
            self.force_beyond_n = periodic_beyond(
                self.rows["inputs"][:, self.bench.index_of("force")],
                round(self.bench.sample_rate_hz / resolution_hz),
                plan.highest_hz / resolution_hz,
            )
        return self.measured

    def search_at(self, level_rms_v: float) -> Seen:
        """Play a level of the search; one that trips at a limit of force or motion is lowered once, to a quarter.

        The first one, at which a channel reads nothing, or whose periods differ as those of a few bits do, is raised as far,
        once: the sensor may be dead. Later ones are not, for they may be near a limit.
        """
        try:
            return self.listen(level_rms_v)
        except (SilentError, _UnsteadyError):
            if self.raised or self.tripped or not math.isnan(self.share_of_limits):
                raise
            self.raised = True
            return Seen(False, SEARCH.safe_share * AFTER_TRIP, 1.0 / AFTER_TRIP)
        except _LimitError as error:
            if self.tripped:
                raise
            self.tripped = str(error)
            return Seen(False, SEARCH.safe_share / AFTER_TRIP)

    def listen(self, level_rms_v: float) -> Seen:
        """Play a level with coarse lines, and evaluate how its responses stand out of the noise."""
        self.at(level_rms_v, _coarse(self.bench), 1)
        self.coherence = coherence_of(self.bench, self.measured)
        least = min(self.coherence)
        noise = math.sqrt(max(1.0 / max(least, 1e-9) - 1.0, 0.0) / (1.0 / GOOD_COHERENCE - 1.0))
        self.share_of_limits = share_of_limits(self.bench, self.rows, self._moved_m)
        return Seen(least >= GOOD_COHERENCE, self.share_of_limits, max(1.3 * noise, 1.5))

    def _moved_m(self, name: str, _: float) -> float:
        amplitude = self.measured.amplitude[self.measured.index(name)]
        moved = amplitude / (2.0 * np.pi * self.measured.frequency_hz) ** 2
        return MAX_CREST_FACTOR * float(np.sqrt(0.5 * np.sum(moved**2)))


def _ended_well(recording: Recording, level: float) -> None:
    end = recording.parts[-1].end
    text = "" if end is None else end["text"]
    if end is None or end["reason"] != "completed":
        reason = None if end is None else end["reason"]
        error = _LimitError if reason in LIMITS else SilentError if reason == STUCK else TuningError
        raise error(f"multisine at {level:.4g} V RMS: {text}; recorded in {recording.path}")
    last = len(recording.parts) - 1
    failed = [point for point in points_of(recording) if not point.accepted and point.part == last]
    if failed:
        error = _UnsteadyError if failed[0].settled is False else TuningError
        raise error(f"multisine at {level:.4g} V RMS: {failed[0].reason}; recorded in {recording.path}")


def _audible(bench: Bench, level: float, seen: tuple[float, float], when: str) -> None:
    if min(seen) >= MIN_COHERENCE:
        return
    names = [bench.channels[bench.index_of(role)].name for role in ("force", "drive")]
    raise TuningError(
        f"coherence with the voltage {when}, {level:.4g} V RMS: {seen[0]:.4f} of channel {names[0]!r}, {seen[1]:.4f} of "
        f"channel {names[1]!r}, needed is {MIN_COHERENCE}: a sensor, its cable or the amplifier is dead, or the test is all "
        "noise"
    )


def _coarse(bench: Bench) -> float:
    return _on_samples(bench, bench.specimen.linear_frequency_hz / LINES)


def _on_samples(bench: Bench, resolution_hz: float) -> float:
    """Return the resolution nearest to the wanted one whose period is a whole number of samples."""
    samples = round(bench.sample_rate_hz / resolution_hz)
    if samples < 2:
        raise ConfigurationError(
            f"too high for {bench.sample_rate_hz:g} samples/s", field="specimen.linear_frequency_hz"
        )
    return bench.sample_rate_hz / samples
