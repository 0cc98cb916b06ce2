"""Store results: dataclasses to arrays by name and JSON attributes, and back. Every stored type passes here.

``encode(result)`` returns arrays and attributes; ``decode(Kind, arrays, attributes)`` builds the result again from its type
hints. A kind of file needs no code of its own: ``pack=encode``, ``unpack=partial(decode, Kind)``.

Layout, by what a field holds:

==================================  =========================================================================
array                               the array ``field``
number, text, tuple, enum, mapping  the attribute ``field``, as JSON has it
dataclass                           arrays ``field/...``, and its other fields as the attribute ``field``
tuple of dataclasses or arrays      arrays ``field_0/...``, ``field_1/...``; the attribute ``field``, a list
None                                no array; the attribute is left out if None is the default
==================================  =========================================================================

A field that a file lacks takes its default, so a new field with a default needs nothing to read older files. Where a type is
stored otherwise, or was in earlier files, it declares a `Layout` by ``@stored(...)``.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError

Arrays = Mapping[str, NDArray[Any]]
Attributes = Mapping[str, Any]
T = TypeVar("T")

_Owner = tuple[type, str]
"""Type of the dataclass that has a field, and its path, for messages."""
_ABSENT = object()
"""Stands for an attribute that a file lacks."""


class Stored(NamedTuple):
    """What a file holds of a result."""

    arrays: dict[str, NDArray[Any]]
    attributes: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a type is stored where it departs from the rules of the module."""

    inline: tuple[str, ...] = ()
    """Array fields that are stored as lists among the attributes."""
    as_arrays: tuple[str, ...] = ()
    """Number fields that are stored as arrays."""
    groups: Mapping[str, str] = field(default_factory=dict)
    """Names of numbered groups by field, where they differ from the field's."""
    shared: Mapping[str, str] = field(default_factory=dict)
    """Fields by the part that also has them: not stored while that part is not None."""
    kinds: Callable[[], Mapping[str, type]] | None = None
    """Concrete types of an abstract one, by the text in their class attribute ``kind``."""
    upgrade: Callable[[dict[str, NDArray[Any]], dict[str, Any]], None] | None = None
    """Changes arrays and attributes of earlier files, in place, to those of today."""


_PLAIN = Layout()
"""Layout of a type that declares none."""


def stored(**layout: Any) -> Callable[[type[T]], type[T]]:
    """Declare the `Layout` of a dataclass and of those that inherit from it."""

    def declare(kind: type[T]) -> type[T]:
        kind._layout = Layout(**layout)  # type: ignore[attr-defined]
        return kind

    return declare


def encode(result: Any) -> Stored:
    """Return arrays and JSON attributes of a dataclass."""
    layout: Layout = getattr(type(result), "_layout", _PLAIN)
    found = Stored({}, {} if layout.kinds is None else {"kind": result.kind})
    for one in _fields(type(result)):
        name, value = one.name, getattr(result, one.name)
        shared = layout.shared.get(name)
        if (value is None and one.default is None) or (shared and getattr(result, shared) is not None):
            continue
        if name in layout.inline:
            value = np.asarray(value).tolist()
        elif name in layout.as_arrays:
            value = np.asarray(value)
        attribute = _encoded(value, name, layout.groups.get(name, name), found.arrays)
        if attribute is not _ABSENT:
            found.attributes[name] = attribute
    return found


def decode(kind: type[T], arrays: Arrays, attributes: Attributes, where: str = "") -> T:
    """Return the result of a type whose arrays and attributes `encode` returned.

    ``where``: path of the result in a larger one, for messages, such as ``model/``. Raises `IdentificationError` if a field is
    missing, unknown or ill-shaped.
    """
    layout: Layout = getattr(kind, "_layout", _PLAIN)
    if not isinstance(attributes, Mapping):
        raise IdentificationError(f"is {attributes!r:.60}", where=_label(kind, where), allowed="a mapping of fields")
    held, told = dict(arrays), dict(attributes)
    if layout.kinds is not None:
        kinds, named = layout.kinds(), told.pop("kind", None)
        if named not in kinds:
            raise IdentificationError(where=_label(kind), field="kind", value=named, allowed=kinds)
        kind = kinds[named]
    if layout.upgrade is not None:
        with _fitting(kind):
            layout.upgrade(held, told)
    hints, known = get_type_hints(kind), _fields(kind)
    if unknown := next((name for name in told if name not in {one.name for one in known}), None):
        raise IdentificationError(f"{unknown!r} is missing or unknown", where=_label(kind, where))
    values: dict[str, Any] = {}
    for one in known:
        name = one.name
        group = layout.groups.get(name, name)
        found = _decoded(hints[name], name, group, held, told.get(name, _ABSENT), (kind, where))
        if found is not _ABSENT:
            values[name] = found
    for name, part in layout.shared.items():
        if values.get(part) is not None:
            values[name] = getattr(values[part], name)
    for one in known:
        if one.name not in values and one.default is MISSING and one.default_factory is MISSING:
            raise IdentificationError(f"{one.name!r} is missing or unknown", where=_label(kind, where))
    with _fitting(kind):
        return kind(**values)


