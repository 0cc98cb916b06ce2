"""From nothing but a bench to gains, margins, levels, and a plan."""

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from controller.tuning import PlantModel
from rig.arming.arming import Arm
from rig.arming.run_facts import About
from rig.bench import Bench, load_bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.plans import plan_from
from rig.campaigns.running.execution import Progress
from rig.errors import ConfigurationError
from rig.tuning.design import Chosen, LawName, choose
from rig.tuning.levels import PART, LevelChoice, choose_levels, lowest_force_n, reach_m
from rig.tuning.linear_test import LinearTest, measure
from rig.tuning.noise import low_pass
from rig.tuning.plan import plan_text
from rig.tuning.plant import compared_with_bench, measured_ratios, plant_of

__all__ = ["Tuning", "tune"]


NONLINEAR = 0.005  # distortion beside the linear response of the force


@dataclass(frozen=True, eq=False)
class Tuning:
    """What a tuning has found."""

    bench: Bench
    """The bench."""
    test: LinearTest
    """The linear test."""
    recording: Path
    """Its recording."""
    plant: PlantModel
    """The plant near the mode."""
    response_ratios: dict[str, float]
    """How far each response channel moves for one metre at the drive point at resonance, as measured, by name."""
    chosen: Chosen
    """The gains."""
    levels: LevelChoice
    """The levels."""
    notes: tuple[str, ...]
    """What a user should know, one line each."""
    plan_toml: str
    """The plan."""

    @property
    def plan(self) -> BackbonePlan:
        """The plan, as read from `plan_toml`."""
        import tomllib

        read = plan_from(tomllib.loads(self.plan_toml), "tuned plan")
        if not isinstance(read, BackbonePlan):
            raise TypeError("tuned plan: allowed is a backbone")
        return read


def tune(
    bench: Bench | str | Path,
    recording: str | Path,
    *,
    level_rms_v: float | None = None,
    law: LawName | str = "frequency-error",
    from_m: float | None = None,
    to_m: float | None = None,
    points: int = 8,
    named: str | None = None,
    seed: int = 0,
    realtime: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    arm: Arm = None,
    about: About | None = None,
) -> Tuning:
    """Measure the plant with a low-level multisine, recorded in ``recording``, and design a backbone test for it.

    ``level_rms_v`` spares the search for a level; ``law`` is ``frequency-error`` (with complex response control, levels in
    metres) or ``phase`` (levels in volts); ``from_m``, ``to_m`` and ``points`` set the levels; ``named`` is what the plan calls
    the bench. ``arm`` and ``about`` as for `rig.campaigns.running.runner.carry_out`.

    Raises `rig.tuning.errors.TuningError` where the rig is unsuited, with the numbers,
    `rig.errors.ConfigurationError` for what the bench does not allow, `rig.errors.RecordingError` for a recording that
    cannot be written.
    """
    name = str(bench.name if isinstance(bench, Bench) else bench)
    bench = bench if isinstance(bench, Bench) else load_bench(bench)
    _check_request(bench, law, level_rms_v, from_m, to_m, points)
    test = measure(
        bench,
        name,
        Path(recording),
        level_rms_v=level_rms_v,
        seed=seed,
        realtime=realtime,
        overwrite=overwrite,
        progress=progress,
        arm=arm,
        about=about,
        damping_of=lambda responses, lead: plant_of(bench, responses, lead).damping_ratio,
    )
    plant = plant_of(bench, test.responses, test.lead_samples)
    notes = compared_with_bench(bench, plant)
    measured = measured_ratios(test.responses, plant)
    ratios = bench.response_ratios | measured
    lowest_n = lowest_force_n(bench, plant, PART * reach_m(bench, plant, ratios)[0] if to_m is None else to_m)
    densities = (test.force_density, test.acceleration_density)
    largest, lowest_n, noise = low_pass(plant, densities, lowest_n)
    chosen = choose(plant, test.responses, law, largest, noise)
    levels = choose_levels(bench, plant, ratios, lowest_n=lowest_n, from_m=from_m, to_m=to_m, points=points)
    notes += _cautions(bench, test, levels)
    return Tuning(
        bench=bench,
        test=test,
        recording=Path(recording),
        plant=plant,
        response_ratios=measured,
        chosen=chosen,
        levels=levels,
        notes=notes,
        plan_toml=plan_text(named or name, bench, plant, measured, chosen, levels, Path(recording)),
    )


def _cautions(bench: Bench, test: LinearTest, levels: LevelChoice) -> tuple[str, ...]:
    """What may go otherwise than the linear plant has it."""
    out = []
    if test.distortion > NONLINEAR:
        out.append(
            f"the multisine at {test.level_rms_v:.3g} V RMS shows {100.0 * test.distortion:.2g} % of nonlinear distortion: "
            "frequency and damping are those of that level (--level sets a lower one)"
        )
    limit, highest = bench.limits.voltage_v, levels.needed_v[-1]
    if highest > PART * limit * 1.001:
        out.append(
            f"the highest level needs {highest:.3g} of {limit:g} V on the linear plant: it is out of reach where the damping "
            f"rises beyond {limit / highest:.2g} times that of the multisine"
        )
    return tuple(out)


def _check_request(
    bench: Bench, law: str, level_rms_v: float | None, from_m: float | None, to_m: float | None, points: int
) -> None:
    """Refuse, before anything moves, what no measurement could make possible."""
    if law not in get_args(LawName):
        raise ConfigurationError(f"--law = {law!r}: allowed is {', '.join(get_args(LawName))}")
    if level_rms_v is not None and not level_rms_v > 0.0:
        raise ConfigurationError(f"--level = {level_rms_v:g} V RMS: allowed is above 0")
    if points < 1:
        raise ConfigurationError(f"--points = {points}: allowed is 1 or more")
    farthest = max(bench.response_ratios.values())
    allowed_m = bench.limits.displacement_m / farthest
    why = f": a channel's mode_shape moves {farthest:.3g} times as far" if farthest > 1.0 else ""
    for name, level in (("--from-m", from_m), ("--to-m", to_m)):
        if level is not None and not 0.0 < level <= allowed_m:
            raise ConfigurationError(
                f"{name} = {level:g} m: the bench {bench.name} allows above 0 and up to {allowed_m:.3g} m{why}"
            )
    if from_m is not None and to_m is not None and from_m >= to_m:
        raise ConfigurationError(f"--from-m = {from_m:g} m: allowed is below --to-m = {to_m:g} m")
