"""Size, stack and instructions of the compiled tick, and how its libm differs, as tables of Markdown.

Needs the package, arm-none-eabi-gcc with newlib, and QEMU: ``python firmware/checks/tick/measures.py``.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import captures
import images
import numpy as np

from rig.firmware.build import build_tick

sys.path.append(str(Path(__file__).parents[1] / "arm"))
from execution import TRACE, Functions
from tools import table

WINDOWS = [(0, 250), (2500, 250), (6000, 250)]
PARTS = {
    "`sin`, `cos`": ("sin", "cos", "__kernel_sin", "__kernel_cos", "__ieee754_rem_pio2", "fabs"),
    "`atan2`": ("atan2", "__ieee754_atan2", "atan"),
    "the block: flags, continuation, call with its arguments": ("vibrolock_tick_block",),
    "conversions between 64-bit integers and doubles": ("__aeabi_dadd", "__floatdidf", "__fixdfdi", "__fixunsdfdi"),
}
"""Functions of the image by part; names of kernels are found within those of numba. All others are the rest of the tick."""
ARGUMENTS = 20_000


def ticks(program: Path, folder: Path, law: str) -> list[images.Ticked]:
    """Run the windows of a test on a program."""
    return images.ticked(program, folder, [one.samples for one in captures.captured(law, WINDOWS)])


def part_of(function: str) -> str:
    """Return the part to which a function belongs."""
    for part, names in PARTS.items():
        if function in names or (function.startswith("_Z") and any(name in function for name in names)):
            return part
    return "readings, detector, laws, sequencer, guard, row"


def by_part(program: Path, folder: Path, samples: images.Samples) -> Counter[str]:
    """Count the instructions of a tick, by part, in a trace of all that QEMU executes."""
    functions, counts, inside = Functions(program), Counter[str](), False
    images.write_requests(folder, images.requests_for([samples]))
    command = images.command_for(program, "-singlestep", "-d", "exec,nochain")
    with subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as qemu:
        assert qemu.stderr is not None
        for line in qemu.stderr:
            if found := TRACE.match(line):
                name, begins = functions.at(found[1])
                inside = (inside or (name == "vibrolock_tick_block" and begins)) and name not in ("main", "run_tick")
                counts[part_of(name)] += inside
    return counts


def libm_rows(host: Path, image: Path, folder: Path) -> list[list[object]]:
    """Return how often, and by how much, each function of two programs differs."""
    random = np.random.default_rng(1)
    values = {name: random.uniform(-10.0, 10.0, ARGUMENTS) for name in images.FUNCTIONS}
    values["log"] = values["pow"] = 10.0 ** random.uniform(-3.0, 3.0, ARGUMENTS)
    rows: list[list[object]] = []
    for name, x in values.items():
        one, other = (images.evaluated(program, folder, name, x).view(np.int64) for program in (host, image))
        apart = np.abs(one - other)
        rows.append([f"`{name}`", f"{100 * np.mean(apart > 0):.1f} %", f"{apart.max()} ulp"])
    return rows


def main() -> None:
    """Print all tables."""
    sizes, instructions, parts = ([] for _ in range(3))
    with tempfile.TemporaryDirectory() as name:
        folder, programs = Path(name), {}
        for target in ("host", *images.BOARDS):
            facts = build_tick(target, folder, overwrite=True).facts
            programs[target] = images.program(target, folder, folder)
            sizes.append([target, facts.code, facts.constants, " ".join(facts.undefined)])
        for target in images.BOARDS:
            for law in captures.LAWS:
                done = ticks(programs[target], folder, law)
                counts = np.concatenate([one.instructions for one in done])
                row = [target, law, f"{counts.mean():.0f}", counts.max(), max(one.stack for one in done)]
                instructions.append(row)
        for law in captures.LAWS:
            samples = captures.captured(law, WINDOWS[1:2])[0].samples
            short = images.first(samples, 60)
            counted = by_part(programs["cortex-m7"], folder, short)
            parts += [[law, part, round(number / 60)] for part, number in counted.most_common()]
        libm = libm_rows(programs["host"], programs["cortex-m7"], folder)
    print(table(["target", "code, bytes", "constants", "to be linked"], sizes), end="\n\n")
    print(table(["target", "loop", "instructions, mean", "most", "stack, bytes"], instructions), end="\n\n")
    print(table(["loop", "part", "instructions"], parts), end="\n\n")
    print(table(["function", "differs in", "by at most"], libm))


if __name__ == "__main__":
    main()
