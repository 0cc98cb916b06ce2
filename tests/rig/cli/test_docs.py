"""``rig docs``: what it prints and opens, with and without a site."""

import sys
import webbrowser

import pytest

from rig.cli.docs import BUILD
from rig.reference import words
from rig.reference.entry import Entry

ENTRIES = [
    (
        Entry("key", "settle.phase_deg", ("phase_deg", "settle.phase_deg"), "Largest error.", "a", "default 1"),
        "k.html#a",
    ),
    (Entry("key", "other.phase_deg", ("phase_deg",), "Another.", "b"), "k.html#b"),
    (Entry("message", "lost-lock", ("lost-lock",), "The lock was lost.", "c"), ""),
]


@pytest.fixture
def opened(monkeypatch):
    """Addresses that were opened, on a machine with a screen."""
    addresses: list[str] = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    monkeypatch.delenv("SSH_CONNECTION", raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    return addresses


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A built site with a few words."""
    words.write_words(words.words_of(ENTRIES), tmp_path)
    monkeypatch.setattr(words, "site", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def without_site(monkeypatch):
    monkeypatch.setattr(words, "site", lambda: None)


def test_a_word_opens_its_page_and_prints_address_and_line(folder, opened, command):
    status, out, _ = command("docs settle.phase_deg")
    address = f"{(folder / 'k.html').as_uri()}#a"
    assert (status, opened) == (0, [address])
    assert out.splitlines() == ["settle.phase_deg (key): Largest error.", "    default 1", f"    {address}"]


def test_several_hits_are_listed_and_none_is_opened(folder, opened, command):
    status, out, _ = command("docs phase_deg")
    assert (status, opened) == (0, [])
    assert "settle.phase_deg (key)" in out
    assert "other.phase_deg (key)" in out
    assert out.splitlines()[-1] == "rig docs settle.phase_deg opens the first"


def test_a_message_without_a_page_is_printed(folder, opened, command):
    status, out, _ = command("docs lost lock")
    assert (status, out, opened) == (0, "lost-lock (message): The lock was lost.\n", [])


def test_alone_it_opens_the_home_page(folder, opened, command):
    status, out, _ = command("docs")
    assert (status, opened) == (0, [(folder / "index.html").as_uri()])
    assert out.strip() == opened[0]


def test_an_unknown_word_is_one_line_with_the_closest(folder, opened, command):
    status, _, err = command("docs phse_deg")
    assert (status, opened) == (1, [])
    assert err == "rig: WORD = 'phse_deg': nothing of this name; closest: settle.phase_deg\n"


@pytest.mark.parametrize("setting", [("SSH_CONNECTION", "10.0.0.1"), ("DISPLAY", "")])
def test_without_a_screen_the_address_is_printed_and_nothing_opened(folder, opened, command, monkeypatch, setting):
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv(*setting)
    status, out, _ = command("docs settle.phase_deg")
    assert (status, opened) == (0, [])
    assert "k.html#a" in out


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("settle.average_periods", "default `10`, allowed: 1 to 64"),
        ("rig stop", "Ramp runs down"),
        ("--override-rehearsal", "rig run --override-rehearsal (option)"),
        ("identification.linear_modes", "Identify linear modes"),
        ("force-limit", "force above its limit"),
    ],
)
@pytest.mark.usefixtures("without_site")
def test_without_a_site_it_prints_what_the_code_says_and_how_to_build(command, opened, word, expected):
    status, out, err = command("docs", word)
    assert (status, opened) == (0, [])
    assert expected in out
    assert err.strip() == BUILD


@pytest.mark.usefixtures("without_site")
def test_without_a_site_and_a_word_it_says_how_to_build(command):
    status, _, err = command("docs")
    assert status == 1
    assert err == f"rig: {BUILD}\n"
