"""The low-level multisine of a tuning: from a safe voltage upwards until the responses are told from noise.

All of it goes through the ordinary runner into one recording, level by level a change of its plan.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import FrequencyResponseMatrix, PeriodicSpectra
from rig.arming.arming import Arm, asked_once
from rig.arming.run_facts import About
from rig.bench import Bench
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.execution import Progress
from rig.campaigns.running.runner import carry_out, take_up
from rig.errors import ConfigurationError
from rig.measurements import point_rows, spectra
from rig.recording.reader import Recording
from rig.tuning.errors import TuningError
from rig.tuning.spectra import coherence_of, densities, near, voltage_responses

__all__ = ["LinearTest", "measure"]

BAND = (0.4, 2.5)  # of the linear frequency: other modes that a loop could excite lie inside
LINES = 400.0  # lines up to the linear frequency while the level is sought
LINES_A_BANDWIDTH = 4.0
ENOUGH = 0.9998  # coherence: 1.4 % of noise in a line of one period's response
FIRST = 1e-3  # of the largest voltage, RMS
SAFE = 0.5  # of every limit: what peaks may reach while the level is sought
LARGEST_RISE = 4.0
MOST_LEVELS = 12


@dataclass(frozen=True, eq=False)
class LinearTest:
    """What the multisine has told."""

    level_rms_v: float
    """Level that sufficed, V RMS."""
    responses: FrequencyResponseMatrix
    """Force, drive acceleration, and the accelerations of all response channels per volt, with covariance."""
    lead_samples: float
    """Samples from an output to the input that shows it: block, queue and filters of the device that was started."""
    coherence: tuple[float, float]
    """Median over the band around the mode, of force and drive with the voltage, one period each."""
    distortion: float
    """Nonlinear part of the force's response beside its linear one, median over that band; 0 where noise hides it."""
    force_density: float
    """One-sided density of the force's noise near the mode, N^2/Hz."""
    acceleration_density: float
    """The same of the drive acceleration, (m/s^2)^2/Hz."""
    levels_tried_v: tuple[float, ...]
    """Levels on the way, V RMS."""


def measure(
    bench: Bench,
    bench_name: str,
    recording: Path,
    *,
    level_rms_v: float | None = None,
    seed: int = 0,
    realtime: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    arm: Arm = None,
    about: About | None = None,
    damping_of: Callable[[FrequencyResponseMatrix, float], float],
) -> LinearTest:
    """Raise the level until the coherence suffices, then measure with lines as close as the damping asks for.

    ``level_rms_v`` spares the search. ``damping_of`` tells the damping ratio from coarse responses and
    the samples from an output to the input that shows it.

    Raises `TuningError` where a run was stopped or no level within half of the bench's limits suffices,
    `ConfigurationError` for a level beyond the limits.
    """
    run = _Runs(bench, bench_name, recording, seed, realtime, overwrite, progress, asked_once(arm), about)
    level = FIRST * bench.limits.voltage_v if level_rms_v is None else level_rms_v
    tried: list[float] = []
    while True:
        tried.append(level)
        found = run.at(level, _coarse(bench), 1)
        seen = coherence_of(bench, found)
        if min(seen) >= ENOUGH or level_rms_v is not None:
            break
        level = _raised(bench, level, seen, run.share_of_limits, len(tried))
    _audible(bench, level, seen)
    matrix = voltage_responses(bench, found)
    resolution = 2.0 * damping_of(matrix, run.lead_samples) * bench.specimen.linear_frequency_hz / LINES_A_BANDWIDTH
    found = run.at(level, _on_samples(bench, min(resolution, _coarse(bench))), 3)
    matrix = voltage_responses(bench, found)
    around = near(bench, matrix.frequency_hz)
    nonlinear = np.maximum(matrix.total_std[around, 0, 0] ** 2 - matrix.noise_std[around, 0, 0] ** 2, 0.0)
    noise = densities(bench, found)
    return LinearTest(
        level_rms_v=level,
        responses=matrix,
        lead_samples=run.lead_samples,
        coherence=coherence_of(bench, found),
        distortion=float(np.median(np.sqrt(nonlinear) / np.abs(matrix.value[around, 0, 0]))),
        force_density=noise[0],
        acceleration_density=noise[1],
        levels_tried_v=tuple(tried),
    )


