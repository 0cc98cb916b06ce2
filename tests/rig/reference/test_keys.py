"""Keys as the reference shows them: default, allowed values, meaning, and the tables that they hold."""

from typing import Literal

import pytest
from pydantic import BaseModel, Field

from rig.reference import keys
from rig.reference.keys import key_entries, keys_of, tables
from vibrolock.described import Described


class Inner(Described):
    """A table in a table."""

    at: float
    """Where."""


class Outer(Described):
    """A table of every type."""

    name: str
    """Required text."""
    count: int = Field(1_000_000, ge=4, le=1_000_000)
    """A number
    of two lines."""
    ratio: float = Field(2.5, gt=0, lt=1)
    """Open at both ends."""
    kind: Literal["outer"] = "outer"
    """Always given."""
    way: Literal["up", "down"] = "up"
    """One of two."""
    on: bool = False
    """Either."""
    window_hz: tuple[float, float] | None = None
    """Two numbers."""
    levels: tuple[float, ...] = ()
    """Any number of them."""
    inner: Inner | None = None
    """One table."""
    many: tuple[Inner, ...] = ()
    """Several tables."""


@pytest.fixture
def shown(monkeypatch):
    """Keys of `Outer` by name."""
    known: dict[str, type[BaseModel]] = {"outer": Outer, "inner": Inner}
    monkeypatch.setattr(keys, "tables", lambda: known)
    return {key.name: key for key in keys_of.__wrapped__("outer")}


@pytest.mark.parametrize(
    ("name", "default", "allowed"),
    [
        ("kind", "required", "`outer`"),
        ("name", "required", "text"),
        ("count", "`1000000`", "4 to 1000000"),
        ("ratio", "`2.5`", "above 0 to below 1"),
        ("way", "`up`", "`up`, `down`"),
        ("on", "`false`", "true, false"),
        ("window_hz", "", "list of 2: number"),
        ("levels", "", "list: number"),
        ("inner", "", "table"),
        ("many", "", "list of tables"),
    ],
)
def test_default_and_allowed_values_are_those_of_the_model(shown, name, default, allowed):
    assert (shown[name].default, shown[name].allowed) == (default, allowed)


def test_the_key_that_tells_the_kind_comes_first_and_meanings_are_one_line(shown):
    assert next(iter(shown)) == "kind"
    assert shown["count"].meaning == "A number of two lines."
    assert shown["inner"].holds == shown["many"].holds == ("inner",)
    assert shown["name"].anchor == "key-outer-name"


def test_a_default_is_one_that_the_model_takes():
    """What the page shows for `[settle]`, read back by the model that it was made from."""
    given = {key.name: float(key.default.strip("`")) for key in keys_of("settle")}
    assert tables()["settle"](**given) == tables()["settle"]()


def test_a_word_means_the_table_and_not_the_key_that_holds_it():
    found = [entry for entry in key_entries() if "settle" in entry.words]
    assert [entry.what for entry in found] == ["table"]


def test_a_key_is_found_by_the_other_name_that_it_may_have_in_a_file():
    assert "stepped-sine.controller" in {entry.title for entry in key_entries() if "demodulation" in entry.words}
