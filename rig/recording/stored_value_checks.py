"""Values that a part of a recording tells: refused where a file is opened, so that whatever reads them can rely on them.

What the fields of points mean is checked where points are read (`rig.campaigns.evaluation.stored_point`).
"""

from collections.abc import Iterator, Mapping

from rig.errors import RecordingError
from rig.recording.parts import Part

LARGEST_NUMBER = 1e100
"""A finite number beyond it is no measurement; its square could be no number any more."""
_LARGEST_INTEGER = 2**63  # what a signed integer of 8 bytes cannot hold
_DEEPEST = 32  # levels of nested values; chosen: ours have five
_COUNTS = ("number", "sample", "row", "stride", "first_sample", "end_sample")
_TEXTS = ("what", "text", "reason", "quality", "level_unit")
_TRUTHS = ("accepted", "tripped", "completed")


def check_stored_values(part: Part, where: str) -> None:
    """Check points, events, information and end of a part.

    Raises:
        RecordingError: it names the value and what is allowed, after ``where``.
    """
    tables: dict[str, Mapping[str, object]] = {
        "information": part.information,
        "end": part.end or {},
        **{f"points[{number}]": point for number, point in enumerate(part.points)},
        **{f"events[{number}]": event for number, event in enumerate(part.events)},
    }
    for name, table in tables.items():
        for key, value, allowed in _faults(table, name):
            raise RecordingError(where=where, field=key, value=value, allowed=allowed)
    for number, event in enumerate(part.events):
        where_it_is = [event.get(key) for key in ("row", "sample", "stride")]
        if event.get("what") == "telemetry" and None in where_it_is:
            raise RecordingError(
                where=where, field=f"events[{number}]", allowed="an event telemetry with row, sample and stride"
            )


def _faults(table: Mapping[str, object], name: str) -> Iterator[tuple[str, object, str]]:
    """Yield key, value and what is allowed for each value that is not allowed."""
    for key in _COUNTS:
        least = int(key == "stride")
        if (value := table.get(key)) is not None and (type(value) is not int or not least <= value < _LARGEST_INTEGER):
            yield f"{name}.{key}", value, f"a whole number from {least}"
    for key in _TEXTS:
        if not isinstance(value := table.get(key), str | None):
            yield f"{name}.{key}", value, "a text"
    for key in _TRUTHS:
        if not isinstance(value := table.get(key), bool | None):
            yield f"{name}.{key}", value, "true or false"
    yield from _too_large(table, name, 0)


def _too_large(value: object, name: str, depth: int) -> Iterator[tuple[str, object, str]]:
    if isinstance(value, float | int):
        if LARGEST_NUMBER < abs(value) < float("inf"):
            yield name, value, f"a number up to {LARGEST_NUMBER:g}"
    elif isinstance(value, dict | list):
        if depth > _DEEPEST:
            yield name, "...", f"a value of up to {_DEEPEST} levels"
            return
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            if item.__class__ is float and -LARGEST_NUMBER <= item <= LARGEST_NUMBER:
                continue  # nearly all of them
            yield from _too_large(item, f"{name}.{key}" if isinstance(value, dict) else f"{name}[{key}]", depth + 1)
