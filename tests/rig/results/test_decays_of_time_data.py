"""Free decays of others, imported as time data."""

import numpy as np
import pytest

from identification import Channel, TimeRecord, TimeRecords
from rig.errors import ConfigurationError
from rig.results.decay_backbone.options import DecayOptions
from rig.results.files import save
from rig.results.identify import identify_model
from tests.refused import refused

RATE_HZ, FREQUENCY_HZ, DAMPING = 1000.0, 20.0, 0.01


@pytest.fixture
def file(tmp_path):
    """Two records of a linear mode, the exact solution from 1 and 2 mm."""
    times = np.arange(0.0, 8.0, 1.0 / RATE_HZ)
    rate = 2.0 * np.pi * FREQUENCY_HZ * DAMPING
    turning = 2.0 * np.pi * FREQUENCY_HZ * np.sqrt(1.0 - DAMPING**2)
    noise = np.random.default_rng(1).normal(size=(2, times.size))
    records = []
    for number, (start, one) in enumerate(zip((1e-3, 2e-3), noise, strict=True), 1):
        motion = start * np.exp(-rate * times) * np.cos(turning * times) + 1e-7 * one
        records.append(TimeRecord(samples=motion[None], name=f"decay {number}"))
    path = tmp_path / "decays.h5"
    save(TimeRecords(channels=(Channel("tip", "drive", "m"),), sample_rate_hz=RATE_HZ, records=tuple(records)), path)
    return path


def test_a_record_of_time_data_has_the_frequency_and_damping_of_its_mode(file):
    found = identify_model([file], DecayOptions(near="20", point=2)).mode()
    assert found.amplitude_m[0] > 0.6e-3  # the second record; the first begins at half of that
    np.testing.assert_allclose(found.modal_frequency_hz[:8], FREQUENCY_HZ, rtol=2e-4)
    np.testing.assert_allclose(found.damping_ratio[:8], DAMPING, rtol=2e-2)


@pytest.mark.parametrize(
    ("point", "said"), [(None, {"says": "point-is-missing-has-records"}), (3, {"says": "point-has-records"})]
)
def test_a_record_that_is_not_there_is_refused(file, point, said):
    with refused(ConfigurationError, **said):
        identify_model([file], DecayOptions(point=point))
