"""JSON Schemas as pydantic makes them (draft 2020-12), rewritten in draft 7, which Taplo, Tombi and other TOML editors know.

What TOML cannot hold (null) is left out. What a reader of draft 7 would ignore is said in its words: a ``$ref`` beside other
words, ``prefixItems``, the ``discriminator`` of a union.
"""

from collections.abc import Iterator

from pydantic.json_schema import JsonSchemaValue

from vibrolock.units import titled

Schema = JsonSchemaValue
"""A JSON Schema, or a part of one."""

DRAFT = "http://json-schema.org/draft-07/schema#"

_NAMED = {"properties": "properties", "$defs": "definitions", "definitions": "definitions"}
_LISTED = ("allOf", "anyOf", "oneOf")
_SINGLE = ("items", "additionalProperties", "contains", "not", "if", "then", "else")
_LEFT_OUT = ("title", "discriminator", "prefixItems")


def draft7(schema: Schema) -> Schema:
    """Return a schema of pydantic in draft 7: definitions under ``definitions``, titles with units, unions with their tag."""
    out = _converted(schema)
    for node in nodes(schema):
        if isinstance(union := node.get("discriminator"), dict):  # a file must give the tag of a union
            for reference in union["mapping"].values():
                variant = out["definitions"][name_in(reference)]
                variant["required"] = list(dict.fromkeys([union["propertyName"], *variant.get("required", ())]))
    return out


def plain(text: str) -> str:
    """Return a docstring as paragraphs of one line each, with Markdown's marks for code."""
    paragraphs = (" ".join(part.split()) for part in text.replace("``", "`").split("\n\n"))
    return "\n\n".join(part for part in paragraphs if part)


def nodes(schema: object) -> Iterator[Schema]:
    """Yield every table in a schema, the outermost first."""
    if isinstance(schema, dict):
        yield schema
    for inside in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from nodes(inside)


def name_in(reference: str) -> str:
    """Return the name of the definition that a ``$ref`` refers to."""
    return reference.rpartition("/")[2]


def _converted(node: Schema, key: str = "") -> Schema:
    """Return a schema converted; ``key`` is the name of the property that it describes."""
    out: Schema = {"title": titled(key)} if key else {}
    for word, value in node.items():
        if word in _NAMED:
            of_keys = word == "properties"
            out[_NAMED[word]] = {name: _converted(part, name if of_keys else "") for name, part in value.items()}
        elif word in _LISTED:
            out[word] = [_converted(part) for part in value if part != {"type": "null"}]
        elif word in _SINGLE:
            out[word] = _converted(value) if isinstance(value, dict) else value
        elif word == "$ref":
            out[word] = f"#/definitions/{name_in(value)}"
        elif word == "description":
            out[word] = plain(value)
        elif word not in _LEFT_OUT and not (word == "default" and value is None):
            out[word] = value
    if "prefixItems" in node:
        parts = [_converted(part) for part in node["prefixItems"]]
        alike = all(part == parts[0] for part in parts)
        out["items"] = {**parts[0], **out.get("items", {})} if alike else parts
    if len(out.get("anyOf", ())) == 1:  # the other choice was null
        for word, value in out.pop("anyOf")[0].items():  # words beside it count where both have them
            if word == "allOf":
                out["allOf"] = [*value, *out.get("allOf", ())]
            elif word == "items" and "items" in out:
                out["items"] = {**value, **out["items"]}
            else:
                out.setdefault(word, value)
    if "$ref" in out and len(out) > 1:
        out["allOf"] = [{"$ref": out.pop("$ref")}, *out.get("allOf", ())]
    return out
