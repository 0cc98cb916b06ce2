"""The linear modal model by itself: which shapes of it are used for a mode, and in which order."""

import numpy as np
import pytest

from identification import Channel, LinearModes

FREQUENCY_HZ = np.array([10.0, 20.0, 40.0, 50.0])
SHAPES = np.array([[1.0, 2.0, 3.0, 4.0], [1.0, -1.0, 5.0, 2.0], [2.0, 1.0, -3.0, 7.0]])
MODES = LinearModes(
    channels=(Channel("drive", "drive", "m/s2"), *(Channel(name, "response", "m/s2") for name in ("tip", "middle"))),
    frequency_hz=FREQUENCY_HZ,
    frequency_std_hz=np.zeros(4),
    damping_ratio=np.full(4, 0.01),
    damping_ratio_std=np.zeros(4),
    shapes=SHAPES,
    shapes_std=np.zeros((3, 4)),
    phase_collinearity=np.ones(4),
    lower=np.zeros(3, complex),
    upper=np.zeros(3, complex),
    lowest_hz=5.0,
    highest_hz=60.0,
)


@pytest.mark.parametrize(
    ("mode", "count", "columns"),
    [
        (0, None, [0, 1, 2]),
        (1, None, [1, 0, 2]),
        (2, None, [2, 3, 1]),
        (3, None, [3, 2, 1]),
        (2, 1, [2]),
        (3, 2, [3, 2]),
    ],
)
def test_shapes_of_a_mode_are_its_own_and_those_of_the_modes_nearest_to_it(mode, count, columns):
    found = MODES.mode_shapes(mode, modes=count)
    np.testing.assert_array_equal(found.shapes, SHAPES[:, columns])
    assert found.channels == ("drive", "tip", "middle")
    assert found.mode == 0
