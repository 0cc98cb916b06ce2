"""Every table that a plan, a bench or a virtual rig can hold, with its keys as the models have them.

The meaning of a key is the docstring under its field; default and allowed values come from the model's JSON schema.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args

from pydantic import AliasChoices, BaseModel

from rig.campaigns.kinds import KINDS
from rig.reference.entry import Entry
from vibrolock.on_use import Registry

Schema = dict[str, Any]

WORDS = {"string": "text", "boolean": "true, false", "number": "number", "integer": "whole number", "object": "table"}


@dataclass(frozen=True)
class Key:
    """A key of a table, in Markdown's marks for code."""

    table: str
    """Name of the table that has the key."""
    name: str
    """The key."""
    default: str
    """Default as TOML has it; ``required``; empty if the key may be left out and has no default."""
    allowed: str
    """Range, choices or type."""
    meaning: str
    """What it does, in one line."""
    holds: tuple[str, ...]
    """Names of the tables that may stand under the key."""

    @property
    def anchor(self) -> str:
        """Where the key stands on its page."""
        return f"key-{self.table}-{self.name}"


MODELS = {
    "drift-limits": "rig.campaigns.dwell.plan:DriftLimits",
    "controller": "controller:PhaseLockedLoop",
    "open-loop": "controller:OpenLoop",
    "lock": "controller:LockRule",
    "harmonics": "controller.harmonics:HarmonicsSettings",
    "settle": "rig.tick.sequencer.segments:SettleRule",
    "plant": "rig.campaigns.planning.plant:PlantFacts",
    "hypotheses": "rig.rehearsal.hypotheses:Hypotheses",
    "bench": "rig.bench:Bench",
    "driver": "rig.bench:DriverChoice",
    "specimen": "rig.bench:SpecimenFacts",
    "limits": "rig.bench:Limits",
    "arming": "rig.bench:Arming",
    "emergency_stop": "rig.bench:EmergencyStop",
    "channels": "rig.daq:Channel",
    "virtual": "rig.drivers.virtual.driver:Queue",
    "serial": "rig.drivers.serial:SerialOptions",
    "can": "rig.drivers.can:CanOptions",
    "sound": "rig.drivers.sound.options:SoundOptions",
    "nidaqmx": "rig.drivers.nidaqmx.options:NiDaqmxOptions",
    "faults": "rig.drivers.virtual.faults:PassingFaults",
    "virtual-rig": "simulators:VirtualRig",
    "beam": "simulators.parts:BeamStructure",
    "lap-jointed-beam": "simulators.parts:LapJointedBeam",
    "lumped-mass": "simulators.parts:LumpedMass",
    "support": "simulators.parts:Support",
    "modal": "simulators.parts:ModalStructure",
    "magnet": "simulators.parts:Magnet",
    "cubic": "simulators.parts:Cubic",
    "clearance": "simulators.parts:Clearance",
    "force-table": "simulators.parts:ForceTable",
    "damping-table": "simulators.parts:DampingTable",
    "user": "simulators.parts:User",
    "jenkins": "simulators.parts:JenkinsSite",
    "iwan": "simulators.parts:IwanSite",
    "exciter": "simulators.parts:Exciter",
    "stinger": "simulators.parts:Stinger",
    "sensor": "simulators.parts:Sensor",
    "converter": "simulators.parts:Converter",
    "scatter": "simulators.parts:Scatter",
    "deviation": "simulators.parts:Deviation",
    "wear": "simulators.parts:Wear",
    "time-data": "identification:TimeDataMapping",
    "sampled-channel": "identification.mapping:SampledChannel",
    "stretch": "identification.mapping:Stretch",
    "csv": "identification.mapping:CsvLayout",
}
"""Models of the tables beside those of the plans, by the name under which the reference has them."""


@cache
def tables() -> dict[str, type[BaseModel]]:
    """Return the model of every table by the name under which the reference has it."""
    return {**{kind: campaign.plan for kind, campaign in KINDS.items()}, **Registry[type[BaseModel]](MODELS)}


def roots() -> tuple[type[BaseModel], ...]:
    """Return the models of what stands in files: plans, benches, options of drivers, virtual rigs, hypotheses, mappings."""
    others = ("bench", "virtual", "serial", "can", "sound", "nidaqmx", "virtual-rig", "hypotheses", "time-data")
    return (*(campaign.plan for campaign in KINDS.values()), *(tables()[name] for name in others))


