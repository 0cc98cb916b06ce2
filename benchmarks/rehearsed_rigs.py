"""Is what a rehearsal foresees what happens? Random rigs by kind: tune, trial, rehearsal, three runs with other noise.

- ``python -m benchmarks.rehearsed_rigs run FOLDER --seed 1 --each 8`` draws rigs (`benchmarks.random_rigs`) from a seed until
  there are so many of each kind, with stops, with joints and smooth ones (cubic springs, magnets), and tries those that have no
  result yet,
- ``python -m benchmarks.rehearsed_rigs table FOLDER ...`` shows reliability and Brier score by kind, what was foreseen and what
  happened, and the largest phase error in ramps, as tuned and without feed-forward and longer ramps.

- ``python -m benchmarks.rehearsed_rigs figure BENCH PLAN ramps.png`` draws level, frequency and phase error over one run,
  as tuned, and without feed-forward and longer ramps.

Several folders count as one batch.
"""

import json
import math
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import typer

import rig
from benchmarks.random_rigs import compared, drawn, true_curve
from rig.arming.run_options import RunOptions
from rig.bench import load_bench
from rig.campaigns.backbone.ramps import ramps_in
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.plans import load_plan
from rig.errors import RigError
from rig.recording.reader import Recording
from rig.rehearsal.knowledge import collect_knowledge
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.rehearsal.verdict import verdict_of
from rig.tuning import try_plan, tune

KINDS = {"clearance": "stops", "jenkins": "joints", "iwan": "joints"}
DRAWS, RUNS = 60, 3
LIKELY = 0.9
"""Probability from which a plan counts as one that was said to succeed."""


def kind_of(bench: dict[str, Any]) -> str:
    """Kind of a drawn rig; one with a stop and a joint is one with a stop."""
    options = bench["driver"]["options"]
    kinds = {KINDS.get(part["kind"], "smooth") for key in ("elements", "friction") for part in options[key]}
    return next(kind for kind in ("stops", "joints", "smooth") if kind in kinds)


def tried(path: Path) -> dict[str, Any]:
    """Tune a bench, try the plan, rehearse it and run it three times, and once without feed-forward and longer ramps."""
    bench, seed = load_bench(path), int(path.stem.split("-")[-1])
    out: dict[str, Any] = {"rig": path.stem, "words": bench.description.removeprefix("drawn: ")}
    recording, began = path.with_name(f"{path.stem}-tune.h5"), time.perf_counter()
    trial = path.with_name(f"{path.stem}-trial.h5")
    try:
        planned = tune(bench, recording, options=RunOptions(seed=seed, overwrite=True))
        tuned = try_plan(planned, trial, RunOptions(seed=2 * 10**6 + seed, overwrite=True))
    except RigError as error:
        return out | {"refused": str(error)}
    plan = tuned.plan
    path.with_name(f"{path.stem}-plan.toml").write_text(tuned.plan_toml, encoding="utf-8")
    out |= {
        "tune_s": time.perf_counter() - began,
        "distortion": tuned.test.distortion,
        "tested_v": tuned.test.level_rms_v,
        "notes": list(tuned.notes),
        "planned_m": planned.levels.levels_m,
        "levels_m": tuned.levels.levels_m,
        "trial_missing": tuned.trial.missing if tuned.trial else "",
        "trial_tripped": tuned.trial is not None and tuned.trial.tripped,
        "plan": plan.model_dump(mode="json"),
        **true_curve(bench, tuned.levels.levels_m),
    }
    began = time.perf_counter()
    with Recording(recording) as recorded, Recording(trial) as tried_once:
        known = collect_knowledge(bench, plan, {recording.name: recorded, trial.name: tried_once})
    request = RehearsalRequest(plan=plan, bench=bench, knowledge=known, draws=DRAWS, seed=seed, balanced=False)
    rehearsal = rehearse(request, until_certain=True, jobs=1)
    verdict = verdict_of(rehearsal)
    out |= {
        "foreseen": verdict.ends_well.value,
        "foreseen_trip": verdict.trips.value,
        "draws": [
            {"unknowns": dict(draw.unknowns), "end": draw.trial.end, "completed": draw.trial.completed}
            | {"reasons": [f"{point.number} {point.quality}" for point in draw.trial.points if not point.accepted]}
            for draw in rehearsal.draws
        ],
        "rehearsal_s": time.perf_counter() - began,
    }
    by_phase = plan.law.model_copy(update={"frequency_feed_forward": False})
    plain = plan.model_copy(update={"controller": by_phase, "ramp_factors": ()})
    out["runs"] = [_run(bench, plan, path, 10**6 + seed + number) for number in range(RUNS)]
    out["without"] = _run(bench, plain, path, 10**6 + seed)
    return out


