"""Do stated 95 % intervals hold the truth? Backbones of virtual rigs, seed after seed, and what their intervals cover.

    python -m benchmarks.coverage [PLAN ...] [--seeds 18] [--noise 1 --noise 10] [--levels] [--output FILE]

Every recording is replayed: the recorded output, through the same rig without sensors and with finer steps, gives the true
force and the true motion of the drive point during every point. The truth of force and amplitude are the
fundamentals of these. The truth of modal frequency and damping is the harmonic balance of the coupled rig at phase resonance
and at this amplitude; with ``--at force`` at the measured force instead, and of intervals that hold its error as well.

The random part of an interval is compared with the scatter of the errors about their mean over the seeds: it shall cover 95 %.
The whole interval shall cover the truth. ``--noise 10`` is ten times the noise of all sensors and ten times the steps of
their converter. ``own`` is the rig of docs/tutorials/a-rig-of-your-own.md.
"""

import json
import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from scipy.stats import binomtest

import rig
from benchmarks.frame import show
from identification import Channel, nonlinear_mode, periodic_vibration
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.evaluation.vibrations import within_periods
from rig.campaigns.plans import bench_of, load_plan
from rig.drivers import make_daq
from rig.recording.reader import Recording
from simulators import Simulation, VirtualRig
from simulators.analysis import phase_resonance_backbone

PLANS = ("magnet-beam/backbone", "magnet-beam-symmetric/backbone", "friction-beam/backbone")
MODAL = ("modal_frequency_hz", "damping_ratio")
QUANTITIES = (*MODAL, "force_n", "amplitude_m")
WANTED = 0.93
"""Coverage that the test of significance asks for, of 95 % stated; chosen."""
HARMONICS, SAMPLES = 15, 1024
"""Of the harmonic balance."""
FINER = 8
"""Least number of steps of a replay in a sample."""
PIECE = 20000
"""Samples that a replay takes at once between points."""
TRUE_CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m"))
TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorials" / "a-rig-of-your-own.md"


@dataclass(frozen=True)
class Measured:
    """One point of one run: estimate, ends of the interval, standard error of the random part, and the truth, by quantity."""

    level: int
    estimate: dict[str, float]
    ends: dict[str, tuple[float, float]]
    random: dict[str, float]
    truth: dict[str, float]


def own_rig(folder: Path) -> Path:
    """Write bench and plan of the tutorial into a folder, and return the path of the plan."""
    blocks = re.findall(r"```toml\n# file: (\S+)\n(.*?)```", TUTORIAL.read_text(encoding="utf-8"), flags=re.DOTALL)
    for name, text in blocks:
        (folder / name).write_text(text, encoding="utf-8")
    return folder / next(name for name, _ in blocks if name.endswith("-plan.toml"))


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
    exact: VirtualRig, recording: Recording, points: Sequence[Point[object]], plan: BackbonePlan, seed: int
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


def run_once(plan: BackbonePlan, bench: Bench, exact: VirtualRig, seed: int, at: str) -> list[Measured]:
    """Run a backbone, identify it, and return every accepted point with the true force and amplitude.

    ``at``: amplitude, or force for intervals of modal frequency and damping at the measured force.
    """
    with rig.run(plan, bench=bench, seed=seed) as done:
        points = [point for point in points_of(done.recording) if point.accepted]
        mode = nonlinear_mode(done.backbone())
        truths = true_vibrations(exact, done.recording, points, plan, seed)
    intervals = {
        name: mode.interval_at("force_n", name) if at == "force" and name in MODAL else mode.interval(name)
        for name in QUANTITIES
    }
    return [
        Measured(
            level=point.number,
            estimate={name: float(getattr(mode, name)[number]) for name in QUANTITIES},
            ends={name: (float(intervals[name][number, 0]), float(intervals[name][number, 1])) for name in QUANTITIES},
            random={name: float(mode.random(name)[number]) for name in QUANTITIES},
            truth=dict(zip(("force_n", "amplitude_m"), truth, strict=True)),
        )
        for number, (point, truth) in enumerate(zip(points, truths, strict=True))
    ]


