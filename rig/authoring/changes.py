"""Schemas of tables that change a base key by key: with the base given, no key of the table or of a table in it is required.

A list replaces the base's whole, so that what stands in lists keeps its required keys.
"""

from rig.authoring.draft7 import Schema, name_in, nodes


def requirements(node: Schema, definitions: Schema) -> Schema:
    """Return the schema that asks for the required keys of a table, and of the tables in it, and for nothing else."""
    if "$ref" in node:
        return requirements(definitions[name_in(node["$ref"])], definitions)
    out: Schema = {"required": node["required"]} if node.get("required") else {}
    inside = {key: requirements(part, definitions) for key, part in node.get("properties", {}).items()}
    if inside := {key: part for key, part in inside.items() if part}:
        out["properties"] = inside
    conditions = [found for part in node.get("allOf", ()) if (found := requirements(part, definitions))]
    for variant in node.get("oneOf", ()):
        if "$ref" in variant:
            chosen = definitions[name_in(variant["$ref"])]
            tag = next(str(key) for key, part in chosen["properties"].items() if "const" in part)
            given = {"properties": {tag: {"const": chosen["properties"][tag]["const"]}}, "required": [tag]}
            conditions.append({"if": given, "then": requirements(chosen, definitions)})
            out["required"] = [tag]
        else:
            out["oneOf"] = node["oneOf"]
    return {**out, "allOf": conditions} if conditions else out


class Loosened:
    """Makes tables without required keys, with definitions ``...Changes`` beside those of a schema."""

    def __init__(self, definitions: Schema) -> None:
        self.definitions = definitions

    def table(self, node: Schema) -> Schema:
        """Return the schema of a table without required keys, in it and in the tables in it."""
        out = {word: value for word, value in node.items() if word != "required"}
        union = out.pop("oneOf", [])
        if "$ref" in out:
            out["$ref"] = self._reference(name_in(out["$ref"]))
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


def _references(schema: Schema) -> set[str]:
    return {name_in(node["$ref"]) for node in nodes(schema) if isinstance(node.get("$ref"), str)}
