"""Every shipped plan on sound rigs, seed after seed: whether the watch on force and motion ever acts, and how near it comes.

``python -m tests.reliability.false_trips`` counts; ``--write docs/reference/fault-matrix.md`` writes the counts there.
"""

import argparse
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path
from typing import NamedTuple

from joblib import Parallel, delayed

from controller import AmplitudeLaw
from rig.campaigns.plans import bench_of, load_plan, shipped_plans
from rig.drivers.virtual import VirtualDAQ
from rig.loop.loop import Loop
from rig.tick.safety.keeping import CHANGED_PERIODS, FAR
from rig.tick.safety.layout import EndReason
from rig.tick.safety.response_plausibility import OUT_OF_BAND_PERIODS
from rig.tick.tick import TickSettings
from tests.recorded import changed
from tests.rig.rigs import bench_with

BEGIN, END = "<!-- begin of the count of false trips -->\n", "<!-- end of the count of false trips -->\n"


class SoundRun(NamedTuple):
    """What the watch saw of one run without a fault."""

    plan: str
    held: bool
    noise: float
    reason: EndReason
    out_of_band_periods: int
    unlike_periods: float
    highest: float = 0.0
    """Largest ratio of what is held to its level, under a lock."""
    changed_periods: int = 0
    """Most periods in a row in which the output over what is held had changed beyond what is explained."""


def held_level_plans() -> list[str]:
    """Shipped plans with a force or a response that is held."""
    return [name for name in shipped_plans() if load_plan(name).amplitude_law is not AmplitudeLaw.VOLTAGE]


def sound_run(name: str, seed: int, noise: float, **changes: object) -> SoundRun:
    """A shipped plan, with ``changes`` to its keys, on its rig with so many times the noise; no point is evaluated."""
    plan = changed(name, **changes)
    bench = bench_with(name=bench_of(plan, name).name, noise_scale=noise)
    rate = bench.sample_rate_hz
    with VirtualDAQ(bench, seed) as daq:
        daq.start(bench.block)
        settings = TickSettings(
            bench,
            plan.law,
            plan.amplitude_law,
            plan.settle_rule,
            plan.segments(rate),
            plan.waveforms(rate),
            plan.known_plant,
        )
        loop = Loop(daq, settings.build(daq.latency_samples))
        for _ in loop.run():
            pass
    seen = loop.tick.arrays.plausibility[0]
    return SoundRun(
        name,
        plan.amplitude_law is not AmplitudeLaw.VOLTAGE,
        noise,
        EndReason(int(loop.tick.guard["reason"][0])),
        int(seen["most_periods"]),
        float(seen["most_unlike_s"]) * bench.specimen.linear_frequency_hz,
        float(seen["kept"]["highest"]),
        int(seen["kept"]["most_changed_periods"]),
    )


def table_of(runs: Iterable[SoundRun]) -> list[str]:
    """The counts as a table, by what is held and by the noise."""
    runs = list(runs)
    out = [
        "| plans | noise | runs | tripped or ended early | most periods astray, of "
        f"{OUT_OF_BAND_PERIODS} | most periods against the known plant, of 1 | largest ratio to the level, of {FAR:g} | "
        f"most periods with a changed gain, of {CHANGED_PERIODS} |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for held, noise in sorted({(run.held, run.noise) for run in runs}, key=lambda key: (not key[0], key[1])):
        some = [run for run in runs if (run.held, run.noise) == (held, noise)]
        ended = sum(run.reason is not EndReason.COMPLETED for run in some)
        out.append(
            f"| {'a level is held' if held else 'all others'} | {noise:g} × | {len(some)} | {ended} | "
            f"{max(run.out_of_band_periods for run in some)} | {max(run.unlike_periods for run in some):.2f} | "
            f"{max(run.highest for run in some):.2f} | {max(run.changed_periods for run in some)} |"
        )
    return out


def _asked(seeds: int, others: int, noises: list[float]) -> Iterator[tuple[str, int, float]]:
    held = held_level_plans()
    for noise in noises:
        for name in shipped_plans():
            for seed in range(seeds if name in held else others):
                yield name, seed, noise


def main() -> None:
    """Count, print, and write."""
    parser = argparse.ArgumentParser(description="How often the watch on force and motion acts on sound rigs.")
    parser.add_argument("--seeds", type=int, default=20, help="of plans that hold a level")
    parser.add_argument("--others", type=int, default=5, help="seeds of all other plans")
    parser.add_argument("--noise", type=float, action="append", help="times the noise; may be given again")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", type=Path, help="page that the counts are written to")
    asked = parser.parse_args()
    work = _asked(asked.seeds, asked.others, asked.noise or [1.0, 10.0])
    runs = Parallel(n_jobs=asked.jobs, verbose=1)(delayed(sound_run)(*one) for one in work)
    early = [run for run in runs if run.reason is not EndReason.COMPLETED]
    lines = [*table_of(runs), "", f"Counted on {date.today().isoformat()}.", ""]
    print("\n".join([*map(str, early), *lines]))
    if asked.write:
        text = asked.write.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN)
        asked.write.write_text(
            before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + rest.split(END)[1], encoding="utf-8"
        )


if __name__ == "__main__":
    main()
