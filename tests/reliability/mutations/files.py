"""Spoilt recordings, journals, models, MAT and universal files: refused, identical, or told; else it is a fault of ours."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np

from identification import Channel, LinearModes
from rig.errors import RigError
from rig.exchange.export import export_file
from rig.exchange.reading import import_file
from rig.recording.arrays import read_arrays
from rig.recording.conversion import finalise
from rig.recording.integrity import VERIFIED
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.journal_contents import JournalContents
from rig.recording.layout import file_integrity
from rig.recording.reader import Recording
from rig.results.files import load, save
from tests.reliability.mutations.byte_mutations import BYTE_MUTATIONS
from tests.reliability.mutations.judging import Verdict, judged
from tests.rig.recording.samples import fill, header

FILE_KINDS = ("recording", "recording without digest", "journal", "model", "model without digest", "mat", "uff")
FILE_OUTCOMES = ("refused", "identical", "told", "other numbers", "misbehaved")
OTHERS = ("mat", "uff")
"""Formats of others, which have no checksum: other numbers cannot be told."""
_TRAILER_BYTES = 52  # docs/reference/file-format.md
_SLOW = ("recording without digest", "model without digest", "mat")
"""Read by a child process: fewer of them."""


@dataclass(frozen=True)
class SpoiltFile:
    """One file and what was done to it."""

    kind: str
    mutation: str
    data: bytes


def originals(folder: Path) -> dict[str, bytes]:
    """A file of every kind as it is written here."""
    recording, model = folder / "recording.h5", folder / "model.h5"
    with JournalWriter.create(journal_path(recording), header()) as writer:
        fill(writer, 0, 1500, completed=False)
        fill(writer, 1500, 500)
    found = {"journal": journal_path(recording).read_bytes()}
    finalise(journal_path(recording), recording)
    save(_modes(), model)
    found |= {"recording": recording.read_bytes(), "model": model.read_bytes()}
    for kind in ("recording", "model"):
        found[f"{kind} without digest"] = found[kind][:-_TRAILER_BYTES]
    for kind in OTHERS:
        export_file(model, folder / f"model.{kind}", kind)
        found[kind] = (folder / f"model.{kind}").read_bytes()
    return found


def _modes() -> LinearModes:
    chance = np.random.default_rng(1)
    channels = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
    shapes = chance.normal(size=(2, 3))
    return LinearModes(
        channels=channels,
        frequency_hz=np.array([24.4, 98.0, 240.0]),
        frequency_std_hz=np.full(3, 1e-3),
        damping_ratio=np.array([4e-3, 2e-3, 1e-3]),
        damping_ratio_std=np.full(3, 1e-5),
        shapes=shapes,
        shapes_std=np.abs(1e-3 * shapes),
        phase_collinearity=np.ones(3),
        lower=np.zeros(2, complex),
        upper=np.zeros(2, complex),
        lowest_hz=10.0,
        highest_hz=300.0,
    )


def spoilt_files(number: int, seed: int, whole: dict[str, bytes]) -> Iterator[SpoiltFile]:
    """So many files, kind after kind, each with one or two mutations drawn by the seed."""
    quick = [kind for kind in FILE_KINDS if kind not in _SLOW]
    for index in range(number):
        chance = Random(f"files {seed} {index}")
        kind = chance.choice(_SLOW) if index % 10 == 9 else quick[index % len(quick)]
        chosen = chance.sample(BYTE_MUTATIONS, chance.choice((1, 1, 2)))
        data = whole[kind]
        for mutate in chosen:
            data = mutate(data, chance) if data else data
        yield SpoiltFile(kind, ", ".join(mutate.__name__ for mutate in chosen), data)


def judge_file(spoilt: SpoiltFile, folder: Path, content: dict[str, str]) -> Verdict:
    """Read a spoilt file as a user does; ``content`` holds what its kind says unspoilt, and is filled by `contents_of`."""
    told: list[str] = []
    path = _put(spoilt, folder)
    verdict = judged(lambda: told.append(_READERS[spoilt.kind.split()[0]](path)), (RigError,))
    if verdict.outcome != "accepted":
        return verdict
    if told[0] == content[spoilt.kind]:
        return Verdict("identical", "", verdict.cpu_s)
    if told[0].startswith("told"):
        return Verdict("told", told[0], verdict.cpu_s)
    if spoilt.kind in OTHERS:
        return Verdict("other numbers", "", verdict.cpu_s)
    return Verdict("misbehaved", f"read with other content, and nothing said: {told[0]}", verdict.cpu_s)


def contents_of(whole: dict[str, bytes], folder: Path) -> dict[str, str]:
    """What every kind says as it was written."""
    return {kind: _READERS[kind.split()[0]](_put(SpoiltFile(kind, "", data), folder)) for kind, data in whole.items()}


def _put(spoilt: SpoiltFile, folder: Path) -> Path:
    """The file where its reader looks for it; the name that the reader is given."""
    ending = spoilt.kind if spoilt.kind in OTHERS else "h5"
    path = folder / f"spoilt.{ending}"
    for old in (path, journal_path(path)):
        old.unlink(missing_ok=True)
    (journal_path(path) if spoilt.kind == "journal" else path).write_bytes(spoilt.data)
    return path


def _recorded(path: Path) -> str:
    """Everything in a recording."""
    digest = hashlib.sha256()
    with Recording(path) as recording:
        digest.update(repr((recording.kind, recording.configuration, recording.channels, recording.points)).encode())
        for part in recording.parts:
            digest.update(part.read(0, part.n_rows).tobytes())
            digest.update(repr((part.information, part.events, part.end)).encode())
        lost = [part.dropped_reason for part in recording.parts if part.dropped_reason]
        if not recording.complete:
            lost.append("not complete")
        if recording.integrity != VERIFIED:
            lost.append(recording.integrity)
    return _said(lost, digest.hexdigest())


def _journal(path: Path) -> str:
    with JournalContents(journal_path(path)) as contents:
        damaged = contents.damaged
    said = _recorded(path)
    return f"told: damaged; {said}" if damaged and not said.startswith("told") else said


def _model(path: Path) -> str:
    load(path)
    kind, arrays, attributes = read_arrays(path)
    digest = hashlib.sha256(repr((kind, sorted(attributes.items()))).encode())
    for name in sorted(arrays):
        digest.update(name.encode() + repr((arrays[name].dtype, arrays[name].shape)).encode() + arrays[name].tobytes())
    integrity = file_integrity(path)
    return _said([] if integrity == VERIFIED else [integrity], digest.hexdigest())


def _imported(path: Path) -> str:
    found = import_file(path, units="si" if path.suffix == ".uff" else "")
    return hashlib.sha256(repr(found).encode()).hexdigest()


def _said(lost: list[str], content: str) -> str:
    return f"told: {'; '.join(lost)}; {content}" if lost else content


_READERS: dict[str, Callable[[Path], str]] = {
    "recording": _recorded,
    "journal": _journal,
    "model": _model,
    "mat": _imported,
    "uff": _imported,
}
