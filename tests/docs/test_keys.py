"""The guide's tables of keys say what the models say: every key, its default, its allowed range."""

import re
from typing import Any

import annotated_types
import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from controller.pll import LockRule, PhaseLockedLoop
from rig.bench import Bench, DriverChoice, Limits, SpecimenFacts
from rig.campaigns.backbone import BackbonePlan
from rig.daq import Channel
from rig.drivers.virtual.driver import Queue
from rig.sequencer.segments import SettleRule
from tests.docs.pages import ROOT

MODELS = {
    "Keys of a backbone plan": BackbonePlan,
    "Keys of `[controller]`": PhaseLockedLoop,
    "Keys of `[controller.lock]`": LockRule,
    "Keys of `[settle]`": SettleRule,
    "Keys of a bench": Bench,
    "Keys of `[driver]`": DriverChoice,
    "Keys of `[specimen]`": SpecimenFacts,
    "Keys of `[limits]`": Limits,
    "Keys of `[[channels]]`": Channel,
    "Keys of `[driver.options]` of the virtual driver": Queue,
}


def table_under(heading: str) -> dict[str, tuple[str, str]]:
    """Default and allowed column of every key in the table below a heading of the guide."""
    guide = (ROOT / "docs" / "user-guide.md").read_text(encoding="utf-8")
    found = re.search(rf"^#+ {re.escape(heading)}$(.*?)(?=^#|\Z)", guide, re.MULTILINE | re.DOTALL)
    assert found, f"no heading {heading!r}"
    rows = re.findall(r"^\| `(\w+)` \|([^|]*)\|([^|]*)\|", found.group(1), re.MULTILINE)
    return {key: (default.strip(), allowed.strip()) for key, default, allowed in rows}


def shown_number(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:g}"


def shown_default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if value in (None, "", PydanticUndefined) or isinstance(value, BaseModel):
        return "–"
    return f"`{shown_number(value) if isinstance(value, float) else value}`"


def shown_range(field: Any) -> str:
    """As the guide writes it: ``above 0 to 45``, ``0 to 10000``, ``from 0``; empty without bounds."""
    low = high = ""
    for bound in field.metadata:
        if isinstance(bound, annotated_types.Gt):
            low = f"above {shown_number(bound.gt)}"
        elif isinstance(bound, annotated_types.Ge):
            low = shown_number(bound.ge)
        elif isinstance(bound, annotated_types.Le):
            high = shown_number(bound.le)
    if high:
        return f"{low} to {high}"
    return low if low.startswith("above") else f"from {low}" if low else ""


@pytest.mark.parametrize("heading", MODELS)
def test_every_key_is_in_the_guide_with_its_default_and_range(heading):
    table, fields = table_under(heading), MODELS[heading].model_fields
    extra = {"further"} if MODELS[heading] is Queue else set()
    assert set(table) - extra == set(fields)
    for name, field in fields.items():
        default, allowed = table[name]
        assert default == shown_default(field), name
        assert allowed.startswith(shown_range(field)), f"{name}: {allowed!r}, the code says {shown_range(field)!r}"
