"""The figure of stepped phase: curves are broken where lags are missing."""

import numpy as np
from matplotlib.figure import Figure

from identification import FrequencyResponse
from rig.campaigns.stepped_phase.figure import draw_stepped_phase

LAGS_DEG = np.arange(30.0, 151.0, 10.0)


def response(lags_deg):
    displacement = np.full(lags_deg.size, 1e-4 + 0j)
    force = np.exp(1j * np.radians(lags_deg + 0.4))
    return FrequencyResponse(100.0 + 0.01 * lags_deg, force, displacement, "displacement", "none", 1.0, "1 N RMS")


def breaks(measured_deg, **options):
    """Number of breaks in the curve of each axis."""
    page = Figure()
    draw_stepped_phase(page, [response(measured_deg)], **options)
    return [int(np.isnan(axis.lines[0].get_ydata()).sum()) for axis in page.axes]


def test_a_curve_is_broken_where_lags_that_were_asked_for_are_missing():
    missing = LAGS_DEG[~np.isin(LAGS_DEG, [60.0, 110.0, 120.0])]
    assert breaks(missing, lags_deg=LAGS_DEG) == [2, 2, 2]
    assert breaks(missing[::-1], lags_deg=LAGS_DEG) == [2, 2, 2]
    assert breaks(LAGS_DEG, lags_deg=LAGS_DEG) == [0, 0, 0]
    assert breaks(missing) == [0, 0, 0]
