"""The sweep campaign: its declaration, and the sweeps in a recording."""

from identification import Transient
from rig.campaigns.campaign import Campaign
from rig.campaigns.evaluation.recorded import accepted_points, bench_of_recording, point_rows
from rig.campaigns.sweep.plan import SweepPlan
from rig.campaigns.sweep.points import SWEEP_COLUMNS, SweepResult, measure_sweep, transient_of
from rig.recording.reader import Recording

__all__ = ["SWEEP", "recorded_sweeps"]


def recorded_sweeps(recording: Recording) -> dict[int, Transient]:
    """Fundamentals over time of every accepted sweep, by the stored number of its point, which counts from 0.

    The output is channel ``voltage``.
    """
    bench = bench_of_recording(recording)
    return {
        point.number: transient_of(bench, point_rows(recording, point.number))
        for point in accepted_points(recording, SweepResult)
    }


SWEEP = Campaign(
    plan=SweepPlan,
    result=SweepResult,
    measure=measure_sweep,
    columns=SWEEP_COLUMNS,
    draw="rig.campaigns.sweep.figure:draw",
    identity=("start_hz", "stop_hz", "rate_hz_per_s", "rate_octaves_per_min"),
    measurements={Transient: recorded_sweeps},
    exchanged=lambda recording: list(recorded_sweeps(recording).values()),
    experiments="sweeps",
)
