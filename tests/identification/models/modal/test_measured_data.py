"""Response-controlled levels of a measured beam predict its force-controlled responses."""

import os
from pathlib import Path

import numpy as np
import pytest

from identification import FrequencyResponse, compare, frequency_response, recorded_force_response, stepped_sine_mode
from rig.exchange.reading import read_frequency_responses

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "brake-reuss-mapping.toml"


@pytest.fixture(scope="module")
def measured() -> tuple[FrequencyResponse, ...]:
    folder = os.environ.get("VIBROLOCK_DATA")
    path = Path(folder or ".") / "ForcedFrequencyResponses.mat"
    if folder is None or not path.is_file():
        pytest.skip(
            "set VIBROLOCK_DATA to a folder that holds ForcedFrequencyResponses.mat "
            "from https://github.com/mattiacenedese/BRBtesting (measured data, GPL-3.0, not shipped)"
        )
    return read_frequency_responses(path, EXAMPLE)


def test_peaks_at_the_nominal_force_are_predicted_within_five_percent(measured: tuple[FrequencyResponse, ...]) -> None:
    mode = stepped_sine_mode(measured)
    for reference in measured[:4]:
        nominal = float(np.median(reference.force_n))
        error = compare(frequency_response(mode, nominal), reference).error
        assert abs(error.peak_error) < 0.05
        assert abs(error.peak_frequency_error) < 0.0025
        assert error.range_use < 0.9


def test_with_the_recorded_force_the_upper_levels_are_predicted_within_three_percent(
    measured: tuple[FrequencyResponse, ...],
) -> None:
    mode = stepped_sine_mode(measured)
    for reference in measured[1:4]:
        error = compare(recorded_force_response(mode, reference), reference, phase_window_deg=60.0).error
        assert abs(error.peak_error) < 0.03
        assert abs(error.peak_frequency_error) < 0.002
        assert error.envelope_error < 0.05
