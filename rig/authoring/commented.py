"""TOML files with every key that a table may have: those that are given, and the others commented out with their defaults.

The comments are the descriptions of the schema, so that they say what the models say. In a comment text begins behind a
space (``# Largest force, N.``), a key does not (``#block = 1``): without its ``#`` the line is part of the file.
"""

import json
import re
import textwrap
from collections.abc import Iterator

from rig.authoring.draft7 import Schema, name_in
from rig.bench.configuration import Table

WIDTH = 110
"""Longest line of a comment, characters; chosen to fit beside a page."""


def commented(table: Table, schema: Schema) -> str:
    """Return a TOML file that holds ``table``, with a comment for every key that the schema knows."""
    title = schema["title"].removeprefix("vibrolock ").capitalize()
    about = _text(f"{title}: {schema['description'].partition(chr(10))[0]}")
    note = "A line such as `#key = value` is optional and shows the default: take the # away to change it."
    return "\n".join([*about, *_text(note), *_table(table, schema, schema["definitions"], ())]) + "\n"


def _text(words: str) -> list[str]:
    return textwrap.wrap(words, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)


def _table(
    given: Table, node: Schema, definitions: Schema, path: tuple[str, ...], *, told: bool = True
) -> Iterator[str]:
    """Yield the lines of a table: its plain keys, then the tables in it. Only given keys without comments unless ``told``."""
    keys = {name: _resolved(part, definitions, given.get(name)) for name, part in node["properties"].items()}
    plain = [name for name in keys if not _holds_tables(keys[name], definitions)]
    for name in sorted(plain, key=lambda name: name not in given):
        if told:
            yield ""
            yield from _text(_meaning(keys[name]))
        if name in given:
            yield f"{name} = {_value(given[name])}"
        elif told:
            yield f"#{name} = {_value(keys[name]['default']) if 'default' in keys[name] else ''}".rstrip()
    for name in keys:
        if name not in plain and (told or name in given):
            yield from _inner(name, given, keys[name], definitions, (*path, name))


def _inner(name: str, given: Table, node: Schema, definitions: Schema, path: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table inside another, or of a list of tables."""
    dotted = ".".join(path)
    if name not in given:
        yield ""
        yield from _text(_meaning(node))
        yield f"#[[{dotted}]]" if "items" in node else f"#[{dotted}]"
        return
    tables = given[name] if "items" in node else [given[name]]
    assert isinstance(tables, list | tuple)
    for number, item in enumerate(tables):
        inside = _resolved(node["items"], definitions, item) if "items" in node else node
        yield ""
        yield from _text(_meaning(node)) if number == 0 else ()
        yield f"[[{dotted}]]" if "items" in node else f"[{dotted}]"
        if "properties" in inside:
            yield from _table(item, inside, definitions, path, told=number == 0)
        else:
            yield from (f"{key} = {_value(value)}" for key, value in item.items())


def _resolved(node: Schema, definitions: Schema, value: object = None) -> Schema:
    """Return a schema with what it refers to; of a union, the variant that ``value`` belongs to."""
    out = dict(node)
    references = [part for part in [node, *node.get("allOf", ())] if "$ref" in part]
    for part in references:
        out = {**_resolved(definitions[name_in(part["$ref"])], definitions, value), **out}
    for variant in [*node.get("oneOf", ()), *node.get("anyOf", ())]:
        if "$ref" in variant and isinstance(value, dict):
            inside = _resolved(variant, definitions, value)
            keys = inside.get("properties", {})  # those of its variant, with the words of it
            if all(name in keys and value[name] == keys[name].get("const", value[name]) for name in value):
                return {**inside, **out}
    return out


def _holds_tables(node: Schema, definitions: Schema) -> bool:
    if "items" in node:
        return isinstance(node["items"], dict) and _holds_tables(_resolved(node["items"], definitions), definitions)
    union = [part for part in [*node.get("oneOf", ()), *node.get("anyOf", ())] if "$ref" in part]
    return "properties" in node or bool(union)


def _meaning(node: Schema) -> str:
    """Return what a key means, its unit if the description does not name it, and what is allowed, in one paragraph."""
    title = str(node.get("title", ""))
    words = " ".join(str(node.get("description", title)).split())
    unit = title.rpartition("(")[2].removesuffix(")") if title.endswith(")") else ""
    named = re.search(rf"(?<!\w){re.escape(unit)}(?!\w)", words) is not None
    facts = ", ".join(part for part in ("" if named else unit, _allowed(node)) if part)
    return f"{words} [{facts}]" if facts else words


def _allowed(node: Schema) -> str:
    """Return the range or the choices of a key in words: ``above 0 to 100``."""
    if "enum" in node:
        return ", ".join(map(_value, node["enum"]))
    low = f"above {node['exclusiveMinimum']:g}" if "exclusiveMinimum" in node else ""
    low = f"from {node['minimum']:g}" if "minimum" in node else low
    high = f"below {node['exclusiveMaximum']:g}" if "exclusiveMaximum" in node else ""
    high = f"to {node['maximum']:g}" if "maximum" in node else high
    return f"{low} {high}".strip()


def _value(value: object) -> str:
    if isinstance(value, dict):
        inside = ", ".join(f"{key} = {_value(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)