def _run(bench: Any, plan: Any, path: Path, seed: int) -> dict[str, Any]:
    output, began = path.with_name(f"{path.stem}-run.h5"), time.perf_counter()
    try:
        run = rig.run(plan, bench=bench, output=output, seed=seed, overwrite=True)
    except RigError as error:
        return {"not_run": str(error), "well": False, "tripped": False}
    with run:
        part = run.recording.parts[-1]
        points = [compared(bench, point) for point in points_of(run.recording)]
        end = part.end or {"reason": "none", "text": "", "tripped": False}
        found = {
            "end": str(end["reason"]),
            "text": end["text"],
            "tripped": bool(end["tripped"]),
            "well": bool(end["completed"]),
            "ramps_deg": [ramp.error_deg for ramp in ramps_in(part, plan, bench.sample_rate_hz)],
            "points": points,
            "run_s": time.perf_counter() - began,
        }
    output.unlink()
    return found


app = typer.Typer(help=__doc__)
ONE = """
import json, sys
from pathlib import Path
from benchmarks.rehearsed_rigs import tried
path = Path(sys.argv[1])
path.with_suffix(".json").write_text(json.dumps(tried(path), default=float), encoding="utf-8")
"""


@app.command()
def run(folder: Path, seed: int = 1, each: int = 8, timeout_s: float = 1200.0) -> None:
    """Try rigs of each kind, one after the other, each in a process of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    for path, kind in _drawn(folder, seed, each):
        result = path.with_suffix(".json")
        if result.exists():
            continue
        try:
            done = subprocess.run(
                [sys.executable, "-c", ONE, str(path)], timeout=timeout_s, capture_output=True, text=True, check=False
            )
            failed = done.stderr.strip().splitlines()[-1] if done.returncode else ""
        except subprocess.TimeoutExpired:
            failed = f"not ended within {timeout_s:g} s"
        found = {"rig": path.stem, "failed": failed} if failed else json.loads(result.read_text(encoding="utf-8"))
        result.write_text(json.dumps(found | {"kind": kind}), encoding="utf-8")
        print(_line(found | {"kind": kind}), flush=True)


def _drawn(folder: Path, seed: int, each: int) -> Iterator[tuple[Path, str]]:
    """Yield bench files and kinds, the kinds in turn as they are drawn."""
    wanted = Counter(dict.fromkeys(("stops", "joints", "smooth"), each))
    while any(wanted.values()):
        bench = drawn(seed)
        kind = kind_of(bench)
        if wanted[kind]:
            wanted[kind] -= 1
            path = folder / f"rig-{seed}.toml"
            path.write_text(tomli_w.dumps(bench), encoding="utf-8")
            yield path, kind
        seed += 1


def _line(one: dict[str, Any]) -> str:
    head = f"{one['rig']} {one['kind']:7}"
    for key in ("failed", "refused"):
        if key in one:
            return f"{head} {key}: {one[key][:300]}"
    well = [run["well"] for run in one["runs"]]
    happened = "; ".join(sorted({_reason(run) for run in one["runs"]}))
    return f"{head} foreseen {one['foreseen']:.2f} of {len(one['draws'])}, well {sum(well)} of {len(well)}: {happened[:200]}"


def _reason(run: dict[str, Any]) -> str:
    """Why a run did not end well, in a word or two."""
    if run["well"]:
        return "well"
    if "not_run" in run:
        return f"refused: {run['not_run'][:80]}"
    if run["tripped"] or run["end"] != "completed":
        return f"{run['end']}: {run['text'][:100]}"
    first = next((point for point in run["points"] if "amplitude_m" not in point), None)
    return "none" if first is None else f"{first['number'] + 1} {first['quality']}: {first['reason'][:100]}"


@app.command()
def figure(bench: Path, plan: Path, output: Path, seed: int = 1) -> None:
    """Draw level, frequency and phase error over a run of a tuned plan, as tuned, and without feed-forward and longer ramps."""
    from matplotlib.figure import Figure

    rig_bench, tuned = load_bench(bench), load_plan(plan)
    page = Figure(figsize=(11.0, 7.0), layout="constrained")
    panels = page.subplots(3, 1, sharex=True)
    for follows, color in ((False, "C1"), (True, "C0")):
        controller = tuned.law.model_copy(update={"frequency_feed_forward": follows})
        recording = output.with_suffix(".h5")
        changed = tuned.model_copy(
            update={"controller": controller, "ramp_factors": tuned.ramp_factors if follows else ()}
        )
        with rig.run(changed, bench=rig_bench, output=recording, seed=seed, overwrite=True) as run:
            part = run.recording.parts[-1]
            drive = part.rows("inputs")[:, rig_bench.index_of("drive")]
            theta, hertz = part.rows("theta_rad"), part.rows("frequency_hz")
            starts = np.flatnonzero(np.append(True, np.diff(theta) < -math.pi))
            length = np.diff(np.append(starts, theta.size))

            def mean(values: Any, starts: Any = starts, length: Any = length) -> Any:
                return np.add.reduceat(np.nan_to_num(values), starts) / length

            level = np.sqrt(2.0 * mean(drive**2)) / (2.0 * math.pi * mean(hertz)) ** 2
            time_s = starts / rig_bench.sample_rate_hz
            error = np.degrees(mean(part.rows("phase_error_rad")))
        label = "as tuned" if follows else "without feed-forward, ramps of one length"
        for axes, values in zip(panels, (1e3 * level, mean(hertz), error), strict=True):
            axes.plot(time_s, values, color=color, lw=0.9, label=label)
        recording.unlink()
    for axes, text in zip(panels, ("drive point, mm", "frequency, Hz", "phase error, deg"), strict=True):
        axes.set_ylabel(text)
    panels[2].set_ylim(-60.0, 60.0)
    panels[2].set_xlabel("time, s")
    panels[0].legend()
    page.savefig(output)


@app.command()
def table(folders: list[Path]) -> None:
    """Show what was foreseen and what happened, by kind."""
    paths = sorted(path for folder in folders for path in folder.glob("rig-*.json"))
    found = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    for one in found:
        print(_line(one))
    print("kind | rigs | tuned | said >= 90 % | of those went well | all well | of those said | Brier, of the mean")
    for kind in ("stops", "joints", "smooth", "all"):
        print(" | ".join(_row(kind, [one for one in found if kind in (one["kind"], "all")])))
    tuned = [one for one in found if "runs" in one]
    print("trips:", sum(run["tripped"] for one in tuned for run in one["runs"]))
    print(
        "foreseen, not well:",
        Counter(_foreseen(draw) for one in tuned for draw in one["draws"] if not draw["completed"]),
    )
    print("runs, not well:", Counter(_short(run) for one in tuned for run in one["runs"] if not run["well"]))
    points = [p for one in tuned for run in one["runs"] for p in run.get("points", []) if "frequency_error" in p]
    for name in ("frequency_error", "damping_error_true_shape"):
        sizes = np.abs([point[name] for point in points])
        if sizes.size:
            print(
                f"{name}: median {np.median(sizes):.4%}, 99 % {np.quantile(sizes, 0.99):.3%}, largest {sizes.max():.3%}"
            )
    worst = np.array(
        [
            [max(run["ramps_deg"], default=math.nan) for run in (one["without"], one["runs"][0])]
            for one in tuned
            if one["runs"][0]["well"] and one["without"]["well"]
        ]
    )
    if worst.size:
        print(
            "ramps, deg (median, 90 %, largest; without, with):",
            np.nanquantile(worst, [0.5, 0.9, 1.0], axis=0).round(1).tolist(),
        )


def _row(kind: str, found: list[dict[str, Any]]) -> list[str]:
    tuned = [one for one in found if "runs" in one]
    p = np.array([one["foreseen"] for one in tuned for _ in one["runs"]])
    y = np.array([float(run["well"]) for one in tuned for run in one["runs"]])
    likely = p >= LIKELY
    every = [one for one in tuned if all(run["well"] for run in one["runs"])]
    said = sum(one["foreseen"] >= LIKELY for one in every)
    if not p.size:
        return [kind, str(len(found)), "0"]
    return [
        *(kind, str(len(found)), str(len(tuned)), str(sum(one["foreseen"] >= LIKELY for one in tuned))),
        *(f"{int(y[likely].sum())} of {int(likely.sum())} runs", str(len(every)), str(said)),
        f"{np.mean((p - y) ** 2):.3f}, {y.mean() * (1.0 - y.mean()):.3f}",
    ]


def _foreseen(draw: dict[str, Any]) -> str:
    if draw["end"] not in ("COMPLETED", "STOPPED"):
        return str(draw["end"]).lower()
    return str(draw["reasons"][0].split(" ", 1)[1]) if draw["reasons"] else "none"


def _short(run: dict[str, Any]) -> str:
    if "not_run" in run:
        return "refused"
    if run["tripped"] or run["end"] != "completed":
        return str(run["end"])
    return next((str(point["quality"]) for point in run["points"] if "amplitude_m" not in point), "none")


if __name__ == "__main__":
    app()