class _Runs:
    """One recording that is gone on with at every level."""

    def __init__(
        self,
        bench: Bench,
        name: str,
        recording: Path,
        seed: int,
        realtime: bool,
        overwrite: bool,
        progress: Progress | None,
        arm: Arm,
        about: About | None,
    ) -> None:
        self.bench, self.name, self.path = bench, name, recording
        self.seed, self.realtime, self.overwrite, self.progress = seed, realtime, overwrite, progress
        self.arm, self.about = arm, replace(about or About(), purpose="tuning")
        self.begun = False
        self.share_of_limits = 0.0
        self.lead_samples = 0.0

    def at(self, level_rms_v: float, resolution_hz: float, realisations: int) -> PeriodicSpectra:
        """Spectra at a level; notes how far its peaks went towards the limits, and the lead of the device."""
        lowest, highest = (part * self.bench.specimen.linear_frequency_hz for part in BAND)
        allowed = self.bench.limits.frequency_hz
        plan = MultisinePlan(
            bench=self.name,
            description="low-level multisine of a tuning",
            levels_rms_v=(level_rms_v,),
            lowest_hz=max(lowest, allowed[0]),
            highest_hz=min(highest, allowed[1]),
            resolution_hz=resolution_hz,
            realisations=realisations,
            transient_periods=1,
            periods=2,
        )
        if self.begun:
            done = take_up(
                self.path,
                change=plan,
                realtime=self.realtime,
                progress=self.progress,
                arm=self.arm,
                about=self.about,
                trust_code=True,
            )
        else:
            done = carry_out(
                plan,
                self.bench,
                self.path,
                seed=self.seed,
                realtime=self.realtime,
                overwrite=self.overwrite,
                progress=self.progress,
                arm=self.arm,
                about=self.about,
            )
            self.begun = True
        with done as recording:
            _ended_well(recording, level_rms_v)
            self.lead_samples = float(recording.parts[-1].information["about"]["lead_samples"])
            measured = spectra(recording)[level_rms_v]
            self.share_of_limits = self._share(recording, measured)
        return measured

    def _share(self, recording: Recording, measured: PeriodicSpectra) -> float:
        """Largest peak against its limit."""
        number = next(number for number, point in recording.latest.items() if point["accepted"])
        rows, limits = point_rows(recording, number), self.bench.limits
        shares = [float(np.abs(rows["output_v"]).max()) / limits.voltage_v]
        crest = 4.0
        for index, channel in enumerate(self.bench.channels):
            limit = {"force": limits.force_n, "monitor": math.inf}.get(channel.role, limits.acceleration_m_s2)
            shares.append(float(np.nanmax(np.abs(rows["inputs"][:, index]))) / limit)
            if channel.role in ("drive", "response"):
                amplitude = measured.amplitude[measured.index(channel.name)]
                moved = amplitude / (2.0 * np.pi * measured.frequency_hz) ** 2
                shares.append(crest * float(np.sqrt(0.5 * np.sum(moved**2))) / limits.displacement_m)
        return max(shares)


def _ended_well(recording: Recording, level: float) -> None:
    end = recording.parts[-1].end
    text = "" if end is None else end["text"]
    if end is None or end["reason"] != "completed":
        raise TuningError(f"multisine at {level:.4g} V RMS: {text}; recorded in {recording.path}")
    failed = [point for point in recording.latest.values() if not point["accepted"]]
    if failed:
        raise TuningError(f"multisine at {level:.4g} V RMS: {failed[0]['reason']}; recorded in {recording.path}")


def _raised(bench: Bench, level: float, seen: tuple[float, float], share: float, tried: int) -> float:
    """The next level: by the noise it must overcome, up to half of the limits."""
    noise = math.sqrt(max(1.0 / max(min(seen), 1e-9) - 1.0, 0.0) / (1.0 / ENOUGH - 1.0))
    rise = min(max(1.3 * noise, 1.5), LARGEST_RISE, SAFE / share)
    if rise < 1.05 or tried >= MOST_LEVELS:
        raise TuningError(_silent(bench, level, seen, "at half of the bench's limits"))
    return level * rise


def _audible(bench: Bench, level: float, seen: tuple[float, float]) -> None:
    if min(seen) < 0.9:
        raise TuningError(_silent(bench, level, seen, "at the level asked for"))


def _silent(bench: Bench, level: float, seen: tuple[float, float], when: str) -> str:
    names = [next(c.name for c in bench.channels if c.role == role) for role in ("force", "drive")]
    return (
        f"coherence with the voltage {when}, {level:.4g} V RMS: {seen[0]:.4f} of channel {names[0]!r}, {seen[1]:.4f} of "
        f"channel {names[1]!r}, needed is {ENOUGH}: a sensor, its cable or the amplifier is dead, or the test is all noise"
    )


def _coarse(bench: Bench) -> float:
    return _on_samples(bench, bench.specimen.linear_frequency_hz / LINES)


def _on_samples(bench: Bench, resolution_hz: float) -> float:
    """The resolution nearest to that wanted whose period is a whole number of samples."""
    samples = round(bench.sample_rate_hz / resolution_hz)
    if samples < 2:
        raise ConfigurationError(f"specimen.linear_frequency_hz: too high for {bench.sample_rate_hz:g} samples/s")
    return bench.sample_rate_hz / samples
