"""Schemas of tables that change a base key by key: with the base given, no key of the table or of a table in it is required.

A list replaces the base's whole, so that what stands in lists keeps its required keys.
"""

from rig.authoring.draft7 import Schema


def requirements(node: Schema, definitions: Schema) -> Schema:
    """Return the schema that asks for the required keys of a table, and of the tables in it, and for nothing else."""
    if "$ref" in node:
        return requirements(definitions[_name(node)], definitions)
    out: Schema = {"required": node["required"]} if node.get("required") else {}
    inside = {key: requirements(part, definitions) for key, part in node.get("properties", {}).items()}
    if inside := {key: part for key, part in inside.items() if part}:
        out["properties"] = inside
    conditions = [found for part in node.get("allOf", ()) if (found := requirements(part, definitions))]
    for variant in node.get("oneOf", ()):
        if "$ref" in variant:
            conditions.append(_if_chosen(definitions[_name(variant)], definitions))
            out["required"] = [_tag(definitions[_name(variant)])]
        else:
            out["oneOf"] = node["oneOf"]
    return {**out, "allOf": conditions} if conditions else out


def _if_chosen(variant: Schema, definitions: Schema) -> Schema:
    tag = _tag(variant)
    chosen = {"properties": {tag: {"const": variant["properties"][tag]["const"]}}, "required": [tag]}
    return {"if": chosen, "then": requirements(variant, definitions)}


def _tag(variant: Schema) -> str:
    """Return the key that tells the variants of a union apart."""
    return next(str(key) for key, part in variant["properties"].items() if "const" in part)


def _name(node: Schema) -> str:
    return str(node["$ref"]).rpartition("/")[2]


class Loosened:
    """Makes tables without required keys, with definitions ``...Changes`` beside those of a schema."""

    def __init__(self, definitions: Schema) -> None:
        self.definitions = definitions

    def table(self, node: Schema) -> Schema:
        """Return the schema of a table without required keys, in it and in the tables in it."""
        out = {word: value for word, value in node.items() if word != "required"}
        union = out.pop("oneOf", [])
        if "$ref" in out:
            out["$ref"] = self._reference(_name(out))
        if "properties" in out:
            out["properties"] = {key: self.table(part) for key, part in out["properties"].items()}
        if "allOf" in out:
            out["allOf"] = [self.table(part) if "$ref" in part else part for part in out["allOf"]]
        if any("$ref" in part for part in union):
            out["anyOf"] = [self.table(part) for part in union]  # without its tag, any may be meant
        return out

    def _reference(self, name: str) -> str:
        if not requirements(self.definitions[name], self.definitions):
            return f"#/definitions/{name}"
        changes = f"{name}Changes"
        if changes not in self.definitions:
            self.definitions[changes] = {}  # for a definition that refers to itself
            self.definitions[changes] = self.table(self.definitions[name])
        return f"#/definitions/{changes}"


def reachable(schema: Schema) -> Schema:
    """Return a schema without the definitions that nothing in it refers to."""
    definitions, wanted = schema.get("definitions", {}), set[str]()
    waiting = _references({word: value for word, value in schema.items() if word != "definitions"})
    while waiting:
        name = waiting.pop()
        if name not in wanted:
            wanted.add(name)
            waiting |= _references(definitions[name])
    return {**schema, "definitions": {name: definitions[name] for name in sorted(wanted)}}


def _references(node: object) -> set[str]:
    if isinstance(node, list):
        return set().union(*map(_references, node)) if node else set()
    if not isinstance(node, dict):
        return set()
    own = {_name(node)} if isinstance(node.get("$ref"), str) else set()
    return own.union(*map(_references, node.values()))
