import numpy as np
import pytest

from identification import IdentificationError, MultisineDesign, coherence
from tests.identification.multisine.linear_systems import RATE_HZ, measured, response_of
from tests.refused import refused

DESIGN = MultisineDesign(RATE_HZ, 100, 40.0, 160.0)


def test_coherence_is_the_signal_s_part_of_the_power() -> None:
    spectra = measured(1, 1, noise=0.5, blocks=300, design=DESIGN)
    force = 2.0 * np.abs(1 / (1 + 1j * DESIGN.frequency_hz / 90.0)) * DESIGN.amplitudes
    motion = np.abs(response_of(1, 1, DESIGN.frequency_hz)[:, 0, 0]) * force
    noise = 4 * 0.5**2 / DESIGN.period_samples
    expected = motion**2 / (motion**2 + noise)
    np.testing.assert_allclose(coherence(spectra, "a0", "voltage"), expected, atol=0.02)
    np.testing.assert_allclose(coherence(spectra, "a0"), expected * force**2 / (force**2 + noise), atol=0.02)


def test_multiple_coherence_is_one_where_both_inputs_explain_the_output_and_one_does_not() -> None:
    spectra = measured(2, 2, design=DESIGN)
    np.testing.assert_allclose(coherence(spectra, "a0"), 1.0, atol=1e-12)
    assert np.mean(coherence(spectra, "a0", "force0")) < 0.95


def test_noise_alone_has_the_coherence_of_its_few_records() -> None:
    random = np.random.default_rng(0)
    spectra = measured(2, 2, blocks=2, periods=3, design=DESIGN)
    found = []
    for _ in range(200):
        noise = random.normal(size=(2, *spectra.spectra.shape))
        object.__setattr__(spectra, "spectra", noise[0] + 1j * noise[1])
        found.append(coherence(spectra, "a0"))
    assert np.mean(found) == pytest.approx(2 / 12, abs=0.01)


def test_what_has_no_coherence_is_refused() -> None:
    with refused(IdentificationError, "make-records-coherence-with-inputs-needs", field="periods, realisations"):
        coherence(measured(1, 1, blocks=1, periods=1), "a0")
    with refused(IdentificationError, "depend-on-each-other-at-hz", field="inputs"):
        coherence(measured(1, 1), "a0", ("voltage", "force"))
