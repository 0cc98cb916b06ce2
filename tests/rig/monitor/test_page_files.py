"""The page's files: scripts that are whole, foreign ones that are what they say, nothing in line."""

import hashlib
import re
import shutil
import subprocess

import pytest

from rig.monitor.server import PAGE, UPLOT

SCRIPTS = sorted(PAGE.glob("*.js"))
FOREIGN = UPLOT


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed; the tests in a browser read them, too")
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_script_is_whole(script):
    command = ["node", "--check", "--input-type=module"]
    done = subprocess.run(
        command, input=script.read_text(encoding="utf-8"), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_foreign_files_are_those_of_their_source():
    told = dict(
        reversed(line.split()) for line in re.findall(r"^[0-9a-f]{64}  .*$", (FOREIGN / "SOURCE").read_text(), re.M)
    )
    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in FOREIGN.iterdir()}
    assert told == {name: digest for name, digest in files.items() if name != "SOURCE"}


def test_nothing_stands_in_line_that_the_policy_forbids():
    page = (PAGE / "index.html").read_text(encoding="utf-8")
    assert not re.search(r"<style|<script(?![^>]*src=)|\s(style|on\w+)=", page)
    assert not re.search(r"https?://(?!www\.w3\.org)", page)


def test_the_page_fetches_nothing_from_elsewhere():
    for path in (*SCRIPTS, PAGE / "monitor.css"):
        assert not re.search(r"https?://|@import|url\(", path.read_text(encoding="utf-8")), path


def test_what_the_page_and_its_scripts_name_is_there():
    page = (PAGE / "index.html").read_text(encoding="utf-8")
    served = {path.name for folder in (PAGE, UPLOT) for path in folder.iterdir()}
    assert set(re.findall(r'"/page/([^"]+)"', page)) <= served
    for path in SCRIPTS:
        assert set(re.findall(r'from "\./([^"]+)"', path.read_text(encoding="utf-8"))) <= served
