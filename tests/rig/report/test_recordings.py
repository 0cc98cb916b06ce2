"""A report on recordings: all kinds, with the numbers of `rig show`, and safe whatever the recording says."""

import hashlib
import os
import subprocess
import sys

import pytest

import rig
from rig.campaigns.kinds import KINDS
from rig.recording.journal import journal_path
from rig.report.report import write_report
from rig.show.summary import summarise
from rig.show.tables import print_summary
from rig.text.console import PrintedTable, collected
from tests.forking import FORKED
from tests.rig.report.conftest import HOSTILE, short
from tests.rig.report.page import read

KILLED = """
import os, rig
from rig.arming.run_options import Silent
from tests.rig.report.conftest import short

class Killed(Silent):
    def point(self, point, number, total):
        os._exit(9)

rig.run(short("magnet-beam/backbone"), output="cut.h5", progress=Killed())
"""


def shown(path):
    """Table of points and lines, as `rig show` prints them."""
    with collected() as printed:
        print_summary(summarise(path))
    table = next(one for one in printed if isinstance(one, PrintedTable))
    return table, [one for one in printed if isinstance(one, str)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_point_of_every_kind_stands_in_it_with_the_numbers_of_rig_show(kind, recordings, tmp_path):
    write_report([recordings[kind]], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    table, _ = shown(recordings[kind])
    assert table.rows
    rows = page.rows()
    for row in table.rows:
        expected = [row[0], row[1], *row[3:-1]] if table.headings[-1] == "remark" else [row[0], row[1], *row[3:]]
        assert expected in rows
    assert "svg" in page.seen
    for words in ("What was tested", "Bench and sensors", "Keys of the plan", "How the loop kept its time", "SHA-256"):
        assert words in page.text


def test_who_tested_what_with_which_sensors_by_which_software(hostile, tmp_path):
    write_report([hostile], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    rows = page.rows()
    (sensor,) = [row for row in rows if "SN & 4711" in row]
    assert sensor[2] == "PCB <i>208C02</i>"
    assert sensor[6:] == ["2020-01-15", "2021-01-15 (overdue)"]
    assert ["operator", "<a href='http://example.org'>Eve</a>"] in rows
    assert ["specimen serial", "<&>"] in rows
    digest = hashlib.sha256(hostile.read_bytes()).hexdigest()
    assert [hostile.name, str(hostile.stat().st_size), digest] in rows
    assert ["seed", "0"] in rows
    assert ["controller.k1", "2"] in rows


def test_text_of_a_recording_is_text_and_nothing_else(hostile, tmp_path):
    write_report([hostile], tmp_path / "report.html", title="<script>")
    page = read(tmp_path / "report.html")
    assert not page.seen & {"b", "i"}
    assert HOSTILE.replace("\u202e", "\\u202e") in page.text
    assert "</table><img src=x onerror=alert(2)>" in page.text
    assert "<style>*{}</style>" in page.text
    assert "\u202e" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_what_was_refused_stands_there_with_its_reason(tmp_path):
    plan = short("magnet-beam/backbone").model_copy(update={"accepted_phase_error_deg": 1e-6})
    rig.run(plan, output=tmp_path / "refused.h5").close()
    write_report([tmp_path / "refused.h5"], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    points = summarise(tmp_path / "refused.h5")["points"]
    assert [point["accepted"] for point in points] == [False, False]
    for n, point in enumerate(points, 1):
        assert [f"point {n}", f"{point['level']:g} V", point["quality"], point["reason"]] in page.rows()
    assert "0 of 2 points accepted" in page.text


def test_a_run_that_was_cut_short_is_reported_from_its_journal(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", FORKED + KILLED], check=False, cwd=tmp_path, env=environment)
    path = tmp_path / "cut.h5"
    assert journal_path(path).exists()
    assert not path.exists()
    write_report([path], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    assert "cut short, without a record of the end" in page.text
    assert any(row[0] == journal_path(path).name for row in page.rows() if row)


@pytest.mark.slow
def test_several_recordings_of_a_kind_are_compared_and_listed(recordings, hostile, tmp_path):
    write_report([recordings["sweep"], recordings["backbone"], hostile], tmp_path / "report.html")
    page = read(tmp_path / "report.html")
    assert page.headings.count("h2") == 1 + 4  # contents, comparison, three files
    assert "Comparison of 2 backbone recordings" in page.text
    assert "sweep recordings" not in page.text
