"""The tables of the page of the fault matrix: what every fault did, with date, machine and version."""

from collections.abc import Mapping

from tests.reliability.faults.bounds import objections
from tests.reliability.faults.matrix import CASES, Case
from tests.reliability.faults.observing import Observation
from tests.reliability.faults.plans import bench_for
from tests.reliability.faults.table import FAULTS
from tests.reliability.pages import between, measured

TABLES = {
    "A driver in the process, magnet beam": ("virtual", ("V", "N logarithmic", "N linear", "m")),
    "A device behind the wire protocol, magnet beam": ("emulated", ("V", "N logarithmic", "N linear", "m")),
    "A driver in the process, friction beam": ("virtual", ("V, friction", "N, friction")),
}
"""Headings of the tables, with device and columns of each."""

BEGIN, END = "<!-- begin of what the command writes -->", "<!-- end of what the command writes -->"


def written(text: str, observed: Mapping[Case, Observation]) -> str:
    """A page with the tables of what was observed between its two marks; its prose stays."""
    tables = [f"## {heading}\n\n{_table(observed, *columns)}" for heading, columns in TABLES.items()]
    return between(text, BEGIN, END, "\n\n".join((measured(), *tables)))


def rows_of(text: str, heading: str) -> set[str]:
    """Names of the faults in a table of the page."""
    part = text.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return {line.split("`")[1] for line in part.splitlines() if line.startswith("| `")}


def _table(observed: Mapping[Case, Observation], device: str, columns: tuple[str, ...]) -> str:
    asked = {(case.fault, case.levels) for case in CASES if case.device == device}
    out = [f"| fault | what | {' | '.join(columns)} |", "|---|---|" + "---|" * len(columns)]
    for fault in FAULTS:
        if not any((fault, levels) in asked for levels in columns):
            continue
        cells = [
            _cell(case, observed[case]) if case in observed else "–"
            for case in (Case(fault, levels, device) for levels in columns)
        ]
        out.append(f"| `{fault.name}` | {fault.what} | {' | '.join(cells)} |")
    return "\n".join(out)


def _cell(case: Case, seen: Observation) -> str:
    bench = bench_for(case.levels)
    ms = 1e3 / bench.sample_rate_hz
    spoilt = f", {seen.spoilt} *spoilt*" if seen.spoilt else ""
    end = f"went on, {seen.accepted} accepted{spoilt}"
    if seen.samples_to_trip is not None:
        at_zero = 0 if seen.samples_to_zero is None else seen.samples_to_zero
        reason = seen.reason.replace("_", " ") or seen.raised.split(":")[0]
        end = f"{reason}, {ms * seen.samples_to_trip:.0f} / {ms * max(at_zero, seen.samples_to_trip):.0f} ms{spoilt}"
    if case.fault.kind == "host-killed":
        end = f"watchdog, 0 V after {ms * (seen.samples_to_zero or 0):.0f} ms"
    mark = " **(!)**" if objections(case, seen, bench) else ""
    return f"{seen.output_v / seen.healthy_output_v:.2f}, {seen.force_n:.1f} N, {end}{mark}"
