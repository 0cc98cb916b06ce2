"""Worst stack of the core: the longest path through the compiler's call graph, and what a painted stack shows after a run.

The compiler says the frame of each function and whom it calls. A call through `struct vl_wire` leads to the function that the
board's wire has there. Frames of library functions are read from their machine code.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from tools import ARM, FIRMWARE, OPTIMISATIONS, WIRES, load, objects, output_of, said, table

NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes')
EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^":]+):(\d+):\d+")?')
MEMBER = re.compile(r"wire->(\w+)\(")
EXCEPTION_FRAME = 108  # bytes: eight registers, the FPU's seventeen, a word that keeps eight bytes aligned
FROM_MAIN = ("vl_serve", "vl_begin")
FROM_INTERRUPT = ("vl_output", "vl_input", "vl_watch")
PAINT = b"\xa5\xa5\xa5\xa5"  # startup.c


@dataclass
class Graph:
    """Bytes of the frame of each function, and whom it calls."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def missing(self) -> set[str]:
        """Functions that are called and have no frame yet. Those of the board have none: what it needs is its own."""
        called = {callee for callees in self.calls.values() for callee in callees}
        return {name for name in called - self.frames.keys() if not name.startswith("board_")}

    def path(self, name: str, above: tuple[str, ...] = ()) -> tuple[int, list[str]]:
        """Most bytes of stack below a call, and the way there. `RuntimeError` where functions call themselves."""
        if name in above:
            raise RuntimeError(f"{name} calls itself: {above}")
        ways = [self.path(callee, (*above, name)) for callee in sorted(self.calls.get(name, ()))]
        bytes_, way = max(ways, default=(0, []))
        return self.frames.get(name, 0) + bytes_, [name.rpartition(":")[2], *way]


def members_of(wire: str) -> dict[str, str]:
    """The functions of a wire, by the member of `struct vl_wire` that they are; titles as in the call graph."""
    for source in sorted((FIRMWARE / "core").glob("*.c")):
        found = re.search(rf"const struct vl_wire {wire} = \{{(.*?)\}}", source.read_text(), re.DOTALL)
        if found:
            pairs = re.findall(r"\.(\w+) = (\w+)", found[1])
            return {member: f"core/{source.name}:{function}" for member, function in pairs}
    raise RuntimeError(f"no {wire}")


def graph_of(build: Path, optimisation: str, wire: str) -> Graph:
    """The call graph of the core with one wire."""
    graph, members = Graph(), members_of(WIRES[wire])
    for made in objects(build, optimisation):
        text = Path(made).with_suffix(".ci").read_text()
        for name, size in NODE.findall(text):
            graph.frames[name] = int(size)
        for caller, callee, file, line in EDGE.findall(text):
            at = callee if callee != "__indirect_call" else member_called(members, file, int(line))
            graph.calls.setdefault(caller, set()).add(at)
    add_libraries(graph, load(build, wire, optimisation))
    return graph


def member_called(members: dict[str, str], file: str, line: int) -> str:
    """The function that a call through `struct vl_wire` reaches."""
    found = MEMBER.search((FIRMWARE / file).read_text().splitlines()[line - 1])
    if found is None:
        raise RuntimeError(f"{file}:{line}: calls through something that is no wire")
    return members[found[1]]


def add_libraries(graph: Graph, elf: Path) -> None:
    """Frames and calls of functions without a call graph, from their machine code."""
    text = output_of(f"{ARM}objdump", "-d", "--no-show-raw-insn", str(elf))
    bodies = dict(re.findall(r"^\w+ <([\w.]+)>:\n(.*?)(?=^\w+ <|\Z)", text, re.MULTILINE | re.DOTALL))
    while missing := graph.missing() & bodies.keys():
        for name in missing:
            graph.frames[name] = frame_in(bodies[name])
            branches = re.findall(r"\bb(?:l|lx|\.w)?\s+\w+ <([\w.]+)>", bodies[name])
            graph.calls[name] = {callee for callee in branches if callee != name}


def frame_in(body: str) -> int:
    """Bytes that machine code puts on the stack."""
    lists = re.findall(r"(?:\bpush|stmdb\s+sp!,)\S*\s+\{([^}]*)\}", body)  # of registers: r4, r5, r6, lr
    pushed = sum(4 * len(listed.split(",")) for listed in lists)
    taken = sum(int(number) for number in re.findall(r"\bsub\S*\s+sp, (?:sp, )?#(\d+)", body))
    return pushed + taken + sum(int(number) for number in re.findall(r"\bstr\S*\s+[\w, ]+\[sp, #-(\d+)\]!", body))


def painted(memory: bytes) -> int:
    """Bytes of stack that were ever used, from the RAM of a board whose startup.c paints it."""
    at = memory.find(4 * PAINT)
    while memory[at : at + 4] == PAINT:
        at += 4
    return len(memory) - at


def report(build: Path) -> str:
    """The table of stacks. The worst is the main loop's, with both kinds of interrupt on top of it."""
    head = ["wire", "main loop", "painted", "sampling interrupt", "together", "the main loop's longest way"]
    rows: list[list[object]] = []
    for optimisation in OPTIMISATIONS:
        for wire in WIRES:
            graph = graph_of(build, optimisation, wire)
            main, way = max(graph.path(name) for name in FROM_MAIN)
            interrupt, _ = max(graph.path(name) for name in FROM_INTERRUPT)
            _, used = said(load(build, wire, optimisation))
            worst = main + EXCEPTION_FRAME + interrupt
            rows.append(
                [f"{wire}, {optimisation}", main, used, interrupt, worst, ", ".join(f"`{name}`" for name in way)]
            )
    return table(head, rows)
