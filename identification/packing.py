"""Convert frozen dataclasses to arrays and JSON-able attributes for storage in files, and back."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from identification.channels import Channel
from identification.errors import IdentificationError

Arrays = Mapping[str, NDArray[Any]]
T = TypeVar("T")


def pack(thing: Any) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return the arrays of a dataclass by field name, and its other fields as attributes: numbers, texts, tuples, channels."""
    arrays: dict[str, NDArray[Any]] = {}
    attributes: dict[str, Any] = {}
    for field in fields(thing):
        value = getattr(thing, field.name)
        if isinstance(value, np.ndarray):
            arrays[field.name] = value
        elif isinstance(value, tuple) and value and isinstance(value[0], Channel):
            attributes[field.name] = [vars(channel) for channel in value]
        else:
            attributes[field.name] = list(value) if isinstance(value, tuple) else value
    return arrays, attributes


def unpack(kind: type[T], arrays: Arrays, attributes: Mapping[str, Any]) -> T:
    """Invert `pack`; raise `IdentificationError` if something is missing or unknown."""
    values: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
    for name, value in attributes.items():
        if name == "channels" and value and isinstance(value[0], Mapping):
            values[name] = tuple(Channel(**channel) for channel in value)
        else:
            values[name] = tuple(value) if isinstance(value, list) else value
    try:
        return kind(**values)
    except TypeError as error:
        raise IdentificationError(f"{kind.__name__}: {error}") from None


def pack_all(name: str, things: tuple[Any, ...]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Pack several dataclasses of one kind, some of which may be None, in numbered groups called ``name``."""
    arrays: dict[str, NDArray[Any]] = {}
    attributes: list[Any] = []
    for index, thing in enumerate(things):
        inside, of_thing = ({}, None) if thing is None else pack(thing)
        arrays |= {f"{name}_{index}/{key}": value for key, value in inside.items()}
        attributes.append(of_thing)
    return arrays, {name: attributes}


def unpack_all(kind: type[T], name: str, arrays: Arrays, attributes: Mapping[str, Any]) -> tuple[T | None, ...]:
    """Invert `pack_all`."""
    if name not in attributes:
        raise IdentificationError(f"{name}: is missing")
    found: list[T | None] = []
    for index, of_thing in enumerate(attributes[name]):
        head = f"{name}_{index}/"
        inside = {key.removeprefix(head): value for key, value in arrays.items() if key.startswith(head)}
        found.append(None if of_thing is None else unpack(kind, inside, of_thing))
    return tuple(found)
