"""Change one expression of the product at a time, run the tests that mirror it, and say what they did not notice.

``python -m tests.reliability.mutants [-n 200] [--seed 1] [--package controller ...] [--jobs 1] [--output FILE]``

``--only TEXT`` judges one again, ``--tests CHECKOUT`` judges the same mutants by the tests of another checkout, ``--compare ONE
OTHER`` compares what two runs have written and ends with 1 where a mutant that was killed survives, ``--list`` names the
mutants and runs nothing.
"""

import argparse
import signal
import sys
from pathlib import Path

import vibrolock
from tests.reliability.mutants.choosing import EQUIVALENT, PACKAGES, Mutant, chosen
from tests.reliability.mutants.running import LIMIT_S, Verdict, judged
from tests.reliability.mutants.telling import compared, read, survivors, table, told, write
from vibrolock.kernel_cache import kernel_cache_folder

ROOT = Path(__file__).parents[3]


def arguments() -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(description="Do the tests notice when the product changes?")
    parser.add_argument("-n", "--number", type=int, default=200, help="mutants")
    parser.add_argument("--seed", type=int, default=1, help="chooses them")
    parser.add_argument("--package", nargs="+", choices=PACKAGES, default=[*PACKAGES], help="of these packages only")
    parser.add_argument("--only", default="", metavar="TEXT", help="of those chosen the ones whose names contain it")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="for the tests of one mutant, s")
    parser.add_argument("--tests", type=Path, default=ROOT, metavar="CHECKOUT", help="another one, whose tests judge")
    parser.add_argument("--output", type=Path, metavar="FILE", help="what is found, as JSON; written after each mutant")
    parser.add_argument("--resume", action="store_true", help="judge only what the output has not, of the same code")
    parser.add_argument(
        "--compare", type=Path, nargs=2, metavar=("ONE", "OTHER"), help="files of two runs; runs nothing"
    )
    parser.add_argument("--list", action="store_true", help="name the mutants; run nothing")
    return parser.parse_args()


def main() -> int:
    """Judge, and print; 1 where a comparison finds that tests notice less."""
    wanted = arguments()
    if wanted.compare:
        lines, lost = compared(*wanted.compare)
        print("\n".join(lines))
        return int(lost > 0)
    every = [one for one in chosen(ROOT, wanted.package, wanted.number, wanted.seed) if wanted.only in one.name]
    mutants = [one for one in every if one.name not in EQUIVALENT]
    left_out = [one for one in every if one.name in EQUIVALENT]
    if wanted.list:
        print("\n".join(one.name for one in mutants))
        return 0
    facts = {"seed": wanted.seed, "number": wanted.number, "packages": wanted.package, "version": vibrolock.__version__}
    known = read(wanted.output) if wanted.resume and wanted.output.exists() else {}
    verdicts = {one.name: known[one.name] for one in mutants if one.name in known}

    def say(mutant: Mutant, verdict: Verdict) -> None:
        verdicts[mutant.name] = verdict
        print(f"{verdict.fate}, {verdict.took_s:.0f} s: {told(mutant)}  [{verdict.by}]", file=sys.stderr, flush=True)
        if wanted.output:
            write(wanted.output, mutants, verdicts, facts)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # temporary files are removed
    judged(
        [one for one in mutants if one.name not in verdicts],
        ROOT,
        wanted.tests.resolve(),
        PACKAGES,
        kernels=kernel_cache_folder(),
        jobs=wanted.jobs,
        limit_s=wanted.limit,
        say=say,
    )
    print("\n".join(table(mutants, verdicts, left_out)))
    print("\nSurvived:" if survivors(mutants, verdicts) else "\nNone survived.")
    print("\n".join(survivors(mutants, verdicts)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
