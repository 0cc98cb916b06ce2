"""References whose force is known point by point alone, beside a model that has two vibrations between its folds."""

import numpy as np
import pytest

from identification import FrequencyResponse, frequency_response
from rig.results.simulated.steady import Reference, compared
from tests.identification.models.pnlss.steady.oscillators import oscillator

FORCE_N = 5.0
CHOSEN = "several vibrations were found: the one nearest to the measured amplitude was taken"


@pytest.fixture(scope="module")
def curve():
    """The response through its folds, and their frequencies, the higher one first."""
    found = frequency_response(oscillator(), FORCE_N, force="pure-sine", largest_range_use=3.0)
    assert found.fold_frequency_hz[0] > found.fold_frequency_hz[1]
    return found


def reference(curve, at_hz, *, upper):
    """What would be measured on one side of the folds."""
    turn = int(np.argmax(curve.frequency_hz >= curve.fold_frequency_hz[0] * 0.9999))
    side = slice(None, turn) if upper else slice(turn + int(np.argmin(curve.frequency_hz[turn:])), None)
    motion = np.interp(at_hz, curve.frequency_hz[side], np.abs(curve.displacement_m[side, 0]))
    measured = FrequencyResponse(
        frequency_hz=at_hz,
        force=np.full(at_hz.size, FORCE_N + 0j),
        response=motion * np.exp(-0.5j * np.pi),
        kind="displacement",
        controlled="voltage",
        level=1.0,
    )
    return Reference(measured, "frequency")


def test_above_the_fold_the_measurement_chooses_and_a_note_says_so(curve):
    asked = reference(curve, np.linspace(25.2, 26.6, 8), upper=True)
    predicted, _, error, _ = compared(oscillator(), {"exciter": None}, asked)
    np.testing.assert_allclose(predicted.amplitude_m(), asked.measured.amplitude_m, rtol=0.02)
    between = int(np.count_nonzero(asked.measured.frequency_hz > curve.fold_frequency_hz[1]))
    assert any(note.startswith(f"at {between} of 8 points {CHOSEN}") for note in error.notes)


def test_where_rest_leads_nothing_is_chosen(curve):
    asked = reference(curve, np.linspace(27.4, 26.8, 4), upper=False)
    predicted, _, error, _ = compared(oscillator(), {"exciter": None}, asked)
    np.testing.assert_allclose(predicted.amplitude_m(), asked.measured.amplitude_m, rtol=0.02)
    assert not any(CHOSEN in note for note in error.notes)
