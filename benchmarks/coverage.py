"""Do stated 95 % intervals hold the truth? Backbones of virtual rigs, seed after seed, and what their intervals cover.

    python -m benchmarks.coverage [PLAN ...] [--seeds 18] [--noise 1 --noise 10] [--spread 0] [--levels] [--output FILE]

Every recording is replayed: the recorded output, through the same rig without sensors and with finer steps, gives the true
force and the true motion of the drive point during every point. The truth of force and amplitude are the
fundamentals of these. The truth of modal frequency and damping is the harmonic balance of the coupled rig at phase resonance
and at this amplitude; with ``--at force`` at the measured force instead, and of intervals that hold its error as well.

The random part of an interval is compared with the scatter of the errors about their mean over the seeds: it shall cover 95 %.
The whole interval shall cover the truth. ``--noise 10`` is ten times the noise of all sensors and ten times the steps of
their converter. ``own`` is the rig of docs/tutorials/a-rig-of-your-own.md; further plans on it and on a drawn one are those of
`benchmarks.coverage_rigs`.

Steps of the converters are the same in every run with the same levels, so that all runs together are one draw of them.
``--spread 0.05`` gives each run levels of its own, within 5 % of those of the plan.

Held displacements are judged by their points at phase resonance. Points that are not settled (short ones, those of a continuous
backbone) have no force and amplitude of their own: truth is that of phase resonance at the amplitude that they are given.
"""

import json
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from scipy.interpolate import CubicSpline
from scipy.stats import binomtest

import rig
from benchmarks.coverage_rigs import plan_of
from benchmarks.frame import show
from identification import Channel, NonlinearMode, nonlinear_mode, periodic_vibration
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.evaluation.vibrations import within_periods
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import bench_of, load_plan
from rig.campaigns.response_controlled.points import RESONANCE_DEG
from rig.drivers import make_daq
from rig.measurements import backbone, continuous_backbones
from rig.recording.reader import Recording
from simulators import Simulation, VirtualRig
from simulators.analysis import phase_resonance_backbone
from vibrolock.arrays import Float

PLANS = ("magnet-beam/backbone", "magnet-beam-symmetric/backbone", "friction-beam/backbone")
MODAL = ("modal_frequency_hz", "damping_ratio")
QUANTITIES = (*MODAL, "force_n", "amplitude_m")
UNSETTLED = (*MODAL, "force_n")
"""Quantities of a point that is not settled: their truth is that of phase resonance at its amplitude."""
KINDS = ("backbone", "continuous-backbone", "response-controlled")
WANTED = 0.93
"""Coverage that the test of significance asks for, of 95 % stated; chosen."""
HARMONICS, SAMPLES = 15, 1024
"""Of the harmonic balance."""
FINER = 8
"""Least number of steps of a replay in a sample."""
PIECE = 20000
"""Samples that a replay takes at once between points."""
TRUE_CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m"))


@dataclass(frozen=True)
class Measured:
    """One point of one run: estimate, ends of the interval, standard error of the random part, and the truth, by quantity."""

    level: int
    estimate: dict[str, float]
    ends: dict[str, tuple[float, float]]
    random: dict[str, float]
    truth: dict[str, float]


def noisier(bench: Bench, factor: float) -> Bench:
    """Return a virtual bench with ``factor`` times the noise of all sensors and the steps of the inputs' converter."""
    if factor == 1.0:
        return bench
    table = bench.model_dump(mode="json")
    options = table["driver"]["options"]
    converter = make_daq(bench).rig.converter
    options["noise_scale"] = factor * options.get("noise_scale", 1.0)
    options["converter"] = {**options.get("converter", {}), "adc_range_v": factor * converter.adc_range_v}
    for channel in table["channels"]:
        channel["resolution_v"] *= factor
        channel["noise_rms"] *= factor
    return validated(Bench, table, "bench")