def add_modal_truth(exact: VirtualRig, points: Sequence[Measured], at: str) -> None:
    """Add modal frequency and damping by harmonic balance, at the true amplitude or at the measured force of each point."""
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
            for name in MODAL:
                one.truth[name] = float(np.interp(np.log(value), grid, getattr(found, name)))


def summary(points: Sequence[Measured], name: str) -> dict[str, Any]:
    """Return coverage, half-width and bias of a quantity over the points of all seeds, and the same level by level."""
    rows: dict[str, dict[str, float]] = {}
    within, covered, widths = [], [], []
    for level in sorted({point.level for point in points}):
        some = [point for point in points if point.level == level]
        truth = np.array([point.truth[name] for point in some])
        error = np.array([point.estimate[name] for point in some]) / truth - 1.0
        ends = np.array([point.ends[name] for point in some])
        random = np.array([point.random[name] for point in some]) / truth
        inside = (ends[:, 0] <= truth) & (truth <= ends[:, 1])
        free = np.sqrt(1.0 - 1.0 / len(some))
        near = np.abs(error - error.mean()) <= 1.96 * random * free
        half = 0.5 * (ends[:, 1] - ends[:, 0]) / truth
        within += inside.tolist()
        covered += near.tolist() if len(some) > 1 else []
        widths += half.tolist()
        rows[f"point {level + 1}"] = {
            "covered": float(inside.mean()),
            "random_covered": float(near.mean()),
            "bias": float(error.mean()),
            "scatter": float(error.std(ddof=1)) if len(some) > 1 else float("nan"),
            "half_width": float(np.median(half)),
            "random_half_width": float(1.96 * np.median(random)),
        }
    test = binomtest(int(np.sum(within)), len(within), WANTED, alternative="less")
    return {
        "outcomes": len(within),
        "covered": float(np.mean(within)),
        "p_of_93": float(test.pvalue),
        "random_covered": float(np.mean(covered)) if covered else float("nan"),
        "half_width": float(np.median(widths)),
        "largest_bias_over_half_width": float(max(abs(row["bias"]) / row["half_width"] for row in rows.values())),
        "levels": rows,
    }


def study(name: str, seeds: Sequence[int], factor: float, at: str = "amplitude") -> dict[str, Any]:
    """Run a plan with every seed and return the summary of every quantity."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(own_rig(Path(folder))) if name == "own" else name
        plan = load_plan(path)
        if not isinstance(plan, BackbonePlan):
            raise ValueError(f"{name}: is a {plan.kind}, allowed is a backbone")
        bench = noisier(bench_of(plan, path), factor)
        exact = make_daq(bench).rig
        points = [point for seed in seeds for point in run_once(plan, bench, exact, seed, at)]
    add_modal_truth(exact, points, at)
    planned = len(plan.targets()) * len(seeds)
    return {"planned": planned, **{quantity: summary(points, quantity) for quantity in QUANTITIES}}


def main(
    plans: Annotated[list[str] | None, typer.Argument()] = None,
    seeds: int = 18,
    first_seed: int = 0,
    noise: list[float] | None = None,
    at: Literal["amplitude", "force"] = "amplitude",
    levels: bool = False,
    output: Path | None = None,
) -> None:
    """Run plans: those above, files or ``own``. Print what they come to, with ``levels`` of every point; write all numbers."""
    everything: dict[str, Any] = {}
    for name in plans or PLANS:
        for factor in noise or (1.0, 10.0):
            found = study(name, range(first_seed, first_seed + seeds), factor, at)
            everything[f"{name}, noise {factor:g}"] = found
            left_out = () if levels else ("levels",)
            shown = {
                quantity: {key: value for key, value in found[quantity].items() if key not in left_out}
                for quantity in QUANTITIES
            }
            show({f"{name}, noise {factor:g}": shown})
            if output is not None:
                output.write_text(json.dumps(everything, indent=1), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
