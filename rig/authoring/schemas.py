"""JSON Schemas of benches, plans, virtual rigs and files of sensors, written from the models that read them.

The description of a key is the docstring under its field, its title has its unit. A schema refuses what the program refuses
for a reason that a schema can express: an unknown key, a wrong type, a value out of range, a missing key, a wrong choice.
Rules between numbers, such as a limit beyond a channel's range, stay with the program.
"""

from pydantic import AliasChoices, BaseModel

from rig.authoring.changes import Loosened, reachable, requirements
from rig.authoring.draft7 import DRAFT, Schema, draft7, plain
from rig.errors import ConfigurationError


def schema_names() -> tuple[str, ...]:
    """Names of all schemas: ``bench``, ``plan``, ``rig``, ``sensors``, and every kind of plan."""
    from rig.campaigns.kinds import KINDS

    return ("bench", "plan", "rig", "sensors", *KINDS)


def schema_of(name: str) -> Schema:
    """Return the schema of that name (`schema_names`); raise `ConfigurationError` for another name."""
    ConfigurationError.unless_one_of("WHAT", name, schema_names())
    named = {"bench": bench_schema, "rig": rig_schema, "plan": plan_schema, "sensors": sensors_schema}
    return named.get(name, lambda: plan_schema(name))()


def plan_schema(kind: str | None = None) -> Schema:
    """Return the schema of plans of a kind; without a kind, of all plans: one schema for each ``kind``."""
    from rig.campaigns.kinds import KINDS

    if kind is not None:
        return _whole(_of_plan(KINDS[kind].plan), f"{kind} plan")
    definitions: Schema = {}
    for name, campaign in KINDS.items():
        schema = _of_plan(campaign.plan)
        definitions |= schema.pop("definitions")
        definitions[f"{name}-plan"] = schema
    union = {"description": "Plan of a test.", "oneOf": [{"$ref": f"#/definitions/{name}-plan"} for name in KINDS]}
    return _whole({"type": "object", **union, "definitions": definitions}, "plan")


def rig_schema() -> Schema:
    """Return the schema of a virtual rig: all of its parts, or changes of a shipped ``specimen``."""
    schema = _of_rig()
    definitions = schema.pop("definitions")
    rules = _unless("specimen", requirements(schema, definitions))
    loose = Loosened(definitions).table(schema)
    return _whole({**loose, "allOf": [*loose.get("allOf", ()), rules], "definitions": definitions}, "virtual rig")


def bench_schema() -> Schema:
    """Return the schema of a bench: all of its keys, or changes of a ``base``."""
    from rig.bench import Bench

    schema = draft7(Bench.model_json_schema())
    definitions = schema.pop("definitions")
    loosened = Loosened(definitions)
    asked = requirements(schema, definitions)
    loose = loosened.table(schema)
    options = _options_of_drivers()
    for name, option in options.items():
        definitions |= option.pop("definitions", {})
        rules = requirements(option, definitions)
        rules = _unless("specimen", rules) if name == "virtual" else rules
        rules = {"required": ["options"], "properties": {"options": rules}}
        asked["properties"]["driver"].setdefault("allOf", []).append(_where_named(name, rules))
        definitions[f"{name}-options"] = loosened.table(option)
    driver = definitions["DriverChoiceChanges"]  # those of the product have known options, others options of their own
    known = {name: {"$ref": f"#/definitions/{name}-options"} for name in options}
    driver["properties"]["options"]["anyOf"] = [*known.values(), {"type": "object"}]  # so that an editor completes them
    driver["allOf"] = [_where_named(name, {"properties": {"options": own}}) for name, own in known.items()]
    loose["properties"] = {"base": _BASE, "sensors": _SENSORS, **loose["properties"]}
    loose["allOf"] = [*loose.get("allOf", ()), _unless("base", asked)]
    return _whole({**loose, "definitions": definitions}, "bench")


_BASE = {
    "title": "base",
    "type": "string",
    "description": "Shipped bench (`rig list`), or a .toml file in the same folder, that this file changes key by key.",
}

_SENSORS = {
    "title": "sensors",
    "type": "string",
    "pattern": r"\.toml$",
    "description": "File of sensors (`rig new sensors`), to which channels refer by serial_number.",
}


def sensors_schema() -> Schema:
    """Return the schema of a file of sensors by serial number."""
    from rig.bench.sensors import SensorFile

    return _whole(_of(SensorFile), "sensors")


def _where_named(driver: str, rules: Schema) -> Schema:
    return {"if": {"properties": {"name": {"const": driver}}, "required": ["name"]}, "then": rules}


def _unless(key: str, rules: Schema) -> Schema:
    return {"if": {"not": {"required": [key]}}, "then": rules}


def _options_of_drivers() -> dict[str, Schema]:
    from rig.drivers.can import CanOptions
    from rig.drivers.nidaqmx.options import NiDaqmxOptions
    from rig.drivers.serial import SerialOptions
    from rig.drivers.sound.options import SoundOptions
    from rig.drivers.virtual.driver import Queue

    rig, queue = _of_rig(), draft7(Queue.model_json_schema())
    del rig["properties"]["seed"]  # is given to the run
    rig["properties"] |= queue["properties"]
    rig["definitions"] |= queue["definitions"]
    models: dict[str, type[BaseModel]] = {
        "serial": SerialOptions,
        "can": CanOptions,
        "sound": SoundOptions,
        "nidaqmx": NiDaqmxOptions,
    }
    return {"virtual": rig, **{name: _of(model) for name, model in models.items()}}


def _of(model: type[BaseModel]) -> Schema:
    return {"definitions": {}, **draft7(model.model_json_schema())}


def _of_rig() -> Schema:
    from simulators import VirtualRig

    return _of(VirtualRig)


def _of_plan(model: type[BaseModel]) -> Schema:
    schema = _of(model)
    for name, field in model.model_fields.items():
        if isinstance(choices := field.validation_alias, AliasChoices):
            schema["properties"] |= {str(other): schema["properties"][name] for other in choices.choices}
    return {**schema, "required": ["kind", *schema.get("required", ())]}


def _whole(schema: Schema, title: str) -> Schema:
    """Return a schema with its heading, and without what nothing refers to."""
    described = {"description": plain(schema.pop("description", ""))}
    return reachable({"$schema": DRAFT, "title": f"vibrolock {title}", **described, **schema})
