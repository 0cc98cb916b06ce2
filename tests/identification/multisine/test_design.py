import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification import IdentificationError, MultisineDesign
from tests.refused import refused

DESIGN = MultisineDesign(sample_rate_hz=5000.0, period_samples=4096, lowest_hz=15.0, highest_hz=35.0, rms=0.7)


def component(signal: np.ndarray, line: int) -> complex:
    """Peak amplitude and phase of a line, by the definition of the Fourier coefficient."""
    turn = 2 * np.pi * line * np.arange(signal.size) / signal.size
    return complex(2 * np.mean(signal * np.exp(-1j * turn)))


@settings(max_examples=30, deadline=None)
@given(
    period=st.integers(100, 3000),
    band=st.tuples(st.floats(0.01, 0.2), st.floats(0.25, 0.49)),
    grid=st.sampled_from(["full", "odd", "odd-random"]),
    rms=st.floats(0.01, 10.0),
    seed=st.integers(0, 9),
)
def test_power_lies_on_the_excited_lines_only_and_rms_is_as_asked(
    period: int, band: tuple[float, float], grid: str, rms: float, seed: int
) -> None:
    design = MultisineDesign(1000.0, period, 1000.0 * band[0], 1000.0 * band[1], grid, rms, detection_group=2)
    signal = design.realisation(seed, 0)
    assert np.sqrt(np.mean(signal**2)) == pytest.approx(rms)
    spectrum = np.abs(np.fft.rfft(signal)) * 2 / period
    excited = np.zeros(spectrum.size, dtype=bool)
    excited[design.lines] = True
    np.testing.assert_allclose(spectrum[excited], rms * np.sqrt(2 / design.lines.size), rtol=1e-9)
    assert np.all(spectrum[~excited] < 1e-10 * rms)
    assert np.all((design.frequency_hz >= 1000 * band[0] - 1e-6) & (design.frequency_hz <= 1000 * band[1] + 1e-6))
    assert grid == "full" or np.all(design.lines % 2 == 1)


def test_both_ends_of_the_band_are_excited() -> None:
    design = MultisineDesign.with_resolution(sample_rate_hz=5000.0, resolution_hz=0.1, lowest_hz=0.3, highest_hz=0.7)
    assert design.period_samples == 50_000
    assert design.lines.tolist() == [3, 4, 5, 6, 7]
    assert design.resolution_hz == pytest.approx(0.1)
    assert design.period_s == pytest.approx(10.0)


def test_a_realisation_is_the_same_always_and_unlike_any_other() -> None:
    first = DESIGN.realisation(3, 1)
    assert np.array_equal(first, MultisineDesign(5000.0, 4096, 15.0, 35.0, rms=0.7).realisation(3, 1))
    others = [DESIGN.realisation(3, 0), DESIGN.realisation(3, 2), DESIGN.realisation(4, 1)]
    for other in others:
        assert abs(np.corrcoef(first, other)[0, 1]) < 0.9


def test_phases_are_even_over_the_circle() -> None:
    phases = np.array([[np.angle(component(DESIGN.realisation(0, r), k)) for k in DESIGN.lines] for r in range(200)])
    samples = phases.size
    for harmonic in (1, 2, 3):  # the mean of exp(i h phi) over n even phases has a deviation of 1 / sqrt(n)
        assert abs(np.mean(np.exp(1j * harmonic * phases))) < 4 / np.sqrt(samples)


def test_who_changes_a_realisation_changes_no_later_one() -> None:
    first = DESIGN.realisation(3, 1)
    kept = first.copy()
    first[:] = 0.0
    assert np.array_equal(DESIGN.realisation(3, 1), kept)


def test_unit_peak_times_crest_factor_times_rms_is_the_realisation() -> None:
    unit = DESIGN.unit_peak(1, 2)
    assert np.max(np.abs(unit)) == 1.0
    np.testing.assert_allclose(unit * DESIGN.crest_factor(1, 2) * 0.7, DESIGN.realisation(1, 2), atol=1e-14)
    single = MultisineDesign(1000.0, 40, 25.0, 25.0)
    assert single.crest_factor(0, 0) == pytest.approx(np.sqrt(2.0), rel=0.01)


def test_amplitudes_follow_the_given_spectrum() -> None:
    design = MultisineDesign(1000.0, 100, 10.0, 40.0, rms=2.0, relative_amplitudes=(4.0, 3.0, 0.0, 0.0))
    signal = design.realisation(0, 0)
    # 4 : 3 with (A1^2 + A2^2) / 2 = 4
    expected = [1.6 * np.sqrt(2), 1.2 * np.sqrt(2), 0.0, 0.0]
    assert [abs(component(signal, k)) for k in (1, 2, 3, 4)] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"highest_hz": 2500.0},
            {"field": "highest_hz", "value": 2500.0, "allowed": "below half the sample rate, 2500 Hz"},
        ),
        ({"highest_hz": 10.0}, {"field": "highest_hz", "value": 10.0, "allowed": "lowest_hz = 15 Hz"}),
        (
            {"lowest_hz": 15.1, "highest_hz": 15.2},
            {"says": "no-line-of-the-full-grid", "field": "lowest_hz, highest_hz"},
        ),
        (
            {"lowest_hz": 17.0, "highest_hz": 17.2, "grid": "odd"},
            {"says": "no-line-of-the-odd-grid", "field": "lowest_hz, highest_hz"},
        ),
        ({"grid": "even"}, {"field": "grid", "value": "even", "allowed": "full, odd, odd-random"}),
        (
            {"grid": "odd-random", "detection_group": 9},
            {"says": "no-line-of-the-odd-random", "field": "lowest_hz, highest_hz"},
        ),
        ({"detection_group": 1}, {"field": "detection_group", "value": 1, "allowed": "2 and above"}),
        ({"grid_seed": -1}, {"field": "grid_seed", "value": -1, "allowed": "0 and above"}),
        ({"period_samples": 2}, {"field": "period_samples", "value": 2, "allowed": "3 and above"}),
        ({"rms": 0.0}, {"field": "rms", "allowed": "finite and above zero"}),
        ({"lowest_hz": float("nan")}, {"says": "nan-hz", "field": "lowest_hz"}),
        ({"relative_amplitudes": (1.0, 2.0)}, {"says": "has-values-for-lines", "field": "relative_amplitudes"}),
        ({"relative_amplitudes": (0.0,) * 16}, {"says": "lowest-is-highest", "field": "relative_amplitudes"}),
    ],
)
def test_a_design_that_cannot_be_played_is_refused(change: dict[str, object], message: str) -> None:
    design = {"sample_rate_hz": 5000.0, "period_samples": 4096, "lowest_hz": 15.0, "highest_hz": 35.0} | change
    with refused(IdentificationError, **message):
        MultisineDesign(**design)


