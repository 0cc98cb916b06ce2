"""The multisine campaign in open loop: periodic random-phase signals, recorded realisation by realisation in whole periods."""

from itertools import product
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from identification import IdentificationError, MultisineDesign
from rig.bench import Bench
from rig.campaigns.planning.plan import OpenLoopPlan, Target
from rig.errors import ConfigurationError
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import Excitation, Segment
from vibrolock.errors import InputError

LARGEST_WAVEFORMS = 100_000_000  # samples of all realisations, which are held in memory


class MultisinePlan(OpenLoopPlan):
    """Multisines at given RMS voltages, with several realisations of random phases at each level.

    Every realisation begins from rest. It is played for ``transient_periods``, which are discarded, and then recorded for
    ``periods``.
    """

    kind: Literal["multisine"] = "multisine"
    """Kind of campaign."""
    levels_rms_v: tuple[float, ...] = Field(min_length=1)
    """RMS of the output voltage, V. The levels are measured one after the other; the largest peak is at most the bench's
    ``voltage_v``."""
    lowest_hz: float = Field(gt=0)
    """Lowest excited frequency, Hz."""
    highest_hz: float = Field(gt=0)
    """Highest excited frequency, Hz."""
    resolution_hz: float = Field(gt=0)
    """Distance of neighbouring lines, Hz. Its inverse is the period, which must be a whole number of samples."""
    grid: Literal["full", "odd", "odd-random"] = "full"
    """Which lines of the band are excited: all (``full``), the odd multiples of the resolution (``odd``), or these except a
    random few (``odd-random``), on which odd distortion is detected. Even distortion is detected on even lines that are not
    excited."""
    detection_group: int = Field(4, ge=2, le=1000)
    """Number of odd lines in a group. ``odd-random`` leaves out one line of each group, chosen by ``phase_seed``."""
    realisations: int = Field(5, ge=1, le=1000)
    """Number of realisations at each level; all of them have at most 1e8 samples."""
    periods: int = Field(4, ge=1, le=100_000)
    """Periods recorded of each realisation."""
    transient_periods: int = Field(2, ge=0, le=10_000)
    """Periods played before the recording starts."""
    phase_seed: int = Field(0, ge=0)
    """Seed of the phases. For a given seed, realisation k is always the same signal, at every level."""
    silent_s: float = Field(0.0, ge=0, le=3600)
    """Time at 0 V that is recorded before the first realisation to measure the noise, s."""
    ramp_s: float = Field(0.5, gt=0, le=60)
    """Length of the ramps to the level and down from it, s; longer where the bench's ``slew_v_per_s`` requires it."""
    accepted_change: float = Field(0.05, gt=0, le=1)
    """Largest relative difference of force or drive between the first recorded period and the mean of the others with which a
    realisation is accepted (RMS in the band). A larger difference indicates a transient or a disturbance."""

    @model_validator(mode="after")
    def _each_level_once(self) -> Self:
        before: set[float] = set()
        for index, level in enumerate(self.levels_rms_v):
            if level in before:
                raise InputError(
                    field=f"levels_rms_v[{index}]", value=level, allowed="each level once", hint="see realisations"
                )
            before.add(level)
        return self

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of levels and realisations."""
        return {"levels_rms_v": len(self.levels_rms_v), "realisations": self.realisations}

    def design(self, sample_rate_hz: float) -> MultisineDesign:
        """Return the multisine of unit RMS; raise `ConfigurationError` if no such multisine exists."""
        try:
            return MultisineDesign.with_resolution(
                sample_rate_hz=sample_rate_hz,
                resolution_hz=self.resolution_hz,
                lowest_hz=self.lowest_hz,
                highest_hz=self.highest_hz,
                grid=self.grid,
                detection_group=self.detection_group,
                grid_seed=self.phase_seed,
            )
        except IdentificationError as error:
            raise ConfigurationError.of(error) from None

    @property
    def level_unit(self) -> str:
        """Unit of the levels: V RMS."""
        return "V RMS"

    def targets(self) -> tuple[Target, ...]:
        """Return every realisation at the first level, then at the next level, and so on."""
        pairs = product(self.levels_rms_v, range(self.realisations))
        return tuple(Target(number=n, level=level, realisation=index) for n, (level, index) in enumerate(pairs))

    def waveforms(self, sample_rate_hz: float) -> np.ndarray:
        """Return one period of every realisation, scaled to unit peak: float64[realisations, period]."""
        design = self.design(sample_rate_hz)
        return np.array([design.unit_peak(self.phase_seed, index) for index in range(self.realisations)])

    def segments(self, sample_rate_hz: float, done: frozenset[int] = frozenset()) -> tuple[Segment, ...]:
        """Return the segments that play all realisations except those in ``done``. Their level is the peak of the waveform."""
        design = self.design(sample_rate_hz)
        ramp = self.ramp_s / design.period_s
        recorded = self.periods + 1.0 / design.period_samples  # one more sample, so that the last period is complete
        out: list[Segment] = []
        if self.silent_s and not done:  # a ramp from 0 V to 0 V: at a held level a quiet channel would count as stuck
            silent = Excitation(design.resolution_hz, waveform=0)
            out.append(Segment(SegmentKind.RAMP, -1, 0.0, self.silent_s / design.period_s, excitation=silent))
        # Compute each crest factor once: it takes a Fourier transform.
        crest_factors = [design.crest_factor(self.phase_seed, index) for index in range(self.realisations)]
        for target in self.targets():
            if target.number in done:
                continue
            index, number = target.realisation or 0, target.number
            peak_v = target.level * crest_factors[index]
            played = Excitation(design.resolution_hz, waveform=index)
            out.append(Segment(SegmentKind.RAMP, number, peak_v, ramp, excitation=played))
            if self.transient_periods:
                out.append(Segment(SegmentKind.HOLD, number, peak_v, float(self.transient_periods), excitation=played))
            out.append(Segment(SegmentKind.RECORD, number, peak_v, recorded, excitation=played))
            out.append(Segment(SegmentKind.RAMP, -1, 0.0, ramp, excitation=played))
        return tuple(out)

    def check(self, bench: Bench) -> None:
        """Refuse bands, periods and peaks that the bench does not allow."""
        self.check_no_harmonics("whose lines are its force")
        self.check_frequencies(bench, lowest_hz=self.lowest_hz, highest_hz=self.highest_hz)
        design = self.design(bench.sample_rate_hz)
        most = LARGEST_WAVEFORMS // design.period_samples
        if most < 1:
            raise ConfigurationError(
                f"a period has {design.period_samples} samples at {bench.sample_rate_hz:g} samples/s",
                field="resolution_hz",
                value=self.resolution_hz,
                allowed=LARGEST_WAVEFORMS,
            )
        if self.realisations > most:
            raise ConfigurationError(
                field="realisations",
                value=self.realisations,
                allowed=f"up to {most} of {design.period_samples} samples, that of resolution_hz = {self.resolution_hz:g} Hz",
            )
        crest = max(design.crest_factor(self.phase_seed, index) for index in range(self.realisations))
        for index, level in enumerate(self.levels_rms_v):
            if not 0.0 < level * crest <= bench.limits.voltage_v:
                raise ConfigurationError(
                    f"peaks reach {level * crest:.3g} V, bench {bench.name}",
                    field=f"levels_rms_v[{index}]",
                    value=level,
                    allowed=f"peaks above 0 and up to {bench.limits.voltage_v:g} V",
                )
