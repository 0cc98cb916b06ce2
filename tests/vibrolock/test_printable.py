"""What goes to a terminal: no text of a file or a device moves its cursor, and no line is longer than a person reads."""

import pickle
from importlib import import_module

import pytest

from rig.errors import ConfigurationError, DaqError
from rig.show.progress import RunProgress
from rig.show.tables import print_summary
from rig.text.console import print_table
from vibrolock.printable import LONGEST_LINE, one_line, printable, shown


def test_control_and_direction_characters_are_shown_by_their_escape():
    assert printable("a\x1b[31mb\x07\u202ec\udc80") == r"a\x1b[31mb\x07\u202ec\udc80"
    assert printable("5 m/s², 24\u00a0Hz") == "5 m/s², 24\u00a0Hz"


def test_the_line_of_an_error_is_printable_and_bounded_and_keeps_both_ends():
    line = str(ConfigurationError(f"plan.toml: name = '{'x' * 5_000_000}\x1b[2J': allowed is\na short one"))
    assert line.isprintable()
    assert len(line) < LONGEST_LINE + 60
    assert line.startswith("plan.toml: name = 'xxx")
    assert line.endswith(r"\x1b[2J': allowed is a short one")
    assert one_line(line) == line


def test_an_error_crosses_to_another_process_as_it_is():
    error = DaqError("port \x1b[2J: gone")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == r"port \x1b[2J: gone"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.5, "1.5"),
        ("ok", "'ok'"),
        ("a\x1b" * 50, repr("a\x1b" * 15) + "... (100 characters)"),
        ([1.0] * 10_000, "a list (10000 items)"),
        ({str(n): n for n in range(100)}, "a table (100 items)"),
    ],
)
def test_a_value_in_a_message_is_short(value, text):
    assert shown(value).startswith(text)


def test_a_number_of_more_digits_than_python_prints_has_a_message_too():
    assert shown(10**5000).startswith("a value that cannot be shown")


def test_remarks_and_tables_cannot_move_the_cursor(capsys, monkeypatch):
    RunProgress().remark("device says \x1b[2J")
    print_table(("name\x1b[1m",), [("\x1b]0;title\x07",)])
    streams = capsys.readouterr()
    assert "\x1b" not in streams.err + streams.out
    assert r"note: device says \x1b[2J" in streams.err
    assert r"\x1b]0;title\x07" in streams.out


def test_the_summary_of_a_file_shows_names_in_it_escaped(capsys):
    finding = {"name": "n", "channel": "\x1b[5m", "verdict": "ok", "value": 1.0, "unit": "", "allowed": "", "text": ""}
    head = {
        "kind": "check",
        "bench": "b\x1b[31m",
        "specimen": "s\x07",
        "recording": "check.h5",
        "level_rms_v": None,
        "mode": None,
        "verdict": "passed",
        "failed": [],
        "integrity": "verified",
    }
    print_summary({**head, "findings": [finding]})
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert r"check of s\x07 (bench b\x1b[31m)" in out


def test_an_error_that_is_not_ours_is_one_printable_line_too(command, monkeypatch):
    def failing(*_, **__):
        raise ValueError("bad\x1b[2J" + "x" * 100_000)

    monkeypatch.setattr(import_module("rig.cli.app"), "command_of", lambda _: failing)
    status, _, err = command("list")
    assert status == 1
    assert err.startswith(r"rig: unexpected ValueError: bad\x1b[2Jxxx")
    assert err.rstrip().endswith("(run again with --debug for the details)")
    assert len(err) < 1000
