"""Runs where disk, folder, name, locale or clock are not as they should be."""

import sys

import pytest

from tests.reliability.places.scenes import SCENES

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="limits of files and SIGSTOP are not there on Windows")
SHORT = (
    "full disk after 5000 bytes",
    "full disk after 300000 bytes",
    "output called 'line",
    "output called 'not-utf8",
    "name too long",
    "locale POSIX, ASCII output",
    "no state",
    "no folder",
    "journal removed",
    "folder removed",
    "two runs to one output",
)
"""Of every kind some; the command goes through all."""


@pytest.mark.parametrize("scene", [name for name in SCENES if name.startswith(SHORT)])
def test_nothing_is_lost_and_one_line_says_why(tmp_path, scene):
    assert SCENES[scene](tmp_path) == []


def test_every_scene_that_is_meant_is_there():
    assert all(any(name.startswith(short) for name in SCENES) for short in SHORT)