def parts_of(kind: object) -> set[type[BaseModel]]:
    """Return a model and all models that its fields may hold, at any depth."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return {kind}.union(*(parts_of(field.annotation) for field in kind.model_fields.values()))
    return set[type[BaseModel]]().union(*(parts_of(one) for one in get_args(kind)))


@cache
def keys_of(table: str) -> tuple[Key, ...]:
    """Return the keys of a table; the one that tells its kind first, the others in the model's order."""
    model = tables()[table]
    schema = model.model_json_schema()
    required = {*schema.get("required", ()), *(("kind",) if "kind" in schema["properties"] else ())}
    return tuple(
        Key(
            table=table,
            name=name,
            default="required" if name in required else _default(field.get("default")),
            allowed=_allowed(field),
            meaning=" ".join(field.get("description", "").split()).replace("``", "`"),
            holds=_tables_in(model.model_fields[name].annotation) if name in model.model_fields else (),
        )
        for name, field in sorted(schema["properties"].items(), key=lambda item: item[0] != "kind")
    )


def _tables_in(kind: object) -> tuple[str, ...]:
    """Return the names of the tables that a field holds itself, not those inside them."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return tuple(name for name, model in tables().items() if model is kind)
    return tuple(dict.fromkeys(name for one in get_args(kind) for name in _tables_in(one)))


def _default(value: object) -> str:
    """Return a default as TOML has it; empty for what is absent or a table of its own."""
    if value is None or isinstance(value, dict) or value in ("", []):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{_number(value)}`" if isinstance(value, float) else f"`{value}`"


def _allowed(field: Schema) -> str:
    options = [option for option in field.get("anyOf", [field]) if option.get("type") != "null"]
    if options:  # of items both may say something
        items = {**options[0].get("items", {}), **field.get("items", {})}
        field = {**field, **options[0], **({"items": items} if items else {})}
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{choice}`" for choice in field["enum"])
    if field.get("type") == "array":
        return _list(field)
    if "$ref" in field or "oneOf" in field:
        return "table"
    return _bounds(field) or WORDS.get(field.get("type", "string"), "")


def _list(field: Schema) -> str:
    inner = _allowed((field.get("prefixItems") or [field.get("items", {})])[0])
    if inner == "table":
        return "list of tables"
    count = field.get("maxItems") if field.get("maxItems") == field.get("minItems") else None
    return f"list of {count}: {inner}" if count else f"list: {inner}"


def _bounds(field: Schema) -> str:
    """Return ``above 0 to 1``, ``0 to below 1``, ``from 0``; empty without bounds."""
    low = f"above {_number(field['exclusiveMinimum'])}" if "exclusiveMinimum" in field else ""
    low = f"{_number(field['minimum'])}" if "minimum" in field else low
    high = f"below {_number(field['exclusiveMaximum'])}" if "exclusiveMaximum" in field else ""
    high = f"{_number(field['maximum'])}" if "maximum" in field else high
    if high:
        return f"{low} to {high}" if low else f"up to {high}"
    return low if low.startswith("above") else f"from {low}" if low else ""


def key_entries() -> Iterator[Entry]:
    """Yield an entry for every table and every key.

    A key that holds the table of its own name is found by its full name alone, as the word means the table.
    """
    for name, model in tables().items():
        line = " ".join(str(model.__doc__).partition("\n\n")[0].split()).replace("``", "`")
        yield Entry("table", name, tuple(dict.fromkeys((name, name.replace("-", "_")))), line, f"keys-{name}")
        for key in keys_of(name):
            field = model.model_fields.get(key.name)
            full, alias = f"{name}.{key.name}", field.validation_alias if field is not None else None
            others = alias.choices if isinstance(alias, AliasChoices) else ()
            other_names = [str(one) for one in others if one != key.name]
            words = (full,) if key.name in key.holds else (key.name, full, *other_names)
            default = f"default {key.default}" if key.default.startswith("`") else key.default
            facts = ", ".join(text for text in (default, f"allowed: {key.allowed}") if text)
            yield Entry("key", full, words, key.meaning, key.anchor, facts)


def _number(value: float) -> str:
    """Return a number in full where it is whole and not very large."""
    return str(int(value)) if value == int(value) and abs(value) < 1e8 else f"{value:g}"
