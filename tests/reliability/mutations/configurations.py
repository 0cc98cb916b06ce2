"""Spoilt benches and plans: what a user could have in a TOML file, and what `rig run` does with it before anything moves."""

import tomllib
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np

from rig.bench import load_bench
from rig.campaigns.planning.lengths import check_length
from rig.campaigns.plans import bench_of, load_plan
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from rig.tick.tick import TickSettings
from simulators.parts import specimen_table
from tests.reliability.mutations.byte_mutations import BYTE_MUTATIONS
from tests.reliability.mutations.judging import Verdict, judged
from tests.reliability.mutations.table_mutations import TABLE_MUTATIONS, Table
from tests.reliability.mutations.toml_text import toml_of

RIG = Path(__file__).parents[3] / "rig"
MUTATIONS = (1, 1, 1, 2, 3)
PART_IN_BYTES = 0.15
SAMPLES = 100  # that a rig is run for


@dataclass(frozen=True)
class Spoilt:
    """A file that was spoilt."""

    name: str
    """What it was: ``plan magnet-beam/backbone``, ``bench magnet-beam``."""
    mutations: tuple[str, ...]
    """What has been done to it."""
    data: bytes
    """Its bytes now."""


def spoilt_configurations(count: int, seed: int) -> Iterator[Spoilt]:
    """So many spoilt benches and plans; the same for the same seed, and those of a longer run begin as a shorter one's."""
    sources = _shipped()
    for number in range(count):
        random = Random(f"{seed}/{number}")
        name, path = random.choice(sources)
        yield _in_bytes(name, path, random) if random.random() < PART_IN_BYTES else _in_tables(name, path, random)


def shipped_as_they_are() -> list[Spoilt]:
    """What is spoilt here, before it is: by way of tables, every bench with its specimen written out."""
    return [Spoilt(name, (), _written(_table(name, path)[0])) for name, path in sorted(set(_shipped()))]


def compiled(folder: Path) -> None:
    """Use one bench as it is, so that compiling its code, where that is not cached, is not counted as the first file's time."""
    (folder / "whole.toml").write_text('base = "friction-beam"\n', encoding="utf-8")
    _use_bench(folder / "whole.toml")


def judge(spoilt: Spoilt, folder: Path) -> Verdict:
    """Load the file; what is accepted is built: rig, segments, tick."""
    path = folder / "spoilt.toml"
    path.write_bytes(spoilt.data)
    use = _use_plan if spoilt.name.startswith("plan ") else _use_bench
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning of numpy would stand on the terminal
        return judged(lambda: use(path), (ConfigurationError,))


def _use_plan(path: Path) -> None:
    plan = load_plan(path)
    bench = bench_of(plan, path)
    plan.check(bench)
    check_length(plan, bench)
    segments = plan.segments(bench.sample_rate_hz)
    waveforms = plan.waveforms(bench.sample_rate_hz)
    settings = TickSettings(
        bench, plan.law, plan.amplitude_law, plan.settle_rule, segments, waveforms, plan.known_plant
    )
    settings.build(1.5)


def _use_bench(path: Path) -> None:
    bench = load_bench(path)
    daq = make_daq(bench)
    assert all(isinstance(remark, str) for remark in daq.remarks)
    with daq:
        daq.start(bench.block)
        for _ in range(max(1, SAMPLES // bench.block)):
            inputs = daq.exchange(np.full(bench.block, min(0.01, bench.limits.voltage_v)))
    assert np.all(np.isfinite(inputs)), "the rig reads numbers that are none"


def _shipped() -> list[tuple[str, Path]]:
    plans = sorted((RIG / "campaigns" / "shipped").rglob("*.toml"))
    benches = sorted((RIG / "bench" / "shipped").glob("*.toml"))
    named = [(f"plan {path.relative_to(RIG / 'campaigns' / 'shipped').with_suffix('')}", path) for path in plans]
    # Benches as often as plans, and every second one with its specimen written out.
    times = len(plans) // (2 * len(benches))
    return (
        named
        + times * [(f"bench {path.stem}", path) for path in benches]
        + times * [(f"specimen {path.stem}", path) for path in benches]
    )


def _in_bytes(name: str, path: Path, random: Random) -> Spoilt:
    data, done = path.read_bytes(), []
    for _ in range(random.choice(MUTATIONS)):
        mutation = random.choice(BYTE_MUTATIONS)
        data = mutation(data, random) or b"\n"
        done.append(mutation.__name__)
    return Spoilt(name, tuple(done), data)


def _in_tables(name: str, path: Path, random: Random) -> Spoilt:
    (table, spoilt), done = _table(name, path), []
    for _ in range(random.choice(MUTATIONS)):
        mutation = random.choice(TABLE_MUTATIONS)
        try:
            mutation(spoilt, random)
        except (IndexError, KeyError, RecursionError):  # nothing is left to spoil
            continue
        done.append(mutation.__name__)
    return Spoilt(name, tuple(done), _written(table))


def _table(name: str, path: Path) -> tuple[Table, Table]:
    """A file's table, and the part of it that is to be spoilt: of a specimen all that the bench's driver is told."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    if not name.startswith("specimen "):
        return table, table
    options = table["driver"]["options"]
    table["driver"]["options"] = specimen_table(options.pop("specimen")) | options
    return table, table["driver"]["options"]


def _written(table: Table) -> bytes:
    return toml_of(table).encode("utf-8", "surrogatepass")
