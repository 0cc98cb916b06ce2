"""The dwell campaign: its declaration, and the course of a dwell in a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.campaigns.campaign import Campaign
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.dwell.points import DWELL_COLUMNS, measure_mean, watch_drift
from rig.campaigns.evaluation.recorded import accepted_points, specimen_of
from rig.recording.reader import Recording
from rig.text.contents import Contents

__all__ = ["DWELL", "DwellCourse", "recorded_course"]


@dataclass(frozen=True, eq=False)
class DwellCourse:
    """How a specimen aged: float64[n] over the accepted means, at their middle."""

    cycles: NDArray[np.float64]
    """Cycles since the first mean began."""
    time_s: NDArray[np.float64]
    """Seconds since the first mean began, settling at the beginning of further parts left out."""
    frequency_hz: NDArray[np.float64]
    """Frequency at which the phase was held."""
    modal_frequency_hz: NDArray[np.float64]
    """The same without the phase error that was left."""
    damping_ratio: NDArray[np.float64]
    """Modal damping ratio; NaN where the bench knows no mode shape."""
    amplitude_m: NDArray[np.float64]
    """Displacement amplitude of the drive point, m."""
    force_n: NDArray[np.float64]
    """Fundamental of the force, N."""
    specimen: str
    """Name of the specimen."""


def recorded_course(recording: Recording) -> DwellCourse:
    """The accepted means of a recording; raises `identification.IdentificationError` without any."""
    points = list(accepted_points(recording).values())

    def over(key: str) -> NDArray[np.float64]:
        return np.array([np.nan if point.get(key) is None else point[key] for point in points], float)

    return DwellCourse(
        cycles=over("cycles"),
        time_s=over("time_s"),
        frequency_hz=over("frequency_hz"),
        modal_frequency_hz=over("modal_frequency_hz"),
        damping_ratio=over("damping_ratio"),
        amplitude_m=over("amplitude_m"),
        force_n=over("force_n"),
        specimen=specimen_of(recording),
    )


def _table(recording: Recording) -> Contents:
    course = vars(recorded_course(recording))
    arrays = {name: values for name, values in course.items() if name != "specimen"}
    return Contents("dwell", course["specimen"], arrays, {"specimen": course["specimen"]}, dict.fromkeys(arrays, 0))


DWELL = Campaign(
    plan=DwellPlan,
    measure=measure_mean,
    watch=watch_drift,
    columns=DWELL_COLUMNS,
    draw="rig.campaigns.dwell.figure:draw",
    identity=("controller.phase_lag_deg", "mean_s"),
    fixed=("harmonics", "mean_s"),
    measurements={DwellCourse: recorded_course},
    exchanged=lambda recording: [_table(recording)],
)
