"""The files of a compiled tick: object, header, and a text of what they are."""

from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from rig.errors import ConfigurationError, RecordingError
from rig.firmware.elf import ObjectFacts, read_object
from rig.firmware.header import header
from rig.firmware.machine_code import kernels_digest, object_file
from rig.firmware.signature import example
from rig.firmware.targets import Target, target_named
from rig.system.whole_file import whole_file

HEADER = "vibrolock_tick.h"


class Built(NamedTuple):
    """A compiled tick on disk."""

    object: Path
    header: Path
    text: Path
    facts: ObjectFacts
    digest: str
    """That of the kernels and their records: a device tells it, a host compares it with its own."""


def build_tick(target: str, folder: Path, *, overwrite: bool = False) -> Built:
    """Compile the tick for a target and write ``tick-TARGET.o``, its header and ``tick-TARGET.txt`` into a folder.

    The folder is made if it is not there. All files are written, or none. Raises `ConfigurationError` for a target that there
    is not or that llvmlite cannot compile for, `RecordingError` if a file cannot be written, or has another content
    already and ``overwrite`` is false.
    """
    chosen = target_named(target)
    paths = (folder / f"tick-{target}.o", folder / HEADER, folder / f"tick-{target}.txt")
    _prepare(folder)
    code, digest = object_file(chosen), kernels_digest()
    facts = read_object(code)
    contents = (code, header(example(), digest).encode(), _text(chosen, facts, digest).encode())
    for path, content in zip(paths, contents, strict=True):
        if path.is_dir() or (path.exists() and not overwrite and path.read_bytes() != content):
            raise RecordingError(f"{path}: exists already with another content; choose another folder, or --overwrite")
    with ExitStack() as stack:
        for path, content in zip(paths, contents, strict=True):
            stack.enter_context(whole_file(path)).write_bytes(content)
    return Built(*paths, facts, digest)


def _prepare(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"no folder can be made there ({error.strerror})", field="output", value=str(folder)
        ) from None


def _text(target: Target, facts: ObjectFacts, digest: str) -> str:
    """Return what the object is, for people: line by line."""
    lines = {
        "target": f"{target.name} ({target.note})",
        "compiled for": " ".join(filter(None, (target.triple, target.cpu, target.features))),
        "digest": digest,
        "code": f"{facts.code} bytes",
        "constants": f"{facts.constants} bytes",
        "data": f"{facts.data} bytes",
        "undefined": " ".join(facts.undefined),
    }
    return "".join(f"{name}: {value}\n" for name, value in lines.items())
