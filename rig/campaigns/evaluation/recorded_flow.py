"""Slow flow of recorded rows, and the instants of it that are unusable."""

import numpy as np

from identification import SlowFlow, slow_flow
from rig.bench import Bench
from rig.campaigns.evaluation.lost_samples import bridged, lost_rows, too_many_lost, windows
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.vibrations import channels_of
from rig.campaigns.planning.drive_shape import drive_shape
from rig.campaigns.planning.plant import PlantFacts
from rig.tick.layout import FREQUENCY_CLAMPED, SATURATED, SENSOR_AT_RANGE

AT_VOLTAGE_LIMIT = "the output was at its voltage limit"
SAMPLES_LOST = "samples were lost in transmission"

HALF_WINDOW_PERIODS = 1.5  # of the demodulation: how far its window reaches to either side of an instant


def recorded_flow(
    bench: Bench,
    rows: Rows,
    harmonics: int,
    plant: PlantFacts | None,
    *,
    other_modes: bool = True,
    residual_m_n: float | None = None,
) -> SlowFlow:
    """Compute the slow flow of recorded rows.

    The skew of the channels is removed. If the plant is known, the mode shape at the drive point is the measured one, and with
    ``other_modes`` the contribution of its other modes is removed too; ``residual_m_n`` replaces their receptance at the mode's
    frequency by that at another. Raises `identification.IdentificationError` if the rows
    contain no vibration.
    """
    known = plant.residual_m_n if plant is not None and other_modes else 0.0
    return slow_flow(
        rows["theta_rad"].astype(float),
        bridged(rows).T,
        channels_of(bench),
        sample_rate_hz=bench.sample_rate_hz,
        drive_mode_shape=drive_shape(bench, plant).value or 0.0,
        harmonics=harmonics,
        skew_samples=[channel.skew_samples for channel in bench.channels],
        residual_m_n=known if residual_m_n is None else residual_m_n,
    )


def flagged(bench: Bench, rows: Rows, flow: SlowFlow) -> dict[str, np.ndarray]:
    """Return the unusable instants by reason, bool[n] each.

    An instant is unusable if, within its window, the output, the frequency or a sensor was at a limit, or more than 2 % of the
    samples were lost; fewer are filled in.
    """
    first, end = windows(flow.time_s, HALF_WINDOW_PERIODS / flow.frequency_hz, bench.sample_rate_hz, rows.size)
    out = {}
    for reason, bit in (
        (AT_VOLTAGE_LIMIT, SATURATED),
        ("the frequency was at an end of its window", FREQUENCY_CLAMPED),
        ("a sensor was near its range", SENSOR_AT_RANGE),
    ):
        count = np.concatenate([[0], np.cumsum((rows["flags"] & bit) != 0)])
        out[reason] = count[end] > count[first]
    out[SAMPLES_LOST] = too_many_lost(lost_rows(rows), first, end)
    return out
