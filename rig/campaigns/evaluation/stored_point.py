"""JSON form of a point in journals and HDF5 files: one table whose keys are the names of fields.

The fields of a point's parts are stored among the keys of the point. A part is present if the key of its first field is.
Unknown keys are ignored. Keys of parts that are missing, as in files of earlier versions, are read as None.
"""

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, cast, get_args, get_origin, get_type_hints, overload

import numpy as np
from numpy.typing import ArrayLike

from rig.campaigns.evaluation.point import ARRAY, PAIRS, PART, Point, Quality
from rig.errors import RecordingError
from rig.text.json_values import JsonValue
from vibrolock.printable import shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Kind: TypeAlias = type["DataclassInstance"]
Result = TypeVar("Result")


def as_pairs(values: np.ndarray) -> JsonValue:
    """Return complex numbers as [real, imaginary]."""
    pairs: JsonValue = np.stack([values.real, values.imag], axis=-1).tolist()
    return pairs


def as_complex(pairs: ArrayLike) -> np.ndarray:
    """Return the complex array for the output of `as_pairs`."""
    array = np.asarray(pairs, float)
    return np.asarray(array[..., 0] + 1j * array[..., 1])


FORMER = {"alien_force": "nonharmonic_force"}
"""Keys of earlier versions, with their names of today."""


def stored(point: Point[object]) -> dict[str, JsonValue]:
    """Return the JSON form of a point."""
    return {**_table(point), "accepted": point.accepted}


def _table(value: "DataclassInstance") -> dict[str, JsonValue]:
    out: dict[str, JsonValue] = {}
    for one in fields(value):
        content = getattr(value, one.name)
        if one.metadata == PART:
            out |= {} if content is None else _table(content)
        elif one.default is MISSING or (content is not None if one.default is None else content != one.default):
            out[one.name] = _plain(content)
    return out


def _plain(value: object) -> JsonValue:
    if isinstance(value, np.ndarray):
        return as_pairs(value) if np.iscomplexobj(value) else cast(JsonValue, value.tolist())
    if isinstance(value, Quality):
        return str(value)
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return _table(value) if is_dataclass(value) and not isinstance(value, type) else cast(JsonValue, value)


@overload
def point_from(table: Mapping[str, object]) -> Point[object]: ...
@overload
def point_from(table: Mapping[str, object], result: type[Result]) -> Point[Result]: ...


def point_from(table: Mapping[str, object], result: type[object] | None = None) -> Point[object]:
    """Return a point from its JSON form.

    ``result`` is the class of the results that only its kind of campaign has; if None, the point has no such results. Raises
    RecordingError if a key is missing that points of all versions have, or a value is of another type.
    """
    table = {FORMER.get(key, key): value for key, value in table.items()}
    try:
        point: Point[object] = _read(Point, {**table, "quality": _quality(table)}, cast("Kind | None", result))
    except KeyError as error:
        raise RecordingError(f"a point's {error.args[0]}: is missing") from None
    return point


def _quality(table: Mapping[str, object]) -> Quality:
    """Return the quality stored in a file. Files of earlier versions have only ``accepted``."""
    accepted, told = bool(table["accepted"]), str(table.get("quality"))
    if told in set(Quality) and Quality(told).accepted is accepted:
        return Quality(told)
    return Quality.REJECTED if not accepted else Quality.WARNED if table.get("warnings") else Quality.GOOD


def _read(kind: Kind, table: Mapping[str, object], result: Kind | None = None) -> Any:
    found: dict[str, object] = {}
    for one, inner, optional in _layout(kind):
        inner = result if inner is None and one.metadata == PART else inner
        if one.metadata == PART:
            there = inner is not None and _first_key(inner) in table
            if there or not optional:
                found[one.name] = _read(inner, table) if inner is not None else None
            continue
        if one.name not in table:
            if one.default is MISSING:
                found[one.name] = table[one.name] if kind is Point and not optional else None
            continue
        found[one.name] = _value(one, inner, table[one.name])
    return kind(**found)


def _value(one: Field[object], inner: Kind | None, stored_value: object) -> object:
    """Return the value of a field from its JSON form; raise RecordingError for one of another type."""
    value = stored_value
    try:
        if one.name == "quality":
            return Quality(str(value)) if value in set(Quality) else Quality.REJECTED
        if value is not None and one.metadata == PAIRS:
            return as_complex(cast(ArrayLike, value))
        if value is not None and one.metadata == ARRAY:
            return np.asarray(cast(ArrayLike, value), float)
        if isinstance(value, list):
            value = tuple(_read(inner, item) for item in value) if inner is not None else _tuples(value)
        elif isinstance(value, Mapping) and inner is not None:
            value = _read(inner, value)
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError):
        fits = False
    else:
        fits = value is None or _fits(value, one.type)
    if not fits:
        raise RecordingError(f"a point's {one.name} = {shown(stored_value)}: is not what a recording holds there")
    return value


def _fits(value: object, hint: object) -> bool:
    options = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return any(_is(value, option) for option in options)


def _is(value: object, kind: object) -> bool:
    if kind in (float, int):
        return isinstance(value, float | int) and not isinstance(value, bool)
    if kind in (bool, str, NoneType):
        return isinstance(value, cast(type, kind))
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if get_origin(kind) is tuple:
        inside = get_args(kind)
        if not isinstance(value, tuple) or (inside[-1] is not Ellipsis and len(value) != len(inside)):
            return False
        kinds = inside[:1] * len(value) if inside[-1] is Ellipsis else inside
        return all(item is None or _fits(item, one) for item, one in zip(value, kinds, strict=True))
    return True


def _first_key(kind: Kind) -> str:
    """Return the key of the first field of a part. If this key is present, so is the part."""
    one, inner, _ = _layout(kind)[0]
    return _first_key(inner) if one.metadata == PART and inner is not None else one.name


def _tuples(value: object) -> object:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@cache
def _layout(kind: Kind) -> tuple[tuple[Field[object], Kind | None, bool], ...]:
    """Return for each field: the field, the dataclass that it holds (None: another type), and whether it may be None."""
    hints = get_type_hints(kind)
    out = []
    for one in fields(kind):
        options = get_args(hints[one.name]) or (hints[one.name],)
        inner = next((option for option in options if isinstance(option, type) and is_dataclass(option)), None)
        out.append((one, inner, NoneType in options))
    return tuple(out)


def value_of(point: Point[object], name: str) -> Any:
    """Return the value of a named field of a point or of one of its parts; None if the part is missing."""
    return next((getattr(part, name) for part in _parts(point) if name in _own_names(type(part))), None)


def _parts(value: "DataclassInstance") -> "Iterator[DataclassInstance]":
    yield value
    for one in fields(value):
        if one.metadata == PART and (part := getattr(value, one.name)) is not None:
            yield from _parts(part)


@cache
def _own_names(kind: Kind) -> frozenset[str]:
    return frozenset(one.name for one in fields(kind) if one.metadata != PART)
