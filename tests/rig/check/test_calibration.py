"""Calibration of sensors in a check, in what `rig show` prints, and in a report."""

import pytest

import rig
from rig.check.assessment import calibration_findings
from rig.report.report import write_report
from rig.show.summary import summarise
from rig.show.tables import print_summary
from tests.rig.report.page import read
from tests.rig.rigs import bench_with

SENSOR = {"sensor": "Example F20", "serial_number": "F1", "calibrated": "2024-02-29", "certificate": "no. 17"}


def bench(due, **changes):
    """The magnet beam whose force sensor is due on a day, on its data sheet; the drive's is due in the year 2999."""
    channels = list(bench_with().model_dump(mode="json")["channels"])
    for key in ("sensitivity_v_per_unit", "unit"):
        del channels[0][key]
    channels[0] |= {**SENSOR, "calibration_due": due, "sensitivity": "1.124 pC/N", "amplifier_gain": "100 mV/pC"}
    channels[1] |= {"calibration_due": "2999-12-31"}
    return bench_with({"channels": channels, **changes})


@pytest.mark.parametrize(
    ("due", "required", "verdict", "days"),
    [
        ("2026-03-01", False, "ok", 1.0),
        ("2026-02-28", False, "ok", 0.0),
        ("2026-02-27", False, "warn", -1.0),
        ("2025-02-28", True, "fail", -365.0),
    ],
)
def test_a_calibration_counts_up_to_its_day_and_is_a_warning_or_a_failure_after_it(due, required, verdict, days):
    found = calibration_findings(bench(due, arming={"require_calibration": required}), "2026-02-28")
    assert [(one.name, one.channel, one.verdict) for one in found] == [
        ("calibration", "force", verdict),
        ("calibration", "drive", "ok"),
    ]
    assert found[0].value == days
    assert (f"was due on {due}, of sensor F1" in found[0].text) == (verdict != "ok")


def test_a_bench_without_dates_has_no_finding():
    assert calibration_findings(bench_with(), "2026-02-28") == []


def test_a_recording_holds_what_was_known_of_its_sensors_for_show_and_report(tmp_path, capsys):
    path = tmp_path / "run.h5"
    rig.run("magnet-beam/backbone-short", bench=bench("2025-02-28"), output=path).close()
    summary = summarise(path)
    assert summary["sensors"][0] == {
        **{"channel": "force", "sensitivity": "1.124 pC/N", "amplifier_gain": "100 mV/pC", **SENSOR},
        **{"calibration_due": "2025-02-28", "overdue": True},
    }
    print_summary(summary)
    line = "sensor of force: Example F20, no. F1, 1.124 pC/N, 100 mV/pC, calibrated 2024-02-29, due 2025-02-28"
    assert f"{line}, certificate no. 17 (overdue)" in capsys.readouterr().out
    write_report([path], tmp_path / "report.html")
    (row,) = [row for row in read(tmp_path / "report.html").rows() if "F1" in row]
    assert row[2:5] == ["Example F20", "F1", "1.124 pC/N x 100 mV/pC"]
    assert row[6:] == ["2024-02-29 (no. 17)", "2025-02-28 (overdue)"]
