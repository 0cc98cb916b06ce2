"""What values beside others say of them: ``F_unit`` and ``F_gain`` of ``F``, a list ``units`` of the columns of a matrix."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from rig.exchange.file_data import ChannelFacts, Value
from rig.exchange.spellings import UNIT_KEYS, factor_remark, is_time_name, plain
from vibrolock.quantities import quantity, says_a_unit

_NOTHING = ChannelFacts()
_SYSTEMS = ("si", "si units", "mks")  # texts that name a system of units, in small letters
_MATRIX = 2  # dimensions of an array of several channels, at least


def facts_beside(values: Mapping[str, Value]) -> dict[str, ChannelFacts]:
    """Return what the values of a structure, or of groups by their full names, say of the arrays beside them, by name."""
    found: dict[str, ChannelFacts] = {}
    arrays = {
        name: value
        for name, value in values.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and "@" not in name
    }
    for key, value in values.items():
        name = next((name for name in _before(key) if name in arrays), "")
        if not name:
            continue
        about, now = key[len(name) + 1 :], found.get(name, ChannelFacts())
        if plain(about) in UNIT_KEYS:
            found[name] = with_units(now, units_in(value), arrays[name])
        elif remark := factor_remark(about, value, "beside it"):
            found[name] = replace(now, unread="; ".join(filter(None, (now.unread, remark))))
    for group, units in _of_groups(values):
        inside = {name: array for name, array in arrays.items() if name.rpartition("/")[0] == group}
        for name, array in inside.items():
            now = found.get(name, ChannelFacts())
            if now.unit or now.columns or is_time_name(name.rpartition("/")[2]) or not _belong(units, array):
                continue
            found[name] = with_units(now, units, array)
    return {name: facts for name, facts in found.items() if facts != ChannelFacts()}


def merged(*several: Mapping[str, ChannelFacts]) -> dict[str, ChannelFacts]:
    """Return facts by name; a later one holds, what it does not say is that of the earlier ones."""
    found: dict[str, ChannelFacts] = {}
    for facts in several:
        for name, one in facts.items():
            told = {field.name: getattr(one, field.name) for field in fields(one)}
            plain_ones = {field.name: getattr(_NOTHING, field.name) for field in fields(one)}
            changed = {key: value for key, value in told.items() if value != plain_ones[key]}
            before = found.get(name, _NOTHING)
            if ("unit" in changed or "columns" in changed) and (before.unit or before.columns):
                before = replace(before, unit="", columns=())
            found[name] = replace(before, **changed)
    return found


def with_units(facts: ChannelFacts, units: Sequence[str], array: NDArray[np.generic]) -> ChannelFacts:
    """Return facts with the unit of an array, or those of its columns; several that fit neither cannot be followed."""
    if len({*units}) == 1:
        return replace(facts, unit=units[0])
    if array.ndim >= _MATRIX and len(units) in array.shape:
        return replace(facts, columns=units)
    if units:
        told = f"has several units ({', '.join(units)})"
        return replace(facts, unread="; ".join(filter(None, (facts.unread, told))))
    return facts


def units_in(value: Value) -> list[str]:
    """Return the units in a value, texts or one text with commas between units; empty for any other."""
    units = texts_in(value)
    parts = re.split(r"\s*[,;]\s*", units[0]) if len(units) == 1 else []
    return parts if len(parts) > 1 and all(quantity(part) is not None for part in parts) else units


def texts_in(value: Value) -> list[str]:
    """Return the texts in a value, a text or a list or array of nothing else; empty for any other."""
    items = value.reshape(-1).tolist() if isinstance(value, np.ndarray) and value.dtype.kind in "OU" else value
    listed = items if isinstance(items, list) else [items]
    texts = [one.strip() for one in listed if isinstance(one, str)]
    return texts if len(texts) == len(listed) else []


def _of_groups(values: Mapping[str, Value]) -> Iterator[tuple[str, list[str]]]:
    """Yield the units that values or attributes of groups say, by the full names of the groups."""
    for key, value in values.items():
        name, at, attribute = key.rpartition("@")
        group, _, last = (name, "/", attribute) if at else key.rpartition("/")
        units = units_in(value) if plain(last) in UNIT_KEYS and not isinstance(values.get(group), np.ndarray) else []
        if any(says_a_unit(unit) for unit in units) and units[0].lower() not in _SYSTEMS:
            yield group, units


def _belong(units: Sequence[str], array: NDArray[np.generic]) -> bool:
    return len(units) == 1 or (array.ndim >= _MATRIX and len(units) in array.shape)


def _before(key: str) -> list[str]:
    """Return what may be the name of a value of which ``key`` says something: what is before each underscore."""
    return [key[:at] for at, letter in enumerate(key) if letter == "_" and at]
