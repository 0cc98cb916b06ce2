"""The parts that a virtual rig is built from, as `rig list` shows them, generated from the models' schemas."""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from pydantic.json_schema import JsonSchemaValue as Schema

from rig.errors import ConfigurationError
from rig.text.json_values import JsonValue
from simulators import VirtualRig
from vibrolock.units import unit_of

_TYPES = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "null": "none"}
_BOUNDS = {"exclusiveMinimum": "above", "minimum": "from", "exclusiveMaximum": "below", "maximum": "to"}
_FEW = 4
"""Most words of a key that are listed as its choices; chosen to fit in a line."""


class Part(NamedTuple):
    """A part of a virtual rig."""

    group: str
    """Key of the rig's table that holds it."""
    name: str
    description: str
    choices: dict[str, list[str]]
    """Words that its keys may take, where they are few."""


class Key(NamedTuple):
    """A key of a part."""

    key: str
    """Name, with those of the tables in which it stands (``shape[].at``)."""
    type: str
    unit: str
    required: bool
    default: JsonValue
    description: str


class PartKeys(NamedTuple):
    """A part in full."""

    group: str
    name: str
    description: str
    keys: list[Key]


def specimens() -> list[dict[str, str]]:
    """The shipped specimens: name, kind of structure and local elements."""
    from simulators import shipped_specimens
    from simulators.parts import specimen_table

    rows = []
    for name in shipped_specimens():
        table = specimen_table(name)
        has = [str(part["kind"]) for key in ("elements", "friction") for part in table.get(key, ())]
        local = ", ".join(f"{has.count(kind)} {kind}" for kind in dict.fromkeys(has))
        rows.append({"name": name, "description": f"{table['structure']['kind']}; {local or 'linear'}"})
    return rows


def parts() -> list[Part]:
    """Every part: its group in the rig's table, its name, its first line, and the choices it offers."""
    out = []
    for group, name, schema in _named_parts():
        words = {key: _words(field) for key, field in schema["properties"].items()}
        choices = {key: few for key, few in words.items() if 0 < len(few) <= _FEW and name not in few}
        first_line = _plain(str(schema.get("description", "")).partition("\n\n")[0])
        out.append(Part(group, name, first_line, choices))
    return out


def part_keys(name: str) -> PartKeys:
    """A part in full: its description and its keys with type, unit, default and description.

    Raises `ConfigurationError` for a name that no part has.
    """
    for group, known, schema in _named_parts():
        if known == name:
            return PartKeys(group, name, str(schema.get("description", "")), list(_keys(schema)))
    allowed = ", ".join(known for _, known, _ in _named_parts())
    raise ConfigurationError("there is no such part", field="part", value=name, allowed=allowed)


@cache
def _schema() -> Schema:
    return VirtualRig.model_json_schema()


def _named_parts() -> Iterator[tuple[str, str, Schema]]:
    for group, field in _schema()["properties"].items():
        several = field.get("items", field)
        kinds = several.get("discriminator", {}).get("mapping")
        if kinds:
            listed = {variant["$ref"]: number for number, variant in enumerate(several["oneOf"])}
            for kind in sorted(kinds, key=lambda kind: listed[kinds[kind]]):
                yield group, kind, _resolved(kinds[kind])
        elif "$ref" in several:
            yield group, group.removesuffix("s") if "items" in field else group, _resolved(several["$ref"])


def _resolved(reference: str) -> Schema:
    return dict(_schema()["$defs"][reference.rpartition("/")[2]])


def _plain(text: str) -> str:
    return " ".join(text.replace("``", "").replace("`", "").split())


def _words(field: Schema) -> list[str]:
    return [str(word) for word in field.get("enum", [field["const"]] if "const" in field else [])]


def _keys(schema: Schema, path: str = "") -> Iterator[Key]:
    """All keys of a part, and those of the parts inside it under ``path[].key``."""
    required = schema.get("required", [])
    for key, field in sorted(schema["properties"].items(), key=lambda item: item[0] != "kind"):
        inner = field.get("items", field)
        description = _plain(str(field.get("description", "")))
        yield Key(path + key, _type(field), unit_of(key), key in required, field.get("default"), description)
        if "$ref" in inner:
            yield from _keys(_resolved(inner["$ref"]), f"{path}{key}{'[]' if 'items' in field else ''}.")


def _type(field: Schema) -> str:
    if words := _words(field):
        return " | ".join(words)
    if "anyOf" in field:
        return " or ".join(_type(one) for one in field["anyOf"])
    if "$ref" in field:
        return "table"
    kind = field.get("type")
    if kind == "array":
        return f"list of {_type(field['items'])}"
    if kind == "object":
        inside = field.get("additionalProperties")
        return f"table of name = {_type(inside)}" if isinstance(inside, dict) else "table"
    bounds = " ".join(f"{word} {field[bound]:g}" for bound, word in _BOUNDS.items() if bound in field)
    return f"{_TYPES.get(str(kind), 'value')} {bounds}".strip()
