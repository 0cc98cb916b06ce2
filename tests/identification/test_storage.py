"""The codec of results: whatever a dataclass holds comes back, and what does not fit is named with its place."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import ClassVar, NamedTuple

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from identification import Channel, IdentificationError
from identification.storage import decode, encode, stored
from tests.flattened import flattened
from tests.refused import refused


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


class Pair(NamedTuple):
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Inner:
    values: np.ndarray
    name: str = ""
    limit: float | None = None


@dataclass(frozen=True, eq=False)
class Whole:
    table: np.ndarray
    inner: Inner
    many: tuple[Inner, ...]
    gaps: tuple[Inner | None, ...]
    channels: tuple[Channel, ...]
    colour: Colour
    pair: Pair
    rows: tuple[tuple[float, ...], ...]
    other: Inner | None = None
    further: np.ndarray | None = None
    uses: Mapping[str, str] = field(default_factory=dict)
    parts: Mapping[str, Inner] = field(default_factory=dict)


def whole(table: np.ndarray) -> Whole:
    inner = Inner(np.array([True, False]), "a", 0.5)
    return Whole(
        table=table,
        inner=inner,
        many=(inner, Inner(np.arange(3), "b")),
        gaps=(None, inner),
        channels=(Channel("force", "force", "N"),),
        colour=Colour.BLUE,
        pair=Pair(0.25, float("inf")),
        rows=((1.0, 2.0), (3.0, 4.0)),
        uses={"x": "training"},
        parts={"first": inner},
    )


def passed(thing):
    """The thing after it has been in a file, whose attributes are JSON."""
    held, told = encode(thing)
    return decode(type(thing), held, json.loads(json.dumps(told)))


TABLES = st.sampled_from([np.float64, np.int64, np.complex128, np.bool_]).flatmap(
    lambda kind: arrays(kind, array_shapes(min_side=0, max_dims=3, max_side=3))
)


@given(TABLES)
def test_everything_comes_back(table):
    sent = whole(table)
    found = passed(sent)
    assert json.dumps(list(flattened(found)), default=str) == json.dumps(list(flattened(sent)), default=str)
    assert found.table.dtype == table.dtype
    assert (found.colour, found.pair) == (Colour.BLUE, sent.pair)


def test_a_field_that_a_file_lacks_takes_its_default_and_others_are_named():
    held, told = encode(whole(np.zeros(2)))
    older = {key: value for key, value in told.items() if key not in ("uses", "parts")}
    assert decode(Whole, held, older).uses == {}
    for change, said in (
        ({"colour": "green"}, {"says": "colour-is-green-which-does-not", "where": "whole"}),
        ({"channels": 3}, {"says": "channels-is-which-does-not-fit", "where": "whole"}),
        ({"later": 1}, {"says": "later-is-missing-or-unknown", "where": "whole"}),
        ({"many": [{"name": 5}]}, {"says": "name-is-which-does-not-fit", "where": "inner many_0"}),
        (
            {"inner": 3},
            {"says": "is-allowed-a-mapping-of-fields", "allowed": "a mapping of fields", "where": "inner inner"},
        ),
    ):
        with refused(IdentificationError, **said):
            decode(Whole, held, {**told, **change})
    with refused(IdentificationError, "table-is-missing", where="whole"):
        decode(Whole, {key: value for key, value in held.items() if key != "table"}, told)
    with refused(IdentificationError, "values-is-missing", where="inner inner"):
        decode(Whole, {key: value for key, value in held.items() if key != "inner/values"}, told)


@stored(kinds=lambda: {"square": Square})
@dataclass(frozen=True)
class Shape:
    kind: ClassVar[str]


@dataclass(frozen=True)
class Square(Shape):
    kind = "square"
    side: float


def _named(held, told):
    if "numbers" in held:
        told["first"], told["second"] = held.pop("numbers").tolist()


@stored(inline=("path",), as_arrays=("first",), groups={"shapes": "shape"}, upgrade=_named, shared={"second": "copy"})
@dataclass(frozen=True, eq=False)
class Declared:
    path: np.ndarray
    shapes: tuple[Shape, ...]
    first: float
    second: float
    copy: "Declared | None" = None


def test_a_type_declares_where_its_layout_differs():
    sent = Declared(np.array([1.0, 2.0]), (Square(3.0),), 0.5, 0.25)
    held, told = encode(sent)
    assert set(held) == {"first"}
    assert told == {"path": [1.0, 2.0], "shapes": [{"kind": "square", "side": 3.0}], "second": 0.25}
    assert passed(sent).shapes == sent.shapes
    earlier = {key: value for key, value in told.items() if key != "second"}
    assert decode(Declared, {"numbers": np.array([0.5, 0.25])}, earlier).second == 0.25
    both = replace(sent, copy=sent)
    assert "second" not in encode(both).attributes
    assert passed(both).second == 0.25
    with refused(IdentificationError, where="shape", field="kind", value="circle", allowed="square"):
        decode(Declared, held, {**told, "shapes": [{"kind": "circle"}]})
