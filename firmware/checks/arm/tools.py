"""What all measures share: how the core is compiled for ARM, and how its programs are run."""

import re
import subprocess
from functools import cache
from pathlib import Path

FIRMWARE = Path(__file__).parents[2]
BOARD = "boards/mps2-an386"
WIRES = {"serial": "vl_serial", "CAN": "vl_can", "CAN FD": "vl_can_fd"}
OPTIMISATIONS = ("-Os", "-O2")
ARM = "arm-none-eabi-"
QEMU = ("qemu-system-arm", "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none")
SEMIHOSTING = ("-semihosting-config", "enable=on,target=native")


def output_of(*command: str) -> str:
    """What a command of the firmware's folder prints."""
    return subprocess.run(command, cwd=FIRMWARE, check=True, text=True, stdout=subprocess.PIPE).stdout


def variable(name: str) -> list[str]:
    """A variable of the board's makefile, as words."""
    makefile = (FIRMWARE / BOARD / "board.mk").read_text()
    found = re.search(rf"^{name} [?:]?= ([^#\n]*)", makefile, re.MULTILINE)
    assert found is not None, name
    return found[1].split()


def flags() -> list[str]:
    """How the core is compiled for the board, without its optimisation."""
    return ["-std=c11", *variable("ARM"), *variable("ARM_LIMITS"), "-Icore", f"-I{BOARD}", "-Ichecks/arm"]


def core() -> list[str]:
    """Sources of the core."""
    return sorted(f"core/{path.name}" for path in (FIRMWARE / "core").glob("*.c"))


@cache
def objects(build: Path, optimisation: str) -> list[str]:
    """The core's sources compiled one by one, once in a process, with a call graph (.ci) beside each object."""
    folder = build / f"core{optimisation}"
    folder.mkdir(parents=True, exist_ok=True)
    out = [str(folder / f"{Path(source).stem}.o") for source in core()]
    for source, made in zip(core(), out, strict=True):
        output_of(f"{ARM}gcc", *flags(), optimisation, "-fcallgraph-info=su", "-c", source, "-o", made)
    return out


@cache
def load(build: Path, wire: str, optimisation: str, block: int = 10) -> Path:
    """The core with a host of its own (load.c), linked for a wire, once in a process."""
    host = "serial_host.c" if wire == "serial" else "can_host.c"
    sources = [f"{BOARD}/startup.c", *(f"checks/arm/{name}" for name in ("load.c", "common.c", host))]
    out = build / f"load-{WIRES[wire]}{optimisation}-{block}.elf"
    settings = [f"-DWIRE={WIRES[wire]}", f"-DBLOCK={block}", f"-DFD={int(wire == 'CAN FD')}"]
    linking = [
        "-nostartfiles",
        "--specs=nano.specs",
        f"-T{BOARD}/memory.ld",
        "-Wl,--gc-sections",
        f"-Wl,-Map={out}.map",
    ]
    made = objects(build, optimisation)
    output_of(f"{ARM}gcc", *flags(), optimisation, *settings, *sources, *made, "-o", str(out), *linking)
    return out


def said(elf: Path) -> tuple[int, int]:
    """What load.c prints: ticks of its timer, where an instruction takes 1 ns, and bytes of stack below its main loop."""
    command = [*QEMU, *SEMIHOSTING, "-icount", "shift=0", "-kernel", str(elf)]
    text = subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT).stdout
    ticks, stack = (int(number) for number in re.findall(r"\d+", text))
    return ticks, stack


def table(head: list[str], rows: list[list[object]]) -> str:
    """A table of Markdown; text at the left, numbers at the right."""
    lines: list[list[object]] = [[*head], ["---" if isinstance(one, str) else "---:" for one in rows[0]], *rows]
    return "\n".join("| " + " | ".join(str(one) for one in line) + " |" for line in lines)
