"""What is told of a run: a table by package, who survived, and a file that another run can be compared with."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.reliability.mutants.choosing import Mutant
from tests.reliability.mutants.running import FATES, Verdict

KILLED = ("killed", "killed by time")


def table(mutants: Sequence[Mutant], verdicts: Mapping[str, Verdict], left_out: Sequence[Mutant]) -> list[str]:
    """Mutants by package and fate; the share is of those that tests have judged."""
    lines = [
        f"| package | mutants | {' | '.join(FATES)} | share killed | mean the same |",
        "|---|" + "---|" * (3 + len(FATES)),
    ]
    packages = [*dict.fromkeys(one.package for one in [*mutants, *left_out])]
    for package in [*packages, "all"]:
        some = [one for one in mutants if package in (one.package, "all")]
        fates = Counter(verdicts[one.name].fate for one in some)
        killed = sum(fates[fate] for fate in KILLED)
        told = killed + fates["survived"]
        share = f"{100 * killed / told:.0f} %" if told else "-"
        same = sum(package in (one.package, "all") for one in left_out)
        counts = " | ".join(str(fates[fate]) for fate in FATES)
        lines.append(f"| {package} | {len(some)} | {counts} | {share} | {same} |")
    return lines


def survivors(mutants: Sequence[Mutant], verdicts: Mapping[str, Verdict]) -> list[str]:
    """One line for each mutant that no test has noticed: file, line, function, before and after."""
    return [told(one) for one in mutants if verdicts[one.name].fate == "survived"]


def told(mutant: Mutant) -> str:
    """A mutant in one line."""
    one = mutant.change
    return f"{mutant.path}:{one.line} {one.function}: {one.before} -> {one.after}"


def write(file: Path, mutants: Sequence[Mutant], verdicts: Mapping[str, Verdict], facts: Mapping[str, Any]) -> None:
    """Write ``facts`` and what is known of each mutant so far, as JSON."""
    rows = [
        {"name": one.name, "line": one.change.line, "operator": one.change.operator, **vars(verdicts[one.name])}
        for one in mutants
        if one.name in verdicts
    ]
    file.write_text(json.dumps({**facts, "mutants": rows}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read(file: Path) -> dict[str, Verdict]:
    """The verdicts of a run, by the name of the mutant."""
    rows = json.loads(file.read_text(encoding="utf-8"))["mutants"]
    return {row["name"]: Verdict(row["fate"], row["by"], row["took_s"]) for row in rows}


def compared(first: Path, second: Path) -> tuple[list[str], int]:
    """Which mutants have another fate in the second run, in lines; and how many that were killed survive now."""
    one, other = ({name: verdict.fate for name, verdict in read(file).items()} for file in (first, second))
    both = [name for name in one if name in other]
    lines = [f"{name}: {one[name]}, now {other[name]}" for name in both if one[name] != other[name]]
    lost = sum(one[name] in KILLED and other[name] == "survived" for name in both)
    gained = sum(other[name] in KILLED and one[name] == "survived" for name in both)
    lines.append(
        f"{len(both)} mutants in both; {gained} that survived are killed now, {lost} that were killed survive; "
        f"{len(one) - len(both)} only in the first, {len(other) - len(both)} only in the second"
    )
    return lines, lost
