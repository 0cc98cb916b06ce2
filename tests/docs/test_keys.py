"""The pages' tables of keys say what the models say: every key, its default, its allowed range."""

import re
from typing import Any, get_args

import annotated_types
import pytest
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from controller import LockRule, PhaseLockedLoop
from rig import errors as rig_errors
from rig.campaigns.planning.plant import PlantFacts
from rig.drivers.can import CanOptions
from rig.drivers.serial import SerialOptions
from rig.drivers.virtual.faults import PassingFaults
from rig.rehearsal.hypotheses import Hypotheses
from rig.tick.layout import DEVICE_SHIFT
from rig.wire.can.link import CanLink
from rig.wire.can.slcan import SlcanBus
from simulators.layout import Flag
from simulators.virtual_rig import VirtualRig
from tests.docs.pages import ROOT
from tests.docs.tables import PAGE, PARTS, table_of, table_under

MODELS = {
    "Keys of `[controller]`": PhaseLockedLoop,
    "Keys of `[controller.lock]`": LockRule,
    "Keys of `[plant]`": PlantFacts,
    "Keys of a table of hypotheses": Hypotheses,
    "Keys of `[driver.options]` of the serial driver": SerialOptions,
    "Keys of `[driver.options]` of the CAN driver": CanOptions,
}


def keys_under(heading: str) -> dict[str, tuple[str, str]]:
    """Default and allowed column of every key in the table below a heading of the pages that have keys of plans and benches."""
    pages = [
        (ROOT / "docs" / name).read_text(encoding="utf-8")
        for name in (
            "controller.md",
            "tuning.md",
            "rehearsal.md",
            "reference/wire-protocol.md",
            "reference/wire-protocol-can.md",
        )
    ]
    rows = re.findall(
        r"^\| `(\w+)` \|([^|]*)\|([^|]*)\|", table_under(heading, "\n".join(pages))["table"], re.MULTILINE
    )
    return {key: (default.strip(), allowed.strip()) for key, default, allowed in rows}


def parts_of(kind: Any) -> set[type[BaseModel]]:
    """A model and all models that its fields may hold."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return {kind}.union(*(parts_of(field.annotation) for field in kind.model_fields.values()))
    return set[type[BaseModel]]().union(*(parts_of(one) for one in get_args(kind)))


def shown_number(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:g}"


def shown_default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if value in (None, "", PydanticUndefined) or isinstance(value, BaseModel):
        return "–"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"  # as TOML has it
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
    table, fields = keys_under(heading), MODELS[heading].model_fields
    assert set(table) == set(fields)
    for name, field in fields.items():
        default, allowed = table[name]
        assert default == shown_default(field), name
        assert allowed.startswith(shown_range(field)), f"{name}: {allowed!r}, the code says {shown_range(field)!r}"


@pytest.mark.parametrize("heading", PARTS)
def test_every_part_of_a_virtual_rig_is_on_its_page_as_the_code_has_it(heading):
    shown = table_under(heading, PAGE.read_text(encoding="utf-8"))["table"].splitlines()
    assert shown == table_of(PARTS[heading]), "python -m tests.docs.tables writes the tables anew"


def test_every_part_that_a_virtual_rig_can_have_is_on_the_page():
    assert parts_of(VirtualRig) | {PassingFaults} == set(PARTS.values())


def test_every_flag_is_on_the_page_with_its_bit():
    shown = re.findall(r"^\| `(\w+)` \| (\d+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert [(name, 1 << (int(bit) - DEVICE_SHIFT)) for name, bit in shown] == [
        (str(flag.name).lower(), int(flag)) for flag in Flag
    ]


def test_what_goes_wrong_on_a_bus_names_every_counter_of_it_and_errors_that_there_are():
    page = (ROOT / "docs" / "reference" / "wire-protocol-can.md").read_text(encoding="utf-8")
    words = set(re.findall(r"`(\w+)`", table_under("What goes wrong on the bus", page)["table"]))
    errors = {word for word in words if word.startswith("Daq")}
    assert errors <= set(rig_errors.__all__)
    assert words - errors == {*CanLink(SlcanBus("a port"), 4).counters, "lost_samples", "retries"}
