"""Every message that ends or spoils a run has a page: what it means, what to look at, what to change."""

import re

import pytest
from typer.main import get_command

import rig.errors
from rig.authoring.schemas import schema_names, schema_of
from rig.campaigns.evaluation.point import Quality
from rig.cli.app import app
from rig.text.message_pages import page_of
from rig.tick.safety.layout import EndReason
from tests.docs.pages import ROOT

FOLDER = ROOT / "docs" / "reference" / "messages"
PAGES = {page.stem: page.read_text(encoding="utf-8") for page in FOLDER.glob("*.md") if page.stem != "index"}
NO_MESSAGE = {EndReason.NONE, EndReason.COMPLETED, Quality.GOOD}
BASES = {"RigError", "as_daq_error"}
MESSAGES = {
    *(page_of(str(quality)) for quality in Quality if quality not in NO_MESSAGE),
    *(page_of(reason.name) for reason in EndReason if reason not in NO_MESSAGE),
    *(page_of(name) for name in rig.errors.__all__ if name not in BASES),
    "held-outputs",
}


def keys_in(schema):
    """Names of all keys that a schema knows, at any depth."""
    if isinstance(schema, dict):
        own = set(schema.get("properties", {})) if isinstance(schema.get("properties"), dict) else set()
        return own.union(*map(keys_in, schema.values()))
    return set().union(*map(keys_in, schema)) if isinstance(schema, list) else set()


def test_every_message_has_a_page_and_every_page_a_message():
    assert set(PAGES) == MESSAGES


@pytest.mark.parametrize("name", sorted(PAGES))
def test_a_page_says_what_it_means_what_to_look_at_and_what_to_change(name):
    headings = re.findall(r"^## (.*)$", PAGES[name], re.MULTILINE)
    assert headings == ["What it means", "What to look at", "What to change"]
    assert re.match(r"# \S.*\n\n\*Effect:\* \S", PAGES[name])


def test_pages_of_messages_name_keys_and_commands_that_there_are():
    commands = set(get_command(app).commands)
    keys = set().union(*(keys_in(schema_of(name)) for name in schema_names()))
    unknown = [
        f"{name}: {code}"
        for name, text in PAGES.items()
        for code in re.findall(r"`([^`]*)`", text)
        if ((command := re.match(r"rig ([a-z]+)", code)) and command[1] not in commands)
        or (re.fullmatch(r"[a-z_.]+( = .*)?", code) and code.split(" = ")[0].split(".")[-1] not in keys)
    ]
    assert unknown == []


@pytest.mark.parametrize(
    ("name", "page"),
    [
        ("LOST_LOCK", "lost-lock"),
        ("not-settled", "not-settled"),
        ("DaqTimeout", "daq-timeout"),
        ("NotArmed", "not-armed"),
    ],
)
def test_pages_are_named_like_their_messages(name, page):
    assert page_of(name) == page
