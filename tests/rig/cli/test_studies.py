"""Commands of the studies: as declared where they are installed, else one line that says how to install them."""

from importlib.metadata import entry_points
from pathlib import Path

import pytest

from rig.system.studies import GROUP, HOW_TO_INSTALL
from tests.studies.installed import entry_points as declared


@pytest.fixture
def without_studies(monkeypatch):
    for module in ("rig.system.studies", "rig.cli.studies"):
        monkeypatch.setattr(f"{module}.find_study", lambda _: None)


def test_what_the_studies_declare_is_found_and_can_be_loaded():
    found = {entry.name: entry.value for entry in entry_points(group=GROUP)}
    assert found == declared()[GROUP]
    assert all(entry.load() for entry in entry_points(group=GROUP))


def test_the_options_of_a_command_are_those_of_the_studies(command):
    text = command("reproduce --help").succeeded().out
    assert text.startswith("Usage: rig reproduce [OPTIONS] ")
    assert "--realisations" in text


@pytest.mark.parametrize(
    ("line", "user"),
    [
        ("reproduce magnet-beam -o look --models 1", "rig reproduce"),
        ("reproduce", "rig reproduce"),
        ("doctor --matrix", "--matrix"),
        ("doctor --matrix -o rows.toml", "--matrix"),
        ("report begun -o report.html", "begun"),
    ],
)
def test_without_them_one_line_says_how_to_install_them(command, without_studies, line, user):
    Path("begun").mkdir()
    done = command(line)
    assert (done.status, done.out) == (1, "")
    assert (
        done.err == f"rig: {user}: needs the distribution vibrolock-studies, which is not installed; {HOW_TO_INSTALL}\n"
    )


def test_help_says_it_too(command, without_studies):
    assert HOW_TO_INSTALL in " ".join(command("reproduce --help").succeeded().out.split())
    assert "reproduce" in command("--help").succeeded().out
