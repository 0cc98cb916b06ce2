"""Tune a rig: from a bench alone to gains, margins, levels and a plan."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, get_args

from controller.tuning import PlantModel
from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.ramps import Ramp
from rig.campaigns.plans import plan_from
from rig.campaigns.running.level_search import MultisineSeries
from rig.errors import ConfigurationError
from rig.tuning.design import Chosen, LawName, choose
from rig.tuning.harmonics import HarmonicsChoice, band_for, check_highest, choose_harmonics
from rig.tuning.levels import (
    LARGER_FRACTION,
    LIMIT_FRACTION,
    NARROW_SPAN,
    SPAN,
    LevelChoice,
    LowestForce,
    choose_levels,
    low_pass,
    lowest_force,
    needed_n,
    reach_m,
)
from rig.tuning.linear_test import MAX_DISTORTION, LinearTest, SilentError, measure
from rig.tuning.longer_ramps import ramp_factors
from rig.tuning.plan import plan_levels, plan_text
from rig.tuning.plant import ChannelRatios, UnsuitedError, channel_ratios, compared_with_bench, plant_of
from rig.tuning.shifts import Start, Window, frequency_window, start_of
from rig.tuning.trial import PlanTrial
from vibrolock.one_thread import one_thread
from vibrolock.results import Result

PURPOSE = "tuning"  # purpose of the recording of a tuning, in the facts of its parts
MIN_NOTED_PHASE_DEG = 5.0  # of a response, from which it is worth a note


@dataclass(frozen=True, kw_only=True)
class TuningRequest:
    """Options of a tuning.

    Raises `ConfigurationError` for values that are not allowed.
    """

    level_rms_v: float | None = None
    """Level of the multisine, V RMS; if None it is searched for."""
    law: str = "frequency-error"
    """Frequency law: ``frequency-error`` (with complex response control, levels in m) or ``phase`` (levels in V)."""
    from_m: float | None = None
    """Lowest level of the plan, m peak at the drive point; determined by the noise if None."""
    to_m: float | None = None
    """Highest level of the plan, m peak at the drive point; determined by the limits if None."""
    points: int = 8
    """Number of levels."""
    harmonics: int | None = None
    """Highest harmonic of the force that the plan controls; the multisine then reaches beyond it. None: none is controlled."""

    def __post_init__(self) -> None:
        ConfigurationError.unless_one_of("law", self.law, get_args(LawName))
        if self.level_rms_v is not None and not self.level_rms_v > 0.0:
            raise ConfigurationError(field="level_rms_v", value=self.level_rms_v, unit="V RMS", allowed="above 0")
        ConfigurationError.unless_at_least("points", self.points, 1)
        if self.from_m is not None and self.to_m is not None and self.from_m >= self.to_m:
            raise ConfigurationError(field="from_m", value=self.from_m, allowed=f"below `to_m` = {self.to_m:g} m")

    def check(self, bench: Bench) -> None:
        """Raise `ConfigurationError` for levels and harmonics beyond what the bench allows."""
        if self.harmonics is not None:
            check_highest(bench, self.harmonics)
        farthest = max(bench.response_ratios.values())
        allowed_m = bench.limits.displacement_m / farthest
        why = f": a channel's mode_shape moves {farthest:.3g} times as far" if farthest > 1.0 else ""
        for name, level in (("from_m", self.from_m), ("to_m", self.to_m)):
            if level is not None and not 0.0 < level <= allowed_m:
                raise ConfigurationError(
                    f"the bench {bench.name} allows above 0 and up to {allowed_m:.3g} m{why}",
                    field=name,
                    value=level,
                    unit="m",
                )


@dataclass(frozen=True, eq=False)
class Tuning(Result):
    """Result of a tuning."""

    bench: Bench
    """The bench."""
    test: LinearTest
    """The linear test."""
    recording: Path
    """Recording of the linear test."""
    plant: PlantModel
    """The plant near the mode."""
    response_ratios: dict[str, float]
    """Measured displacement of each response channel per displacement of the drive point at resonance, by name."""
    response_ratio_stds: dict[str, float]
    """Standard errors of these ratios, by name."""
    response_turns_deg: dict[str, float]
    """Measured turns of the response channels off the phases of a real mode shape, deg, by name; those of a degree and more."""
    chosen: Chosen
    """The chosen gains."""
    levels: LevelChoice
    """The chosen levels."""
    harmonics: HarmonicsChoice | None
    """The harmonics loop, if it was asked for."""
    notes: tuple[str, ...]
    """Notes for the user, one line each."""
    level_notes: tuple[str, ...]
    """Those of the notes that are on the levels; they go where a trial changes these."""
    larger: LevelChoice | None
    """Levels up to two thirds of what the limits allow, where rounding bounds the lowest level and none was asked for."""
    start: Start
    """How a run of the plan sets the rig in motion; levels that a trial changes begin as the trial did."""
    window: Window
    """Frequencies that the loop of the plan may take."""
    bench_name: str
    """Name of the bench in the plan."""
    trials: tuple[PlanTrial, ...] = ()
    """Trials of the plan, if it was carried out (`try_plan`); each but the first of the levels that the one before has held."""
    ramps: tuple[Ramp, ...] = ()
    """Ramps of the last trial; those of the plan are longer where the phase lagged in them."""

    @property
    def trial(self) -> PlanTrial | None:
        """The last trial, if there was one."""
        return self.trials[-1] if self.trials else None

    @property
    def ramp_factors(self) -> tuple[float, ...]:
        """How many times as long as the others the plan's ramp to each level is; none if all are alike."""
        return ramp_factors(self.ramps, plan_levels(self.levels, self.chosen.law))

    @property
    def plan_toml(self) -> str:
        """The plan as TOML."""
        return plan_text(
            self.bench_name,
            self.bench,
            self.plant,
            ChannelRatios(self.response_ratios, self.response_ratio_stds, self.response_turns_deg),
            self.chosen,
            self.levels,
            self.ramp_factors,
            self.start,
            self.window,
            self.harmonics,
            self.recording,
        )

    @property
    def plan(self) -> BackbonePlan:
        """The plan, as read from `plan_toml`."""
        import tomllib

        read = plan_from(tomllib.loads(self.plan_toml), "tuned plan")
        if not isinstance(read, BackbonePlan):
            raise TypeError("tuned plan: allowed is a backbone")
        return read


