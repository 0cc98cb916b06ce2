"""Are rehearsals calibrated? Pairs of rig and plan, the predicted probabilities against what happened.

Every pair has a true rig, drawn from the stated hypotheses around a shipped bench, and a plan: the one that `rig tune` makes on
that rig, or one that is bad on purpose. The rig is measured by the tune alone. The plan is rehearsed on twins that know that
measurement and the hypotheses, then it is run on the true rig once. Over all pairs, predicted probabilities are compared with
the share that happened (reliability, Brier score against that of the mean), and the run's margins, time and points with the
bands that the rehearsal foresaw.

    python -m benchmarks.rehearsal_calibration --pairs 100 --draws 50 --output calibration.json
"""

import json
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import typer

from benchmarks.frame import show
from rig.arming.run_options import RunOptions
from rig.bench import load_bench
from rig.bench.configuration import merged
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import plan_from
from rig.errors import RigError
from rig.recording.reader import Recording
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.knowledge import Knowledge, collect_knowledge
from rig.rehearsal.rehearsal import RehearsalRequest, rehearse
from rig.rehearsal.trial import run_trial
from rig.rehearsal.twins import draw_twin
from rig.rehearsal.verdict import Quantiles, verdict_of
from rig.tuning import tune

BENCHES = ("magnet-beam", "friction-beam", "magnet-beam-symmetric")
FIRST_TRUE = 5000  # numbers of the true rigs; those of the twins are below
SPOILT = ("as tuned", "as tuned", "gains", "levels", "window", "ramps", "patience", "limit", "limit")


def spoilt(plan: Plan, how: str, generator: np.random.Generator) -> Plan:
    """Return the plan, worse in one way by a random factor; as it is where that is not allowed."""
    table = plan.model_dump(mode="json", exclude_none=True)
    controller, factor = table["controller"], float(2.0 ** generator.uniform(0.5, 2.5))
    key = next(name for name in ("levels_m", "levels_v", "levels_n") if name in table)
    middle = controller["centre_frequency_hz"]
    gains = ("frequency_integral_per_s", "response_integral_per_s", "k1", "k2")
    changes: dict[str, Any] = {
        "as tuned": {},
        "limit": {},
        "gains": {"controller": {name: factor * controller[name] for name in gains if controller.get(name)}},
        "levels": {key: [min(factor, 2.9) * level for level in table[key]]},
        "window": {"controller": {"frequency_window_hz": [middle * (1 - 0.06 / factor), middle * (1 + 0.06 / factor)]}},
        "ramps": {"ramp_periods": max(1.0, table["ramp_periods"] / factor**2)},
        "patience": {"settle": {"longest_periods": 400.0 / factor**2}},
    }[how]
    try:
        return plan_from(merged(table, changes), how)
    except RigError:
        return plan


def limited(bench: Any, plan: Plan, how: str, generator: np.random.Generator) -> Any:
    """Return the bench, for ``limit`` with a force limit of 1 to 4 times the linear force (N) at the highest level."""
    if how != "limit" or not isinstance(plan, BackbonePlan) or plan.plant is None or plan.levels_key != "levels_m":
        return bench
    plant = plan.plant
    force_n = 2.0 * plant.damping_ratio * plant.frequency_rad_s**2 * max(plan.levels) / plant.drive_shape**2
    limits = bench.limits.model_copy(update={"force_n": float(force_n * 4.0 ** generator.uniform(0.0, 1.0))})
    return bench.model_copy(update={"limits": limits})


def drawn_pairs(count: int, seed: int, folder: Path) -> Iterator[tuple[str, Any, Plan, Knowledge]]:
    """Yield name, true bench, plan and what the tune of the true bench tells."""
    known: dict[str, tuple[Any, Plan, Knowledge]] = {}
    made = number = 0
    while made < count:
        generator = np.random.default_rng([seed, number])
        name = BENCHES[number % len(BENCHES)]
        if name not in known:
            known[name] = _measured(load_bench(name), folder / f"{name}.h5")
        bench, plan, knowledge = known[name]
        number += 1
        try:
            true = draw_twin(bench, plan, knowledge, Hypotheses(), seed + FIRST_TRUE, number).bench
            true, tuned, told = _measured(true, folder / f"{number}.h5")
            how = SPOILT[number % len(SPOILT)]
            tried = spoilt(tuned, how, generator)
            true = limited(true, tried, how, generator)
            tried.check(true)
        except RigError as error:
            print(f"{name} {number}: no pair ({str(error)[:100]})", flush=True)
            continue
        made += 1
        yield f"{name} {number} {how}", true, tried, told


