"""Spoilt tables: another number, type, key or shape somewhere in what a TOML or JSON file says."""

from collections.abc import Callable, Iterator
from copy import deepcopy
from random import Random
from typing import Any

Table = dict[str, Any]
Place = tuple[Any, Any]
"""A table or list, and the key or index in it."""

NUMBERS = (
    0, -1, 1, 2**31, 2**63 - 1, -(2**63), 0.0, -0.0, 5e-324, -5e-324, 1e-300, 1e-40, 1e-30, 1e-12, 1e-9, 1e-6, 1e-3,
    1e3, 1e6, 1e9, 1e12, 1e15, 1e29, 1e30, -1e30, 1e31, 1e100, 1e300, -1e300, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
FACTORS = (-1.0, 0.0, 0.1, 0.5, 0.999, 1.001, 2.0, 10.0, 1e3, 1e-3, 1e6, 1e-6)
TEXTS = ("", " ", "\x1b[31mred\x07", "\0", "a" * 5000, "../..", "\u202eabc", "x\ny", "nan", "1", "\ud7ff", "é" * 300)
OTHER_TYPES: tuple[Any, ...] = (
    {},
    [],
    [[]],
    {"a": {}},
    [{}],
    True,
    False,
    0,
    1.5,
    "text",
    [1, "a", {}],
    [1.0, 2.0, 3.0],
)
MOST_CHARACTERS = 1_500_000
HUGE_LENGTHS = (101, 9_000, 20_000, 60_000)


def number_replaced(table: Table, random: Random) -> None:
    """A number is an extreme one."""
    _set(random, _places(table, int | float), lambda old: random.choice(NUMBERS))


def number_scaled(table: Table, random: Random) -> None:
    """A number is a multiple of itself; a whole one stays whole half of the time."""

    def scaled(old: float) -> float:
        new = old * random.choice(FACTORS)
        return int(new) if isinstance(old, int) and random.random() < 0.5 else new

    _set(random, _places(table, int | float), scaled)


def number_of_another_size(table: Table, random: Random) -> None:
    """A number is larger or smaller by up to twelve decades: what bounds let through has to be computed with."""
    _set(random, _places(table, float), lambda old: float(f"{old * 10.0 ** random.uniform(-12.0, 12.0):.3g}"))


def text_replaced(table: Table, random: Random) -> None:
    """A text is another, with control characters, very long, or empty."""
    _set(random, _places(table, str), lambda old: random.choice(TEXTS))


def type_swapped(table: Table, random: Random) -> None:
    """Anything is of another type: a table for a number, a text for a list."""
    _set(random, _places(table, object), lambda old: deepcopy(random.choice(OTHER_TYPES)))


def key_deleted(table: Table, random: Random) -> None:
    """A key or an item is missing."""
    inside, key = random.choice(list(_places(table, object)))
    del inside[key]


def key_renamed(table: Table, random: Random) -> None:
    """A key is written otherwise: one letter more, as a control character, very long."""
    inside, key = random.choice([place for place in _places(table, object) if isinstance(place[0], dict)])
    inside[random.choice((f"{key}x", key.upper(), f"{key}\x1b[2J", key * 500, "", "kind", "name"))] = inside.pop(key)


def tables_swapped(table: Table, random: Random) -> None:
    """Two values have changed places."""
    places = list(_places(table, object))
    (one, a), (other, b) = random.choice(places), random.choice(places)
    one[a], other[b] = deepcopy(other[b]), deepcopy(one[a])


def nested_deeply(table: Table, random: Random) -> None:
    """A value stands in many lists or tables."""
    depth, as_table = random.choice((5, 20, 90)), random.random() < 0.5

    def nested(old: Any) -> Any:
        for _ in range(depth):
            old = {"a": old} if as_table else [old]
        return old

    _set(random, _places(table, object), nested)


def list_huge(table: Table, random: Random) -> None:
    """A list, or what was none, has very many items: the same, or all different."""
    length, same = random.choice(HUGE_LENGTHS), random.random() < 0.3

    def huge(old: Any) -> Any:
        item = old[0] if isinstance(old, list) and old else old
        if isinstance(item, bool) or not isinstance(item, int | float):
            few = min(length, 9_000, max(2, MOST_CHARACTERS // len(repr(item))))  # it may be huge already
            return [deepcopy(item) for _ in range(few)]
        return [item if same else item * (1.0 + n / length) for n in range(length)]

    lists = list(_places(table, list))
    _set(random, iter(lists) if lists and random.random() < 0.8 else _places(table, object), huge)


TABLE_MUTATIONS: tuple[Callable[[Table, Random], None], ...] = (
    number_replaced,
    number_scaled,
    number_of_another_size,
    number_of_another_size,
    text_replaced,
    type_swapped,
    key_deleted,
    key_renamed,
    tables_swapped,
    nested_deeply,
    list_huge,
)
"""Each changes a table in place."""


def _places(inside: Any, kind: Any) -> Iterator[Place]:
    """Where values of a kind stand; truth values are no numbers here."""
    items = list(inside.items()) if isinstance(inside, dict) else list(enumerate(inside))
    for key, value in items:
        if isinstance(value, kind) and not (kind == int | float and isinstance(value, bool)):
            yield inside, key
        if isinstance(value, dict | list):
            yield from _places(value, kind)


def _set(random: Random, places: Iterator[Place], change: Callable[[Any], Any]) -> None:
    found = list(places)
    if found:
        inside, key = random.choice(found)
        inside[key] = change(inside[key])
