"""Runs where disk, folder, name, locale or clock are not as they should be."""

import sys

import pytest

from tests.reliability.places.scenes import SCENES

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="limits of files and SIGSTOP are not there on Windows")
LONG = (
    "full disk after 1 ",
    "full disk after 40 ",
    "full disk after 100000 ",
    "output called '-",
    'output called "a',
    "another time",
)
"""Left to the command: another scene nearly shows them."""


@pytest.mark.parametrize("scene", [name for name in SCENES if not name.startswith(LONG)])
def test_nothing_is_lost_and_one_line_says_why(tmp_path, scene):
    assert SCENES[scene](tmp_path) == []