@one_thread()
def tune(
    bench: Bench | str | Path,
    recording: str | Path,
    request: TuningRequest | None = None,
    options: RunOptions | None = None,
    *,
    named: str | None = None,
) -> Tuning:
    """Measure the plant with a low-level multisine, recorded in ``recording``, and design a backbone test for it.

    ``named`` is the name of the bench in the plan.

    Raises `rig.tuning.plant.TuningError`, with the numbers, if the rig is unsuitable, `rig.errors.ConfigurationError` for
    requests that the bench does not allow, `rig.errors.RecordingError` for a recording that cannot be written.
    """
    name = str(bench.name if isinstance(bench, Bench) else bench)
    bench = bench if isinstance(bench, Bench) else load_bench(bench)
    request = request or TuningRequest()
    request.check(bench)
    series = MultisineSeries(bench, Path(recording), options or RunOptions(), PURPOSE)
    found = _designed(bench, request, name, series)
    test, plant, measured, chosen = found.test, found.plant, found.measured, found.chosen
    levels, larger = _levels(found, bench, request)
    level_notes = _reach(bench, levels)
    harmonics = None
    if request.harmonics is not None:
        lock_hz = plant.lock_frequency_rad_s() / (2.0 * math.pi)
        harmonics = choose_harmonics(
            test.responses, test.lead_samples, bench.sample_rate_hz, lock_hz, request.harmonics
        )
    if request.from_m is None:
        level_notes += _narrow(bench, levels, found.lowest)
    return Tuning(
        bench=bench,
        test=test,
        recording=Path(recording),
        plant=plant,
        response_ratios=measured.ratios,
        response_ratio_stds=measured.stds,
        response_turns_deg=measured.turns_deg,
        chosen=chosen,
        levels=levels,
        larger=larger,
        harmonics=harmonics,
        notes=(*found.notes, *_cautions(test), *level_notes),
        level_notes=tuple(level_notes),
        start=start_of(bench, plant, levels.needed_v[0]),
        window=frequency_window(bench, test.responses, plant),
        bench_name=named or name,
    )


class _Designed(NamedTuple):
    """A plant as measured at one level, and the gains for it."""

    test: LinearTest
    plant: PlantModel
    measured: ChannelRatios
    highest_m: float
    lowest: LowestForce
    chosen: Chosen
    notes: tuple[str, ...]


