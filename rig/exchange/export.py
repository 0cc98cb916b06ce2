"""Writing what a file of ours holds for other programs."""

from pathlib import Path

from identification import IdentificationError
from rig.errors import RecordingError, RigError
from rig.exchange.csv import write_csv
from rig.exchange.kinds import taken_apart
from rig.exchange.mat import write_mat
from rig.exchange.sources import read_objects
from rig.exchange.uff.writing import write_uff
from rig.measurements.contents import Contents
from rig.system.whole_file import whole_file

__all__ = ["export_file", "write_contents"]

_WRITERS = {"mat": write_mat, "uff": write_uff, "csv": write_csv}


def export_file(
    source: Path, output: Path, format_: str, *, data: str = "results", points: tuple[int, ...] = (), item: int = 0
) -> list[Contents]:
    """Write the objects in ``source`` (see `read_objects`), or one of them by its number from 1, in another format.

    Returns what was written. Raises `RecordingError` where it cannot be read or written; ``output`` is then as it was.
    """
    try:
        found = [taken_apart(value) for value in read_objects(source, data, points)]
    except IdentificationError as error:
        raise RecordingError(f"{source}: {error}") from None
    if item and not 1 <= item <= len(found):
        raise RecordingError(f"`item` = {item}: {source} holds 1 to {len(found)}")
    chosen = [found[item - 1]] if item else found
    loose = next((one for one in chosen if not one.rows), None)
    if loose is not None and format_ != "mat":
        raise RecordingError(
            f"{source}: {loose.kind} is matrices and no table, for which {format_} has no place; use mat"
        )
    write_contents(chosen, output, format_)
    return chosen


def write_contents(items: list[Contents], output: Path, format_: str) -> None:
    """Write contents in a format, whole or not at all."""
    with whole_file(output) as part:
        try:
            _WRITERS[format_](items, part)
        except RigError as error:
            raise type(error)(f"{output}: {error}") from None
