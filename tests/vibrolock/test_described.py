"""Docstrings under fields as descriptions in the JSON schema, as pydantic itself finds them when asked to."""

from pydantic import BaseModel, ConfigDict

from vibrolock.described import Described


class Inner(Described):
    """Inner."""

    rate_hz: float = 1.0
    """Rate,
    of two lines."""
    plain: int = 0


class Outer(Inner):
    """Outer."""

    inner: Inner = Inner()
    """A table."""
    several: tuple[Inner, ...] = ()
    """Several."""


class InnerOfPydantic(BaseModel):
    """Inner."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    rate_hz: float = 1.0
    """Rate,
    of two lines."""
    plain: int = 0


class OuterOfPydantic(InnerOfPydantic):
    """Outer."""

    inner: InnerOfPydantic = InnerOfPydantic()
    """A table."""
    several: tuple[InnerOfPydantic, ...] = ()
    """Several."""


def descriptions(schema):
    return {name: field.get("description") for name, field in schema["properties"].items()}


def test_descriptions_are_those_of_pydantic():
    ours, theirs = Outer.model_json_schema(), OuterOfPydantic.model_json_schema()
    assert descriptions(ours) == descriptions(theirs)
    assert descriptions(ours)["rate_hz"] == "Rate,\nof two lines."
    assert descriptions(ours["$defs"]["Inner"]) == descriptions(theirs["$defs"]["InnerOfPydantic"])


def test_a_class_made_without_source_has_no_descriptions():
    names = {"__name__": "nowhere"}
    exec(
        'from vibrolock.described import Described\nclass Typed(Described):\n    x: int = 0\n    """Nothing."""\n',
        names,
    )
    assert "description" not in names["Typed"].model_json_schema()["properties"]["x"]  # type: ignore[attr-defined]