def _designed(bench: Bench, request: TuningRequest, name: str, series: MultisineSeries) -> _Designed:
    """Measure the plant and choose gains; where none suit it, once more at other levels before the rig is refused.

    Near a zero of the force noise and distortion decide on which side of the imaginary axis the plant's pole comes out.
    """

    def measured(level_rms_v: float | None) -> LinearTest:
        return measure(
            series,
            name,
            lambda responses, lead: plant_of(bench, responses, lead).damping_ratio,
            level_rms_v,
            None if request.harmonics is None else band_for(bench, request.harmonics),
        )

    test = measured(request.level_rms_v)
    try:
        return _gains(bench, request, test)
    except UnsuitedError as refusal:
        others = test.other_levels_v if request.level_rms_v is None else ()
        for level in others:
            try:
                found = _gains(bench, request, measured(level))
            except (UnsuitedError, SilentError):
                continue
            note = (
                f"no gains suit the plant as the multisine at {test.level_rms_v:.3g} V RMS shows it; those of this plan are "
                f"for the plant at {level:.3g} V RMS"
            )
            return found._replace(notes=(note, *found.notes))
        if not others:
            raise
        levels = " and ".join(f"{level:.3g}" for level in others)
        raise UnsuitedError(f"{refusal}; no gains suit the plant at {levels} V RMS either") from refusal


def _gains(bench: Bench, request: TuningRequest, test: LinearTest) -> _Designed:
    """Choose gains for the plant that a test shows."""
    plant = plant_of(bench, test.responses, test.lead_samples)
    measured = channel_ratios(test.responses, plant)
    notes = (*compared_with_bench(bench, plant), *_turned(measured.turns_deg))
    ratios = bench.response_ratios | measured.ratios
    highest_m = LIMIT_FRACTION * reach_m(bench, plant, ratios)[0] if request.to_m is None else request.to_m
    lowest = lowest_force(bench, plant, highest_m, test.bits)
    densities = (test.force_density, test.acceleration_density)
    largest, lowest_n, noise = low_pass(plant, densities, lowest.force_n, needed_n(plant, highest_m))
    chosen = choose(plant, test.responses, request.law, largest, noise)
    return _Designed(test, plant, measured, highest_m, replace(lowest, force_n=lowest_n), chosen, notes)


def _levels(found: _Designed, bench: Bench, request: TuningRequest) -> tuple[LevelChoice, LevelChoice | None]:
    """Return levels, and larger ones, up to two thirds of what the limits allow, where rounding bounds the lowest.

    There are no larger ones where levels were asked for.
    """
    plant, ratios = found.plant, bench.response_ratios | found.measured.ratios
    choice = partial(choose_levels, bench, plant, ratios, points=request.points)
    wanted = choice(lowest=found.lowest, highest_m=found.highest_m, from_m=request.from_m)
    if request.from_m is not None or request.to_m is not None or not found.lowest.bound:
        return wanted, None
    highest_m = LARGER_FRACTION * reach_m(bench, plant, ratios)[0]
    bounded = lowest_force(bench, plant, highest_m, found.test.bits)
    lowest = replace(bounded, force_n=max(bounded.force_n, found.lowest.force_n))
    return wanted, choice(lowest=lowest, highest_m=highest_m)


def _narrow(bench: Bench, levels: LevelChoice, lowest: LowestForce) -> list[str]:
    """Return a note on levels that span little because of a converter's last bits."""
    span, bits = levels.levels_m[-1] / levels.levels_m[0], levels.needed_v[-1] / bench.output_bit_v
    if not lowest.bound or span > NARROW_SPAN:
        return []
    text = f"the levels span a factor of {span:.3g}, not {SPAN:g}: the lowest is bounded by {lowest.bound}"
    if "output" in lowest.bound:
        text += f"; the highest has an output of {bits:.0f} bits, less gain behind the converter leaves room for lower levels"
    return [text]


def _turned(turns_deg: Mapping[str, float]) -> list[str]:
    return [
        f"channel {name} stands {abs(turn):.3g} deg {'ahead of' if turn > 0.0 else 'behind'} a real mode shape: a joint that "
        "damps, or a sensor that is late; the plan takes this as known (plant.response_turns_deg)"
        for name, turn in turns_deg.items()
        if abs(turn) >= MIN_NOTED_PHASE_DEG
    ]


def _cautions(test: LinearTest) -> list[str]:
    out = [f"{test.tripped}; the search went on with a quarter of that level"] if test.tripped else []
    if test.distortion > MAX_DISTORTION:
        out.append(
            f"the multisine at {test.level_rms_v:.3g} V RMS shows {100.0 * test.distortion:.2g} % of nonlinear distortion: "
            "frequency and damping are those of that level; tune at a lower one for those of the linear plant"
        )
    return out


def _reach(bench: Bench, levels: LevelChoice) -> list[str]:
    """Return a note on a highest level that leaves little room for more damping."""
    limit, highest = bench.limits.voltage_v, levels.needed_v[-1]
    if highest <= LIMIT_FRACTION * limit * 1.001:
        return []
    return [
        f"the highest level needs {highest:.3g} of {limit:g} V on the linear plant: it is out of reach if the damping "
        f"rises beyond {limit / highest:.2g} times that of the multisine"
    ]
