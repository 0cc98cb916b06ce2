"""The reference says what the models say: every table has a place, every key a meaning; counters and flags on their pages."""

import re

import pytest

from rig import errors as rig_errors
from rig.reference.keys import keys_of, parts_of, roots, tables
from rig.tick.layout import DEVICE_SHIFT
from rig.wire.can.frames import BusTiming
from rig.wire.can.link import CanLink
from rig.wire.can.slcan import SlcanBus
from simulators.kernels import Flag
from tests.docs.pages import ROOT, blocks, table_under

KEYS = ROOT / "docs" / "reference" / "keys"
VIRTUAL_RIGS = ROOT / "docs" / "reference" / "virtual-rig-parts.md"


def test_every_table_that_a_plan_a_bench_or_a_virtual_rig_can_hold_is_known():
    assert set().union(*map(parts_of, roots())) == set(tables().values())


def test_every_table_stands_on_one_page_of_keys():
    shown = [
        block.language.split()[1]
        for page in sorted(KEYS.glob("*.md"))
        for block in blocks(page)
        if block.language.startswith("{keys}")
    ]
    assert sorted(shown) == sorted(tables())


@pytest.mark.parametrize("table", tables())
def test_every_key_has_a_meaning_what_is_allowed_and_its_own_sentence(table):
    for key in keys_of(table):
        assert key.meaning.endswith("."), key
        assert len(key.meaning.split()) > 1, key
        assert key.allowed, key


def test_every_flag_is_on_the_page_with_its_bit():
    shown = re.findall(r"^\| `(\w+)` \| (\d+) \|", VIRTUAL_RIGS.read_text(encoding="utf-8"), re.MULTILINE)
    assert [(name, 1 << (int(bit) - DEVICE_SHIFT)) for name, bit in shown] == [
        (str(flag.name).lower(), int(flag)) for flag in Flag
    ]


def test_what_goes_wrong_on_a_bus_names_every_counter_of_it_and_errors_that_there_are():
    page = (ROOT / "docs" / "reference" / "wire-protocol-can.md").read_text(encoding="utf-8")
    words = set(re.findall(r"`(\w+)`", table_under("What goes wrong on the bus", page)["table"]))
    errors = {word for word in words if word.startswith("Daq")}
    assert errors <= set(rig_errors.__all__)
    of_the_driver = "lost_samples", "retries", "late_blocks", "reordered_blocks"
    link = CanLink(SlcanBus("a port"), 4, BusTiming(fd=True))
    assert words - errors == {*link.counters, *of_the_driver}