def continuous(exact: VirtualRig) -> tuple[VirtualRig, int]:
    """Return the rig with a rate so high that images of the held output do not alias, and that rate over the rig's own.

    Sampled at the rig's own rate, the true force would hold these images: 0.3 % of the force at resonance on the friction beam.
    """
    converter = exact.converter
    if converter.reconstruction_hz:
        raise ValueError(
            f"reconstruction_hz = {converter.reconstruction_hz:g}: allowed is 0, a replay holds the output"
        )
    finer = exact.substeps * -(-FINER // exact.substeps)
    changes = {
        "sample_rate_hz": finer * converter.sample_rate_hz,
        "substeps": 1,
        "oversampling": 1,
        "anti_alias_hz": 0.0,
    }
    table = {name: getattr(exact, name) for name in VirtualRig.model_fields}
    table |= {"converter": converter.model_copy(update=changes), "noise_scale": 0.0}
    return VirtualRig.model_validate(table), finer


def true_vibrations(
    exact: VirtualRig, recording: Recording, points: Sequence[Point[object]], plan: Any, seed: int
) -> list[tuple[float, float]]:
    """Return the fundamentals (peak) of the true force (N) and the true motion (m) of the drive point, point by point."""
    (part,) = recording.parts
    rows = part.read(0, part.n_rows)
    voltage = np.append(rows["output_v"][1:], 0.0).astype(float)  # a row has what is on the converter as it is read
    finer_rig, finer = continuous(exact)
    run = Simulation(finer_rig, seed=seed)
    at, out = 0, []
    for point in points:
        assert point.rows is not None
        first, end = point.rows.first_sample, point.rows.end_sample
        for start in range(at, first, PIECE):
            run.run(np.repeat(voltage[start : min(start + PIECE, first)], finer))
        within = run.run(np.repeat(voltage[first:end], finer))
        at, inside = end, rows[first:end]
        theta = np.unwrap(inside["theta_rad"].astype(float))[: inside[within_periods(inside, plan.record_periods)].size]
        between = np.interp(np.arange((theta.size - 1) * finer) / finer, np.arange(theta.size), theta)
        motion = within.displacement_m[exact.stinger.at]
        found = periodic_vibration(
            between,
            np.array([within.force_n, motion])[:, : between.size],
            TRUE_CHANNELS,
            sample_rate_hz=finer_rig.converter.sample_rate_hz,
            harmonics=plan.harmonics,
        )
        out.append((found.force_n, found.amplitude_m))
    return out


def run_once(plan: Any, bench: Bench, exact: VirtualRig, seed: int, at: str) -> list[Measured]:
    """Run a plan, identify it, and return every accepted point with the truth of force and amplitude, where there is one.

    ``at``: amplitude, or force for intervals of modal frequency and damping at the measured force.
    """
    with rig.run(plan, bench=bench, seed=seed) as done:
        points = resonances(done.recording)
        if not points:
            return []
        numbers = [point.number for point in points]
        if settled(plan):
            mode = nonlinear_mode(backbone(done.recording))
            truths = true_vibrations(exact, done.recording, points, plan, seed)
        else:
            mode = unsettled_mode(done.recording)
            truths = [(math.nan, float(amplitude)) for amplitude in mode.amplitude_m]
    intervals = {
        name: mode.interval_at("force_n", name) if at == "force" and name in MODAL else told(mode, name)
        for name in QUANTITIES
    }
    return [
        Measured(
            level=level,
            estimate={name: float(getattr(mode, name)[row]) for name in QUANTITIES},
            ends={name: (float(intervals[name][row, 0]), float(intervals[name][row, 1])) for name in QUANTITIES},
            random={name: float(mode.random(name)[row]) for name in QUANTITIES},
            truth=dict(zip(("force_n", "amplitude_m"), truth, strict=True)),
        )
        for row, (level, truth) in enumerate(zip(numbers, truths, strict=True))
    ]


def settled(plan: Plan) -> bool:
    """Whether a plan's points are settled, so that force and amplitude of each have a truth of their own."""
    return plan.kind == "response-controlled" or (isinstance(plan, BackbonePlan) and plan.evaluation != "slow-flow")


def resonances(recording: Recording) -> list[Point[object]]:
    """Return the accepted points at phase resonance, in the order of the plan."""
    points = [point for point in points_of(recording) if point.accepted]
    return [point for point in points if point.asked_phase_lag_deg in (None, RESONANCE_DEG)]


def unsettled_mode(recording: Recording) -> NonlinearMode:
    """Return the mode of short points or of a continuous backbone."""
    if recording.kind == "continuous-backbone":
        (ways,) = continuous_backbones(recording)
        return ways.nonlinear_mode()
    return nonlinear_mode(backbone(recording))


def told(mode: NonlinearMode, name: str) -> Float:
    """float[n, 2]: the interval, or what is printed as +- where there is none; NaN if nothing is."""
    ends, middle = mode.interval(name), np.asarray(getattr(mode, name))
    bound = mode.bound_95(name)
    return np.where(np.isfinite(ends), ends, np.column_stack([middle - bound, middle + bound]))


def add_modal_truth(exact: VirtualRig, points: Sequence[Measured], at: str) -> None:
    """Add modal frequency and damping by harmonic balance, at the true amplitude or at the measured force of each point.

    Between nine amplitudes of a level by a cubic spline: straight lines were off by 2e-6 of the magnet beam's frequency.
    A point that has no true force of its own gets that of phase resonance.
    """
    near_hz = float(np.median([point.estimate["modal_frequency_hz"] for point in points]))
    for level in sorted({point.level for point in points}):
        some = [point for point in points if point.level == level]
        where = [one.truth["amplitude_m"] if at == "amplitude" else one.estimate["force_n"] for one in some]
        low, high = np.log(min(where)), np.log(max(where))
        reach = max(0.55 * (high - low), 5e-5)
        grid = 0.5 * (low + high) + np.linspace(-reach, reach, 9)
        key = "amplitudes_m" if at == "amplitude" else "forces_n"
        found = phase_resonance_backbone(
            exact, **{key: np.exp(grid)}, near_hz=near_hz, harmonics=HARMONICS, samples=SAMPLES
        )
        for one, value in zip(some, where, strict=True):
            for name in (*MODAL, *(() if np.isfinite(one.truth["force_n"]) else ("force_n",))):
                one.truth[name] = float(CubicSpline(grid, getattr(found, name))(np.log(value)))


def summary(points: Sequence[Measured], name: str) -> dict[str, Any]:
    """Return coverage, half-width and bias of a quantity over the points of all seeds, and the same level by level."""
    rows: dict[str, dict[str, float]] = {}
    within, covered, widths, sizes = [], [], [], []
    for level in sorted({point.level for point in points}):
        some = [point for point in points if point.level == level]
        truth = np.array([point.truth[name] for point in some])
        error = np.array([point.estimate[name] for point in some]) / truth - 1.0
        ends = np.array([point.ends[name] for point in some])
        random = np.array([point.random[name] for point in some]) / truth
        known = np.isfinite(ends).all(axis=1)
        inside = ((ends[:, 0] <= truth) & (truth <= ends[:, 1]))[known]
        free = np.sqrt(1.0 - 1.0 / len(some))
        near = np.abs(error - error.mean()) <= 1.96 * random * free
        half = 0.5 * (ends[:, 1] - ends[:, 0]) / truth
        within += inside.tolist()
        covered += near.tolist() if len(some) > 1 else []
        widths += half.tolist()
        sizes += np.abs(error).tolist()
        rows[f"point {level + 1}"] = {
            "covered": float(inside.mean()) if inside.size else math.nan,
            "random_covered": float(near.mean()),
            "bias": float(error.mean()),
            "scatter": float(error.std(ddof=1)) if len(some) > 1 else math.nan,
            "half_width": float(np.median(half)),
            "random_half_width": float(1.96 * np.median(random)),
        }
    told_of = np.isfinite(widths)
    test = binomtest(int(np.sum(within)), len(within), WANTED, alternative="less") if within else None
    half_width, size = float(np.nanmedian(widths)) if told_of.any() else math.nan, float(np.median(sizes))
    return {
        "outcomes": len(widths),
        "told": float(told_of.mean()),
        "covered": float(np.mean(within)) if within else math.nan,
        "p_of_93": math.nan if test is None else float(test.pvalue),
        "random_covered": float(np.mean(covered)) if covered else math.nan,
        "half_width": half_width,
        "median_error": size,
        "half_width_over_error": half_width / size,
        "largest_bias_over_half_width": float(
            np.nanmax([abs(row["bias"]) / (row["half_width"] or math.nan) for row in rows.values()])
        ),
        "levels": rows,
    }


def with_own_levels(plan: Plan, seed: int, spread: float) -> Plan:
    """Return a plan with levels that differ from its own by up to ``spread``, relative, as the seed has it."""
    random, table = np.random.default_rng([seed, 7]), plan.model_dump(mode="json")
    for key in ("levels_v", "levels_n", "levels_m"):
        if table.get(key):
            table[key] = [level * (1.0 + spread * random.uniform(-1.0, 1.0)) for level in table[key]]
    return type(plan).model_validate(table)


def study(name: str, seeds: Sequence[int], factor: float, at: str = "amplitude", spread: float = 0.0) -> dict[str, Any]:
    """Run a plan with every seed and return the summary of every quantity."""
    with tempfile.TemporaryDirectory() as folder:
        path = plan_of(name, Path(folder))
        plan = load_plan(path)
        if plan.kind not in KINDS:
            raise ValueError(f"{name}: is a {plan.kind}, allowed is one of {', '.join(KINDS)}")
        bench = noisier(bench_of(plan, path), factor)
        exact = make_daq(bench).rig
        plans = {seed: with_own_levels(plan, seed, spread) if spread else plan for seed in seeds}
        points = [point for seed in seeds for point in run_once(plans[seed], bench, exact, seed, at)]
    add_modal_truth(exact, points, at)
    planned = len(plan.levels if plan.kind == "response-controlled" else plan.targets()) * len(seeds)
    quantities = QUANTITIES if settled(plan) else UNSETTLED
    return {"planned": planned, **{quantity: summary(points, quantity) for quantity in quantities}}


def main(
    plans: Annotated[list[str] | None, typer.Argument()] = None,
    seeds: int = 18,
    first_seed: int = 0,
    noise: list[float] | None = None,
    spread: float = 0.0,
    at: Literal["amplitude", "force"] = "amplitude",
    levels: bool = False,
    output: Path | None = None,
) -> None:
    """Run plans: those above, files or ``own``. Print what they come to, with ``levels`` of every point; write all numbers."""
    everything: dict[str, Any] = {}
    for name in plans or PLANS:
        for factor in noise or (1.0, 10.0):
            found = study(name, range(first_seed, first_seed + seeds), factor, at, spread)
            everything[f"{name}, noise {factor:g}"] = found
            left_out = () if levels else ("levels",)
            shown = {
                quantity: {key: value for key, value in found[quantity].items() if key not in left_out}
                for quantity in QUANTITIES
                if quantity in found
            }
            show({f"{name}, noise {factor:g}": shown})
            if output is not None:
                output.write_text(json.dumps(everything, indent=1), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
