"""Tables of keys as the models have them: ``python -m tests.docs.tables`` writes them anew into the page of virtual rigs.

A table stands between its heading and the first line after it that is no row.
"""

import re
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from rig.drivers.virtual.faults import PassingFaults
from simulators.exciter import Exciter, Stinger
from simulators.scatter import Deviation, Scatter
from simulators.sensing.parts import Converter, Sensor
from simulators.sites.elements import Clearance, Cubic, Magnet, User
from simulators.sites.friction import IwanSite, JenkinsSite
from simulators.structures.meshed import LumpedMass, Support
from simulators.structures.structure import BeamStructure, LapJointedBeam, ModalStructure
from simulators.virtual_rig import VirtualRig
from simulators.wear import Wear
from tests.docs.pages import ROOT

PAGE = ROOT / "docs" / "virtual-rigs.md"
HEAD = ["| key | default | allowed | meaning |", "|---|---|---|---|"]
PARTS: dict[str, type[BaseModel]] = {
    "Keys of a virtual rig": VirtualRig,
    "Beam": BeamStructure,
    "Lap-jointed beam": LapJointedBeam,
    "Lumped masses": LumpedMass,
    "Supports": Support,
    "Given modes": ModalStructure,
    "Magnets": Magnet,
    "Polynomial spring": Cubic,
    "Stops": Clearance,
    "A force law of one's own": User,
    "Jenkins elements": JenkinsSite,
    "Iwan joint": IwanSite,
    "Exciter": Exciter,
    "Stinger": Stinger,
    "Sensors": Sensor,
    "Converter": Converter,
    "Scatter": Scatter,
    "Deviation": Deviation,
    "Wear": Wear,
    "Faults": PassingFaults,
}
WORDS = {"string": "text", "boolean": "true, false", "number": "number", "integer": "whole number", "object": "table"}


def table_of(model: type[BaseModel]) -> list[str]:
    """The rows of a model's table, head included."""
    schema = model.model_json_schema()
    required = schema.get("required", [])
    rows = []
    fields = sorted(schema["properties"].items(), key=lambda item: item[0] != "kind")
    for key, field in fields:
        default = "required" if key in required else shown_default(field.get("default"))
        rows.append(f"| `{key}` | {default} | {allowed(field)} | {meaning(field)} |")
    return HEAD + rows


def meaning(field: dict[str, Any]) -> str:
    """The docstring below the field, in one line."""
    return " ".join(field["description"].split()).replace("``", "`")


def shown_default(value: Any) -> str:
    """A default as TOML has it; a dash for what is absent or a part of its own."""
    if value is None or isinstance(value, dict) or value in ("", []):
        return "–"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def allowed(field: dict[str, Any]) -> str:
    """Range, choices or kind of a value."""
    options = [option for option in field.get("anyOf", [field]) if option.get("type") != "null"]
    field = field | options[0] if options else field
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{choice}`" for choice in field["enum"])
    if field.get("type") == "array":
        inner = allowed(field["items"])
        return "list of tables" if inner == "table" else f"list: {inner}"
    if "$ref" in field or "oneOf" in field:
        return "table"
    return bounds(field) or WORDS.get(field.get("type", ""), "see meaning")


def bounds(field: dict[str, Any]) -> str:
    """``above 0 to 1``, ``0 to below 1``, ``from 0``; empty without bounds."""
    low = f"above {field['exclusiveMinimum']:g}" if "exclusiveMinimum" in field else ""
    low = f"{field['minimum']:g}" if "minimum" in field else low
    high = f"below {field['exclusiveMaximum']:g}" if "exclusiveMaximum" in field else ""
    high = f"{field['maximum']:g}" if "maximum" in field else high
    if high:
        return f"{low} to {high}" if low else f"up to {high}"
    return low if low.startswith("above") else f"from {low}" if low else ""


def table_under(heading: str, text: str) -> re.Match[str]:
    """The first table below a heading."""
    found = re.search(
        rf"^#+ {re.escape(heading)}$(?:(?!^#).)*?(?P<table>(?:^\|[^\n]*\n)+)", text, re.MULTILINE | re.DOTALL
    )
    assert found, f"no table under {heading!r}"
    return found


def rewrite(page: Path = PAGE) -> None:
    """Write every table of the page anew."""
    text = page.read_text(encoding="utf-8")
    for heading, model in PARTS.items():
        at = table_under(heading, text)
        text = text[: at.start("table")] + "\n".join(table_of(model)) + "\n" + text[at.end("table") :]
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    rewrite()
