"""What a run would take, against runs that were carried out; and what arms a bench, without opening it."""

import re
import shutil

import pytest

from rig.arming.bench_memory import RememberedTrip, now, remember
from rig.bench import load_bench
from rig.campaigns.plans import bench_of, load_plan
from rig.campaigns.running.dry_run import dry_run, expected_duration
from tests.recorded import SHORT, changed, recorded_run
from tests.rig.rigs import bench_with

PLANS = {
    "magnet-beam/backbone": SHORT,
    "magnet-beam/continuous-backbone": {},
    "magnet-beam/sweep-1": {"start_hz": 22.0, "stop_hz": 26.0, "rate_hz_per_s": 4.0},
}


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("name", PLANS)
def test_a_run_takes_as_long_and_as_much_as_was_said(name, place):
    plan = changed(name, **PLANS[name])
    bench = bench_of(plan, name)
    found = dry_run(plan, bench, place / "run.h5")
    with recorded_run(name, **PLANS[name]) as run:
        rows = run.recording.n_rows
        took_s = rows / bench.sample_rate_hz
        size = run.recording.path.stat().st_size
    assert 0.9 * found.least.duration_s < took_s < 1.1 * found.most.duration_s
    assert took_s < 1.3 * found.least.duration_s + 0.5  # these settle soon
    assert 0.3 * found.least.disk_bytes < size < 1.1 * found.most.disk_bytes + 200_000  # a file is compressed
    assert found.points == len(plan.targets())


def test_the_lines_say_levels_duration_periods_space_and_that_nothing_was_driven(place):
    found = dry_run(load_plan("magnet-beam/continuous-backbone"), load_bench("magnet-beam"), place / "run.h5")
    lines = found.lines()
    assert [line.split()[0] for line in lines[:6]] == ["plan", "levels", "duration", "periods", "disk", "arming"]
    assert lines[1].startswith("levels    13: 0.1144, ")
    assert lines[1].endswith(" mm")
    assert lines[-1] == "nothing was driven"
    assert found.free_bytes == pytest.approx(shutil.disk_usage(place).free, rel=0.05)


def test_of_a_bench_that_moves_it_is_said_who_arms_it_and_what_speaks_against_it(place):
    bench = bench_with({"driver": {"name": "serial", "options": {"port": "/dev/none"}}})
    plan = changed("magnet-beam/backbone", **SHORT)
    arming = dry_run(plan, bench, place / "run.h5").arming
    assert arming[0].startswith("a person at a terminal")
    assert any("never checked" in line for line in arming[1:])
    remember(bench, trip=RememberedTrip(now(), "force beyond its limit", "run.h5"))
    assert any("the last run tripped: force beyond its limit" in line for line in dry_run(plan, bench, place).arming)
    automated = bench.model_copy(update={"arming": bench.arming.model_copy(update={"automated": True})})
    assert "[arming] automated" in dry_run(plan, automated, place).arming[0]


def test_a_dry_run_writes_nothing_and_a_run_wants_a_file(command, place, monkeypatch):
    monkeypatch.chdir(place)
    status, out, err = command("run magnet-beam/backbone --dry-run -o run.h5")
    assert (status, err) == (0, "")
    assert out.endswith("nothing was driven\n")
    assert not (place / "run.h5").exists()
    status, out, err = command("run magnet-beam/backbone")
    assert (status, out) == (2, "")
    assert "--output: missing: the file of the recording, such as -o run.h5, or --dry-run" in err


def test_how_long_a_run_takes_is_that_of_its_sweep_and_faster_on_a_virtual_rig():
    """10 to 40 Hz at 0.25 Hz/s last 120 s, beside ramps and holds of some seconds."""
    plan, bench = load_plan("magnet-beam/sweep-1"), load_bench("magnet-beam")
    assert re.fullmatch(r"about 2 min \d s", expected_duration(plan, bench, by_the_clock=True))
    assert re.fullmatch(
        r"some \d s to 1\d s .* for 2 min \d s of test", expected_duration(plan, bench, by_the_clock=False)
    )
