"""Frequency responses of others as real and imaginary parts, amplitudes and phases, in the units that their names say."""

import numpy as np
import pytest

from identification import IdentificationError, ResponseMatrixMapping, map_response_matrix
from tests.refused import refused

FREQUENCY = np.arange(0.0, 20.0, 0.5)
VALUE = 3.0 / (1.0 - (FREQUENCY / 12.3) ** 2 + 0.02j * FREQUENCY)


def mapping(frequency="f", unit="m", **value) -> ResponseMatrixMapping:
    return ResponseMatrixMapping.model_validate(
        {
            "kind": "frequency-response-matrix",
            "frequency": frequency,
            "outputs": [{"name": "a", "role": "response", "unit": unit}],
            "inputs": [{"name": "p", "role": "force", "unit": "N"}],
            "paths": [{"output": "a", "input": "p", "value": value}],
        }
    )


@pytest.mark.parametrize(("name", "key"), [("H", {"amplitude_unit": "dB"}), ("H [dB]", {}), ("H (dB re 1 m/N)", {})])
@pytest.mark.parametrize(("phase", "turn", "more"), [("phi", 1.0, {}), ("phi [rad]", np.pi / 180.0, {})])
def test_decibels_and_radians_are_read_by_key_or_by_the_name_of_the_column(name, key, phase, turn, more):
    data = {"f": FREQUENCY, name: 20.0 * np.log10(np.abs(VALUE)), phase: np.degrees(np.angle(VALUE)) * turn}
    found = map_response_matrix(data, mapping(amplitude=name, phase=phase, **key, **more))
    np.testing.assert_allclose(found.value[:, 0, 0], VALUE, rtol=1e-12)


def test_units_that_the_file_says_beside_the_names_count_and_contradictions_are_refused():
    data = {"f": FREQUENCY, "H": np.abs(VALUE), "phi": np.angle(VALUE), "__units__": {"phi": "rad", "H": "dB"}}
    decibels = data | {"H": 20.0 * np.log10(np.abs(VALUE))}
    found = map_response_matrix(decibels, mapping(amplitude="H", phase="phi"))
    np.testing.assert_allclose(found.value[:, 0, 0], VALUE, rtol=1e-12)
    with refused(IdentificationError, field="paths[0].value.phase_unit", value="deg"):
        map_response_matrix(data, mapping(amplitude="H", phase="phi", phase_unit="deg"))
    with refused(IdentificationError, field="paths[0].value.amplitude_unit", value="linear"):
        map_response_matrix(data, mapping(amplitude="H", phase="phi", amplitude_unit="linear"))


def test_negative_amplitudes_are_refused_with_a_word_on_decibels():
    data = {"f": FREQUENCY, "H": 20.0 * np.log10(np.abs(VALUE) / 100.0)}
    with refused(IdentificationError, field="paths[0].value", hint='amplitudes in decibels need amplitude_unit = "dB"'):
        map_response_matrix(data, mapping(amplitude="H"))


@pytest.mark.parametrize(("name", "factor"), [("f", 1.0), ("f [kHz]", 1e-3), ("w [rad/s]", 2.0 * np.pi)])
def test_frequencies_are_in_the_unit_that_their_name_says(name, factor):
    found = map_response_matrix(
        {name: FREQUENCY * factor, "re": VALUE.real, "im": VALUE.imag}, mapping(name, real="re", imaginary="im")
    )
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=1e-12)


@pytest.mark.parametrize(
    ("unit", "first", "left"), [("m", np.nan, True), ("m/s2", 1.0, True), ("m", 0.0, True), ("m", 3.0, False)]
)
def test_a_line_at_0_hz_that_says_nothing_is_left_out_with_a_note(unit, first, left):
    re = np.r_[first, VALUE.real[1:]]
    found = map_response_matrix(
        {"f": FREQUENCY, "re": re, "im": VALUE.imag}, mapping(unit=unit, real="re", imaginary="im")
    )
    assert (found.frequency_hz[0] == 0.5) == left
    assert any("0 Hz" in note for note in found.notes) == left
    np.testing.assert_allclose(found.value[1:, 0, 0], (VALUE[2:] if left else VALUE[1:]), rtol=1e-12)


def test_a_nan_elsewhere_is_refused_with_its_frequency():
    re = np.where(FREQUENCY == 4.0, np.nan, VALUE.real)
    with refused(IdentificationError, "is-not-finite-at-8-hz", field="paths[0].value"):
        map_response_matrix({"f": FREQUENCY, "re": re, "im": VALUE.imag}, mapping(real="re", imaginary="im"))