def _measured(bench: Any, recording: Path) -> tuple[Any, Plan, Knowledge]:
    """Tune a bench; return it with the tuned plan and what the recording tells."""
    tuning = tune(bench, recording, options=RunOptions(overwrite=True))
    with Recording(recording) as recorded:
        return bench, tuning.plan, collect_knowledge(bench, tuning.plan, {recording.name: recorded})


def judged(true: Any, plan: Plan, knowledge: Knowledge, draws: int, seed: int, jobs: int) -> dict[str, Any]:
    """Rehearse, run on the true rig, and compare."""
    verdict = verdict_of(
        rehearse(RehearsalRequest(plan=plan, bench=true, knowledge=knowledge, draws=draws, seed=seed), jobs=jobs)
    )
    happened = run_trial(plan, true, 10**6 + seed)
    shares = {
        name: _inside(verdict.margins[name], share)
        for name, share in happened.shares.items()
        if name in verdict.margins
    }
    bands = {
        f"{name} {point.number}": _inside(found.quantiles[name], getattr(point, name))
        for found in verdict.points
        for point in happened.points
        if point.number == found.number and point.accepted and found.accepted.count >= draws // 2
        for name in ("frequency_hz", "force_n", "damping_ratio")
    }
    return {
        "predicted": {
            "ends well": verdict.ends_well.value,
            "trip": verdict.trips.value,
            "lost lock": verdict.lost_lock.value,
        },
        "happened": {"ends well": happened.completed, "trip": happened.tripped, "lost lock": happened.lost_lock},
        "time inside": _inside(verdict.duration_s, happened.duration_s) if happened.completed else None,
        "margins inside": list(shares.values()),
        "points inside": list(bands.values()),
        "end": happened.end,
    }


def _inside(band: Quantiles, value: float) -> bool:
    """Whether a value lies within the 5 to 95 % band; 0.1 % of it counts as touching."""
    return bool(band.low * (1.0 - 1e-3) <= value <= band.high * (1.0 + 1e-3))


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Return Brier scores, reliability in five bins, and coverage of the 90 % bands."""
    out: dict[str, Any] = {"pairs": len(found)}
    for outcome in ("ends well", "trip", "lost lock"):
        p = np.array([one["predicted"][outcome] for one in found])
        y = np.array([float(one["happened"][outcome]) for one in found])
        bins = np.clip((5.0 * p).astype(int), 0, 4)
        out[outcome] = {
            "predicted": float(p.mean()),
            "happened": float(y.mean()),
            "brier": float(np.mean((p - y) ** 2)),
            "brier of the mean": float(y.mean() * (1.0 - y.mean())),
            "reliability": {
                f"{p[bins == b].mean():.2f} predicted, of {(bins == b).sum()}": float(y[bins == b].mean())
                for b in range(5)
                if (bins == b).any()
            },
        }
    for name in ("margins inside", "points inside"):
        values = [value for one in found for value in one[name]]
        out[name] = float(np.mean(values)) if values else math.nan
    times = [one["time inside"] for one in found if one["time inside"] is not None]
    out["time inside"] = float(np.mean(times)) if times else math.nan
    return out


def main(pairs: int = 100, draws: int = 50, seed: int = 1, jobs: int = 2, output: Path | None = None) -> None:
    """Rehearse and run so many pairs, and print the summary; all pairs are written to a file."""
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, true, plan, knowledge in drawn_pairs(pairs, seed, Path(folder)):
            one = judged(true, plan, knowledge, draws, seed, jobs)
            found.append({"name": name, **one})
            p, y = one["predicted"], one["happened"]
            print(f"{len(found):3} {name:36} {one['end']:20}", *(f"{k} {p[k]:.2f}/{int(y[k])}" for k in p), flush=True)
            if output is not None:
                output.write_text(json.dumps(found), encoding="utf-8")
    show(summary(found))


if __name__ == "__main__":
    typer.run(main)