@contextmanager
def _fitting(kind: type) -> Iterator[None]:
    try:
        yield
    except IdentificationError:
        raise
    except (TypeError, ValueError, AttributeError, LookupError) as error:
        raise IdentificationError(f"does not fit ({error})", where=_label(kind)) from None


def _encoded(value: Any, name: str, group: str, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return _ABSENT
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value):
        inside = encode(value)
        arrays.update({f"{group}/{key}": array for key, array in inside.arrays.items()})
        return inside.attributes
    if isinstance(value, Mapping):
        items = {key: _encoded(item, f"{name}/{key}", f"{group}/{key}", arrays) for key, item in value.items()}
        return {key: None if item is _ABSENT else item for key, item in items.items()}
    if isinstance(value, (tuple, list)):
        listed = [_encoded(item, f"{group}_{i}", f"{group}_{i}", arrays) for i, item in enumerate(value)]
        return [None if item is _ABSENT else item for item in listed]
    return value


def _decoded(hint: Any, name: str, group: str, arrays: Arrays, attribute: Any, owner: _Owner) -> Any:
    """Return the value of a field; `_ABSENT` if the file does not have it."""
    options = [option for option in get_args(hint) if option is not NoneType] if _is_union(hint) else [hint]
    optional = _is_union(hint) and NoneType in get_args(hint)
    if not _structured(hint):
        if name in arrays:
            attribute = np.asarray(arrays[name]).tolist()
        return attribute if attribute is _ABSENT else _plain(hint, attribute, name, owner)
    hint = options[0]
    if _is_array(hint):
        missing = attribute is _ABSENT or (attribute is None and optional)
        return np.asarray(arrays[name]) if name in arrays else attribute if missing else np.asarray(attribute)
    if get_origin(hint) is not None:
        return _several(hint, name, group, arrays, attribute, owner)
    if optional and isinstance(attribute, list):  # earlier files: none or one in a list
        return decode(hint, _inside(arrays, f"{group}_0"), attribute[0], f"{owner[1]}{group}_0/") if attribute else None
    inside = _inside(arrays, group)
    if attribute is None and optional:
        return None
    if attribute is _ABSENT and not inside:
        return _ABSENT
    return decode(hint, inside, {} if attribute is _ABSENT else attribute, f"{owner[1]}{group}/")


def _several(hint: Any, name: str, group: str, arrays: Arrays, attribute: Any, owner: _Owner) -> Any:
    if attribute is _ABSENT:
        return attribute
    inner = get_args(hint)
    if issubclass(get_origin(hint), Mapping):
        if not isinstance(attribute, Mapping):
            raise _misfit(owner, name, attribute)
        heads = {key: f"{group}/{key}" for key in attribute}
        return {key: _decoded(inner[1], heads[key], heads[key], arrays, attribute[key], owner) for key in attribute}
    if not isinstance(attribute, (list, tuple)):
        raise _misfit(owner, name, attribute)
    return tuple(
        _decoded(inner[0], f"{group}_{i}", f"{group}_{i}", arrays, item, owner) for i, item in enumerate(attribute)
    )


def _plain(hint: Any, value: Any, name: str, owner: _Owner) -> Any:
    """Return numbers, texts, tuples and enums as the field's type has them."""
    from pydantic import ValidationError  # only on use: it takes long to load

    try:
        return _adapter(hint).validate_python(value)
    except ValidationError:
        raise _misfit(owner, name, value) from None


def _misfit(owner: _Owner, name: str, value: Any) -> IdentificationError:
    return IdentificationError(f"{name} is {value!r}, which does not fit", where=_label(*owner))


def _label(kind: type, where: str = "") -> str:
    """Return the name of a class as words, and the path of the object that is of it."""
    words = "".join(f" {letter}" if letter.isupper() else letter for letter in kind.__name__).split()
    return " ".join(
        ["PNLSS" if word == "Pnlss" else word.lower() for word in words] + [where.rstrip("/")] * bool(where)
    )


def _inside(arrays: Arrays, group: str) -> dict[str, NDArray[Any]]:
    head = f"{group}/"
    return {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}


def _fields(kind: type) -> tuple[Field[Any], ...]:
    return tuple(one for one in fields(kind) if one.init)


@cache
def _adapter(hint: Any) -> Any:
    from pydantic import TypeAdapter  # only on use: it takes long to load

    return TypeAdapter(hint)


def _is_union(hint: Any) -> bool:
    return get_origin(hint) in (Union, UnionType)


def _is_array(hint: Any) -> bool:
    return hint is np.ndarray or get_origin(hint) is np.ndarray


def _structured(hint: Any) -> bool:
    """Return whether values of a type are, or contain, dataclasses or arrays."""
    return _is_array(hint) or is_dataclass(hint) or any(map(_structured, get_args(hint)))