def test_a_resolution_without_whole_samples_is_refused_with_the_next_one() -> None:
    with refused(IdentificationError, "samples-at-hz", field="resolution_hz", value=0.3):
        MultisineDesign.with_resolution(sample_rate_hz=5000.0, resolution_hz=0.3, lowest_hz=1.0, highest_hz=9.0)


@pytest.mark.parametrize("resolution_hz", [1e5, 1e-300])
def test_a_resolution_without_a_usable_period_is_refused(resolution_hz: float) -> None:
    with refused(IdentificationError, field="resolution_hz", allowed="3 to 1e+08"):
        MultisineDesign.with_resolution(
            sample_rate_hz=5000.0, resolution_hz=resolution_hz, lowest_hz=10.0, highest_hz=20.0
        )


def test_seeds_below_zero_are_refused() -> None:
    with refused(IdentificationError, field="seed", value=-1, allowed="zero or more"):
        DESIGN.realisation(-1, 0)


def test_an_odd_random_grid_leaves_out_one_of_every_group_and_the_same_in_all_realisations() -> None:
    design = MultisineDesign(1000.0, 1000, 20.0, 102.0, "odd-random", detection_group=5, grid_seed=4)
    odd = np.arange(21, 102, 2)
    silent = design.detection_lines_odd
    assert silent.size == odd.size // 5
    assert np.all((np.searchsorted(odd, silent) // 5) == np.arange(silent.size))
    assert np.array_equal(design.detection_lines_even, np.arange(20, 103, 2))
    assert np.array_equal(np.sort(np.concatenate([design.lines, silent])), odd)
    for index in range(3):
        spectrum = np.abs(np.fft.rfft(design.realisation(4, index)))
        assert np.max(spectrum[silent]) < 1e-9 * np.max(spectrum)
    others = [
        MultisineDesign(1000.0, 1000, 20.0, 102.0, "odd-random", detection_group=5, grid_seed=s) for s in range(40)
    ]
    places = np.array([np.searchsorted(odd, other.detection_lines_odd) % 5 for other in others])
    counts = np.bincount(places.ravel(), minlength=5)
    assert np.all(np.abs(counts - places.size / 5) < 4 * np.sqrt(places.size * 0.16))  # every place is as likely


def test_detection_lines_are_what_a_grid_leaves_out() -> None:
    odd = MultisineDesign(1000.0, 1000, 20.0, 30.0, "odd")
    assert odd.detection_lines_odd.size == 0
    assert odd.detection_lines_even.tolist() == [20, 22, 24, 26, 28, 30]
    full = MultisineDesign(1000.0, 1000, 20.0, 30.0)
    assert full.detection_lines_odd.size + full.detection_lines_even.size == 0


@pytest.mark.parametrize("n_inputs", [1, 2, 3, 4])
def test_orthogonal_realisations_are_orthogonal_at_every_line(n_inputs: int) -> None:
    block = DESIGN.orthogonal_realisation(3, 1, n_inputs)
    assert block.shape == (n_inputs, n_inputs, DESIGN.period_samples)
    np.testing.assert_allclose(np.sqrt(np.mean(block**2, axis=-1)), 0.7)
    for line in DESIGN.lines:
        u = np.array([[component(signal, line) for signal in experiment] for experiment in block])
        np.testing.assert_allclose(
            np.conj(u.T) @ u, n_inputs * DESIGN.amplitudes[0] ** 2 * np.eye(n_inputs), atol=1e-12
        )
    if n_inputs == 1:
        assert np.array_equal(block[0, 0], DESIGN.realisation(3, 1))


def test_inputs_of_an_orthogonal_block_are_unlike_each_other_and_none_are_refused() -> None:
    block = DESIGN.orthogonal_realisation(3, 1, 3)
    assert abs(np.corrcoef(block[0, 0], block[0, 1])[0, 1]) < 0.9
    with refused(IdentificationError, field="n_inputs", value=0, allowed="1 and above"):
        DESIGN.orthogonal_realisation(3, 1, 0)


@pytest.mark.parametrize("highest_hz", [90.0, 125.0, 126.0, 166.0, 167.0, 240.0])
def test_products_of_the_folding_degree_and_of_no_lower_one_come_back_into_the_band(highest_hz: float) -> None:
    design = MultisineDesign(500.0, 500, 20.0, highest_hz)
    time = np.arange(500) / 500.0
    for degree in range(2, design.folding_degree + 1):
        made = np.arange(251, round(degree * highest_hz) + 1)  # above half the sample rate
        folded = np.abs(np.fft.rfft(np.cos(2 * np.pi * np.outer(made, time)))).argmax(axis=1)
        assert np.any(folded <= highest_hz) == (degree == design.folding_degree)
