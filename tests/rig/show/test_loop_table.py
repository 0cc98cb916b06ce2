"""What `rig show` and `rig plot` tell of a loop by the wall clock, against what the recording holds."""

import numpy as np
import pytest

import rig
from rig.campaigns.sweep.plan import SweepPlan
from rig.errors import RecordingError
from rig.figures.files import plot
from rig.figures.lateness import exceedance, together
from rig.recording.reader import Recording
from rig.show.loop_table import print_loop
from rig.show.summary import summarise
from rig.show.tables import print_summary
from tests.refused import refused
from tests.rig.rigs import bench_with

PLAN = SweepPlan(bench="magnet-beam", levels_v=(0.4,), start_hz=20.0, stop_hz=22.0, rate_hz_per_s=2.0)


@pytest.fixture(scope="module")
def paced(tmp_path_factory):
    """A recording of a loop in a process of its own, in blocks of 0.1 s so that no machine is late."""
    path = tmp_path_factory.mktemp("paced") / "paced.h5"
    rig.run(PLAN, bench=bench_with({"block": 500}), output=path, realtime=True).close()
    return path


def test_show_prints_what_is_recorded_of_the_clock(paced, capsys):
    summary = summarise(paced)
    with Recording(paced) as recording:
        end = recording.parts[0].end
    assert summary["parts"][0]["loop"] == end["loop"]
    assert summary["parts"][0]["counters"] == end["counters"]
    print_summary(summary)
    out = capsys.readouterr().out
    assert f"paced by the host; scheduling {end['loop']['real_time']['scheduling']}; memory " in out
    (row,) = [line.split() for line in out.splitlines() if line.strip().startswith("response")]
    shares = ("p50", "p99", "p99_9", "largest")
    assert [float(cell) for cell in row[1:]] == pytest.approx([end["loop"]["response_us"][s] for s in shares], abs=0.06)
    blocks = sum(end["loop"]["histograms"]["response"]["count"])
    assert (
        f"{end['loop']['overruns']} overruns in {blocks} blocks (response beyond 100000 us, or left out), 0 lost" in out
    )


def test_the_lateness_is_drawn_where_a_clock_paced_the_loop_and_else_refused(command, paced, tmp_path):
    command("plot", paced, "--lateness", "-o", "late.png").succeeded()
    assert (tmp_path / "late.png").stat().st_size > 10_000
    rig.run(PLAN, output=tmp_path / "quick.h5").close()
    with refused(RecordingError, "quick-its-loop-did-not-run"):
        plot(tmp_path / "quick.h5", tmp_path / "quick.png", lateness=True)


def test_histograms_of_parts_are_joined_and_their_share_beyond_is_that_of_the_times():
    one = {"upper_edge_us": [1.0, 4.0], "count": [3, 1]}
    other = {"upper_edge_us": [2.0, 4.0], "count": [5, 1]}
    edges, counts = together([one, other])
    assert edges.tolist() == [1.0, 2.0, 4.0]
    assert counts.tolist() == [3.0, 5.0, 2.0]
    times = np.repeat(edges, counts.astype(int))
    wanted = [np.mean(times > 1.0), np.mean(times > 2.0)]
    assert exceedance(counts)[:2] == pytest.approx(wanted)
    assert np.isnan(exceedance(counts)[2])


def test_a_loop_on_the_device_has_no_times_of_blocks(capsys):
    said = {"pacing": "device", "loop": "device", "scheduling": "SCHED_FIFO 80"}
    print_loop({"real_time": said, "overruns": 0, "round_trip_p50_us": 120.0}, {"lost_samples": 300})
    assert [line.strip() for line in capsys.readouterr().out.splitlines()] == [
        "the loop ran on the device, its rows were collected; scheduling SCHED_FIFO 80",
        "300 lost samples",
        "round trip to the device: p50 120 us",
    ]
