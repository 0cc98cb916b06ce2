"""Words and what they lead to, written with a site and read back; messages without a page are known too."""

import pytest

from rig.cli.app import app
from rig.errors import RecordingError
from rig.reference.entry import Entry
from rig.reference.messages import message_entries
from rig.reference.words import WORDS_FILE, closest, found, known_words, read_words, words_of, write_words
from tests.refused import refused

ENTRIES = [
    (
        Entry("key", "settle.phase_deg", ("phase_deg", "settle.phase_deg"), "Largest error.", "a", "default 1"),
        "k.html#a",
    ),
    (Entry("key", "other.phase_deg", ("phase_deg",), "Another.", "b"), "k.html#b"),
    (Entry("message", "lost-lock", ("lost-lock", "lost lock"), "The lock was lost.", "c"), ""),
]


def test_words_are_written_and_read_back(tmp_path):
    words = words_of(ENTRIES)
    write_words(words, tmp_path)
    assert read_words(tmp_path) == words


@pytest.mark.parametrize("text", ["", "[1]", '{"word": [{"what": 1}]}', "{"])
def test_a_damaged_list_is_one_clear_line(tmp_path, text):
    (tmp_path / WORDS_FILE).write_text(text)
    with refused(RecordingError, "not-list-of-words-build-the"):
        read_words(tmp_path)


@pytest.mark.parametrize("asked", ["lost-lock", "LOST_LOCK", "lost lock", "Lost-Lock"])
def test_hyphens_underscores_and_spaces_count_as_alike(asked):
    assert [hit.title for hit in found(words_of(ENTRIES), asked)] == ["lost-lock"]


def test_a_word_may_lead_to_several_things_and_a_full_name_to_one():
    words = words_of(ENTRIES)
    assert len(found(words, "phase_deg")) == 2
    assert len(found(words, "settle.phase_deg")) == 1


def test_the_closest_words_contain_it_or_are_spelled_alike():
    words = words_of(ENTRIES)
    assert closest(words, "phase") == ["settle.phase_deg"]
    assert closest(words, "lost-lok") == ["lost-lock"]
    assert closest(words, "xyzzy") == []


def test_the_code_knows_commands_options_keys_messages_and_names():
    from typer.main import get_command

    words = known_words(get_command(app))
    for word, what in {
        "rig run": "command",
        "analyse modes": "command",
        "--monitor": "option",
        "settle.phase_deg": "key",
        "limits": "table",
        "not-settled": "message",
        "daq-timeout": "message",
        "force limit": "message",
        "phase lock lost": "message",
        "identification.linear_modes": "name",
    }.items():
        assert what in {hit.what for hit in found(words, word)}, word


def test_a_message_that_is_a_reason_and_a_quality_has_one_page():
    entries = {entry.title: entry for entry in message_entries()}
    assert len(entries) == len(list(message_entries()))
    assert "end of a run" in entries["lost-lock"].line
    assert "quality of a point" in entries["lost-lock"].line
    assert all(entry.line for entry in entries.values())
