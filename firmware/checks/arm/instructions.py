"""Instructions of the core, counted one by one, as tables.

QEMU counts instructions, not cycles, and knows no wait states of a flash. What the board's own functions need is left out.
"""

from collections import Counter
from pathlib import Path
from statistics import fmean

from execution import CALLED, Counts, traced
from tools import OPTIMISATIONS, WIRES, load, said, table

BLOCKS = (1, 5, 10)
RATE_HZ = 5000
CLOCK_HZ = 170e6
TIMER_TICK = 40  # instructions: 25 MHz where an instruction takes 1 ns


def row(wire: str, optimisation: str, block: int, counts: Counts) -> list[object]:
    """A row of the table of instructions."""
    output, input_, serve = (counts.calls["steady", name] for name in CALLED)
    a_block = [sum(serve[at : at + block]) for at in range(0, len(serve), block)]  # vl_serve is called once a sample
    a_sample = fmean(output) + fmean(input_) + fmean(a_block) / block
    share = 100 * a_sample * RATE_HZ / CLOCK_HZ
    numbers = [f"{fmean(one):.0f} / {max(one)}" for one in (output, input_, a_block)]
    return [f"{wire}, {optimisation}", block, *numbers, max(serve), f"{share:.1f}", f"{2 * share:.1f}"]


def where_outputs_are_missing(wire: str, optimisation: str, counts: Counts) -> list[object]:
    """A row of the table of ``vl_output`` where an output is missing: the first one of a source, and those behind it."""
    out: list[object] = [f"{wire}, {optimisation}"]
    for period in ("short", "longest"):
        first, *others = counts.calls[f"continued_{period}", "vl_output"]
        out += [first, max(others)]
    return out


def at_worst(wire: str, optimisation: str, counts: Counts) -> list[object]:
    """A row of the table of what an interrupt and a lock need at most."""
    output = max(max(counts.calls[caller, "vl_output"]) for caller in ("steady", "ramp", "ramp_by_main_loop"))
    input_ = max(max(calls) for (_, name), calls in counts.calls.items() if name == "vl_input")
    return [f"{wire}, {optimisation}", output, input_, counts.locked]


def hot(counts: Counts) -> str:
    """The functions that hold most of the instructions of the steady calls, a sample."""
    samples = len(counts.calls["steady", "vl_output"])
    all_calls = sum((counts.by_function["steady", name] for name in CALLED), Counter[str]())
    return ", ".join(f"`{name}` {number / samples:.0f}" for name, number in all_calls.most_common(7))


HEAD = [
    "wire",
    "block",
    "`vl_output`",
    "`vl_input`",
    "`vl_serve`, a block",
    "longest call of it",
    "share, %",
    "at 2 cycles, %",
]
HEAD_AT_WORST = ["wire", "`vl_output`", "`vl_input`", "locked"]
HEAD_OF_MISSING = [
    "wire",
    "period of 100: first",
    "each further",
    "the longest period, in a ramp: first",
    "each further",
]
HEAD_OF_FUNCTIONS = ["wire", "functions, instructions a sample", "by trace", "by timer"]


def report(build: Path) -> str:
    """Tables of instructions: by block; at worst; by function, with how well trace and timer agree."""
    by_block, worst, missing, functions = (list[list[object]]() for _ in range(4))
    for optimisation in OPTIMISATIONS:
        for wire in WIRES:
            for block in BLOCKS:
                elf = load(build, wire, optimisation, block)
                counts = traced(elf)
                by_block.append(row(wire, optimisation, block, counts))
            worst.append(at_worst(wire, optimisation, counts))
            missing.append(where_outputs_are_missing(wire, optimisation, counts))
            timed = TIMER_TICK * said(elf)[0]
            functions.append([f"{wire}, {optimisation}", hot(counts), counts.steady, timed])
    return "\n\n".join(
        [
            f"{RATE_HZ} Hz; mean / most. Share: of the cycles of {CLOCK_HZ / 1e6:.0f} MHz at one cycle an instruction.",
            table(HEAD, by_block),
            "At most, with the watchdog's trip and ramp; locked: between `board_lock` and `board_unlock`.",
            table(HEAD_AT_WORST, worst),
            f"`vl_output` where an output is missing, in blocks of {BLOCKS[-1]}. The first looks for the period's extremes.",
            table(HEAD_OF_MISSING, missing),
            f"Where they go, at blocks of {BLOCKS[-1]}; and all instructions of the steady part, by two ways of counting.",
            table(HEAD_OF_FUNCTIONS, functions),
        ]
    )
