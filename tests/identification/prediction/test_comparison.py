import json
from dataclasses import replace

import numpy as np
import pytest

from identification import (
    FrequencyResponse,
    IdentificationError,
    PredictionError,
    SteadyPrediction,
    compare,
    error_table,
    frequency_response,
)
from identification.channels import Motion
from tests.identification.models.modal.modes import duffing, mode_with
from tests.refused import refused

Q = np.linspace(0.5e-3, 12e-3, 12)


def as_reference(found: SteadyPrediction, kind: Motion = "displacement", scale: float = 1.0) -> FrequencyResponse:
    """What a perfect test, sensor of ``kind``, would have measured."""
    s = 2j * np.pi * found.frequency_hz
    response = scale * found.motion_m() * s ** {"displacement": 0, "velocity": 1, "acceleration": 2}[kind]
    return FrequencyResponse(
        found.frequency_hz, found.fundamental_n.astype(complex), response, kind, "force", found.force_n, "1 N up"
    )


@pytest.mark.parametrize("kind", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("over", ["frequency", "phase"])
def test_a_prediction_has_no_error_against_itself(kind: Motion, over: str) -> None:
    found = frequency_response(mode_with(Q), 0.5)
    result = compare(found, as_reference(found, kind), over=over)  # type: ignore[arg-type]
    for value in (result.error.peak_error, result.error.peak_frequency_error, result.error.envelope_error):
        assert abs(value) < 1e-12
    assert result.error.range_use == pytest.approx(found.range_use.max())
    assert (result.error.name, result.error.verdict) == ("1 N up", "inside the identified range")


def test_a_reference_that_is_larger_gives_negative_errors() -> None:
    found = frequency_response(mode_with(Q), 0.5)
    result = compare(found, as_reference(found, scale=1.25))
    assert result.error.peak_error == pytest.approx(-0.2, rel=1e-9)
    amplitude = found.amplitude_m()
    used = np.abs(found.phase_lag_deg() - 90.0) <= 90.0
    expected = 0.2 * np.sqrt(np.mean(amplitude[used] ** 2)) / amplitude.max()
    assert result.error.envelope_error == pytest.approx(expected, rel=1e-6)


def test_a_shifted_frequency_is_told_by_the_peak_and_by_the_envelope_over_frequency_only() -> None:
    found = frequency_response(mode_with(Q), 0.5, points=1001)
    other = as_reference(frequency_response(mode_with(Q, frequency_hz=24.0 * 1.002), 0.5, points=1001))
    error = compare(found, other, phase_window_deg=45.0).error
    assert error.peak_frequency_error == pytest.approx(1 / 1.002 - 1, rel=1e-4)
    assert error.envelope_error > 0.1
    by_phase = compare(found, other, over="phase", phase_window_deg=45.0).error
    assert by_phase.envelope_error == pytest.approx(abs(1 - 1.002**-2), rel=0.2), "q goes with w^-2 at any one phase"


def test_over_phase_the_unstable_branch_is_compared_and_over_frequency_the_nearer_stable_one() -> None:
    found = frequency_response(duffing(Q), 1.0, points=801)
    assert not found.stable.all()
    reference = as_reference(found)
    by_phase = compare(found, reference, over="phase")
    np.testing.assert_allclose(by_phase.predicted_amplitude, found.amplitude_m(), rtol=1e-9)
    by_frequency = compare(found, reference)
    np.testing.assert_allclose(
        by_frequency.predicted_amplitude[found.stable], found.amplitude_m()[found.stable], rtol=1e-9
    )
    assert np.all(by_frequency.predicted_amplitude[~found.stable] != found.amplitude_m()[~found.stable])


def test_the_peak_before_a_jump_is_the_largest_point_not_a_parabola_over_the_jump() -> None:
    found = frequency_response(mode_with(Q), 0.5)
    amplitude = np.array([1.0, 2.0, 3.0, 4.0, 0.5, 0.4])
    lag = np.exp(-1j * np.radians([20, 40, 60, 80, 160, 170]))
    frequency = np.linspace(23.9, 24.1, 6)
    reference = FrequencyResponse(frequency, np.ones(6, complex), amplitude * lag, "displacement", "force", 1.0)
    error = compare(found, reference).error
    assert error.peak_error == pytest.approx(found.peak().amplitude_m / 4.0 - 1, rel=1e-12)
    assert error.peak_frequency_error == pytest.approx(found.peak().frequency_hz / frequency[3] - 1, rel=1e-9)


def test_points_without_a_prediction_are_left_out_and_counted() -> None:
    found = frequency_response(mode_with(Q), 0.5)
    wide = as_reference(frequency_response(mode_with(Q), 0.5, lowest_share=0.02))
    result = compare(found, wide)
    missing = int(np.count_nonzero(np.isnan(result.predicted_amplitude)))
    assert missing >= 4
    assert f"{missing} of {wide.frequency_hz.size} points of the reference are not compared" in result.error.notes
    away = replace(wide, frequency_hz=wide.frequency_hz + 100.0)
    with refused(IdentificationError, "no-point-in-common-with-the", field="reference"):
        compare(found, away)
    with refused(IdentificationError, field="over", value="time", allowed="frequency, phase"):
        compare(found, wide, over="time")  # type: ignore[arg-type]


def test_the_table_has_a_line_per_prediction_and_a_row_is_json() -> None:
    rows = [
        PredictionError("0.25 N", 0.002, -0.0001, 0.004, 0.6),
        PredictionError("sweep 1", -0.05, 0.001, 0.12, 1.2),
        PredictionError("far", 0.5, 0.01, 0.3, 1.6, ("note",)),
    ]
    lines = error_table(rows).splitlines()
    assert [line.split()[0] for line in lines] == ["prediction", "0.25", "sweep", "far"]
    assert [line.rsplit("  ", 1)[1] for line in lines[1:]] == [row.verdict for row in rows]
    assert [row.verdict for row in rows] == ["inside the identified range", "extrapolated", "extrapolated far"]
    assert "+0.20" in lines[1]
    assert json.loads(json.dumps(rows[2].row()))["notes"] == ["note"]
    with refused(IdentificationError, "empty", field="errors"):
        error_table([])
