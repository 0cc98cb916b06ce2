"""The dwell campaign: its declaration, and the course of a dwell in a recording."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.campaigns.campaign import Campaign
from rig.campaigns.dwell.plan import DwellPlan
from rig.campaigns.dwell.points import DWELL_COLUMNS, DwellResult, measure_mean, watch_drift
from rig.campaigns.evaluation.point import vibration_of
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
    points = accepted_points(recording, DwellResult)
    vibrations = [vibration_of(point) for point in points]
    results, modal = [point.result for point in points], [point.modal for point in points]
    return DwellCourse(
        cycles=_column(None if result is None else result.cycles for result in results),
        time_s=_column(None if result is None else result.time_s for result in results),
        frequency_hz=_column(vibration.frequency_hz for vibration in vibrations),
        modal_frequency_hz=_column(None if one is None else one.modal_frequency_hz for one in modal),
        damping_ratio=_column(None if one is None else one.damping_ratio for one in modal),
        amplitude_m=_column(vibration.amplitude_m for vibration in vibrations),
        force_n=_column(vibration.force_n for vibration in vibrations),
        specimen=specimen_of(recording),
    )


def _table(recording: Recording) -> Contents:
    course = vars(recorded_course(recording))
    arrays = {name: values for name, values in course.items() if name != "specimen"}
    return Contents("dwell", course["specimen"], arrays, {"specimen": course["specimen"]}, dict.fromkeys(arrays, 0))


def _column(values: Iterable[float | None]) -> NDArray[np.float64]:
    """NaN where there is no value."""
    return np.array([np.nan if value is None else value for value in values], float)


DWELL = Campaign(
    plan=DwellPlan,
    result=DwellResult,
    measure=measure_mean,
    watch=watch_drift,
    columns=DWELL_COLUMNS,
    draw="rig.campaigns.dwell.figure:draw",
    identity=("controller.phase_lag_deg", "mean_s"),
    fixed=("harmonics", "mean_s"),
    measurements={DwellCourse: recorded_course},
    exchanged=lambda recording: [_table(recording)],
)
