"""Flash and RAM of the core by wire, from the linker's map: what is left once a board names one wire."""

import re
from collections import Counter
from pathlib import Path

from tools import OPTIMISATIONS, WIRES, load, output_of, table

SECTION = re.compile(r"^ \.(text|rodata|data|bss)\S*\s+0x[0-9a-f]+\s+(0x[0-9a-f]+)\s+(\S+)$", re.MULTILINE)
LIBRARIES = ("libc_nano.a", "libgcc.a")


def sizes_of(elf: Path) -> dict[str, Counter[str]]:
    """Bytes in an image by kind of section: those of the ``core``, and those of ``libraries`` that it needs."""
    linked = Path(f"{elf}.map").read_text().split("Linker script and memory map")[1]
    on_one_line = re.sub(r"^( \.\S+)\n\s+", r"\1 ", linked, flags=re.MULTILINE)
    out: dict[str, Counter[str]] = {"core": Counter(), "libraries": Counter()}
    for kind, size, file in SECTION.findall(on_one_line):
        if "/core-O" in file:
            out["core"][kind] += int(size, 16)
        elif any(library in file for library in LIBRARIES):
            out["libraries"][kind] += int(size, 16)
    return out


def rows(build: Path, optimisation: str) -> list[list[object]]:
    """Flash and RAM for each wire: wire, optimisation, flash of the core, of libraries, RAM."""
    out: list[list[object]] = []
    for wire in WIRES:
        found = sizes_of(load(build, wire, optimisation))
        core, libraries = found["core"], found["libraries"]
        flash = core["text"] + core["rodata"] + core["data"]
        ram = core["data"] + core["bss"]
        out.append([wire, optimisation, flash, libraries["text"] + libraries["rodata"], ram])
    return out


def image_rows(build: Path) -> list[list[object]]:
    """The image for the mps2-an386: what `size` says of it."""
    out: list[list[object]] = []
    for optimisation in OPTIMISATIONS:
        folder = build / f"image{optimisation}"
        output_of("make", "-s", "mps2-an386", f"BUILD={folder}", f"ARM_OPTIMISATION={optimisation}")
        text, data, bss = output_of("arm-none-eabi-size", str(folder / "mps2-an386.elf")).split("\n")[1].split()[:3]
        out.append(["image", optimisation, int(text) + int(data), "", int(data) + int(bss)])
    return out


def report(build: Path) -> str:
    """The table of sizes."""
    head = ["what", "optimisation", "flash, bytes", "of libraries, bytes", "RAM, bytes"]
    cores = [row for optimisation in OPTIMISATIONS for row in rows(build, optimisation)]
    return table(head, cores + image_rows(build))
