"""Scatter over runs that is put in comes out again."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Backbone, IdentificationError, combined, nonlinear_mode, repeatability
from tests.identification.nonlinear.test_uncertainty import noisy_point, with_errors
from tests.identification.rigs import PHI
from tests.refused import refused

FORCES = (0.05, 0.1, 0.2, 0.3)


def run(rng: np.random.Generator, *, scatter: float = 0.0, noise: float = 1e-4, f0_hz: float = 24.37) -> Backbone:
    """A linear rig, its frequency scattering from run to run, its readings noisy."""
    factor = 1.0 + scatter * rng.standard_normal()
    points = [noisy_point(relative=noise, forces=(0, force, 0.1)) for force in FORCES]
    stiffer = [replace(p, frequency_hz=p.frequency_hz * factor * f0_hz / 24.37) for p in points]
    return Backbone(tuple(with_errors(p, rng) for p in stiffer), "beam", PHI)


@pytest.mark.slow
def test_frequency_scatter_of_ten_runs_is_recovered_within_its_statistics() -> None:
    rng = np.random.default_rng(2)
    inside, sizes = [], []
    for _ in range(40):
        found = repeatability([nonlinear_mode(run(rng, scatter=5e-4), draws=100) for _ in range(10)])
        size, low, high = found.scatter("modal_frequency_hz")
        inside.append(low < 5e-4 < high)
        sizes.append(size)
    assert np.mean(inside) >= 0.88
    assert np.sqrt(np.mean(np.square(sizes))) == pytest.approx(5e-4, rel=0.08)


def test_runs_that_differ_by_noise_alone_have_little_between_them() -> None:
    rng = np.random.default_rng(5)
    found = repeatability([run(rng, noise=2e-3) for _ in range(40)])
    observed, within = found.std("damping_ratio"), found.damping_ratio_within
    np.testing.assert_allclose(observed, within, rtol=0.3)
    assert np.mean(found.between("damping_ratio") ** 2) < 0.3 * np.mean(observed**2)
    scattered = repeatability([run(rng, scatter=1e-3) for _ in range(10)])
    between, all_in_all = (getattr(scattered, kind)("modal_frequency_hz") for kind in ("between", "std"))
    np.testing.assert_allclose(between, all_in_all, rtol=0.01)
    np.testing.assert_allclose(np.ptp(scattered.modal_frequency_hz, axis=0), scattered.range("modal_frequency_hz"))


@pytest.mark.slow
def test_the_combined_model_holds_what_a_further_run_does() -> None:
    rng = np.random.default_rng(8)
    inside = []
    for _ in range(30):
        model = combined([nonlinear_mode(run(rng, scatter=5e-4), draws=100) for _ in range(5)])
        low, high = model.interval("modal_frequency_hz").T
        further = nonlinear_mode(run(rng, scatter=5e-4), draws=100)
        value = np.interp(model.amplitude_m, further.amplitude_m, further.modal_frequency_hz)
        inside.append((low <= value) & (value <= high))
    assert 0.90 <= np.mean(inside) <= 0.99
    assert model.source == "several backbones"
    np.testing.assert_allclose(model.damping_ratio, 0.004, rtol=2e-3)
    np.testing.assert_allclose(np.abs(model.response_harmonics_m[:, 1]), model.amplitude_m, rtol=1e-3)
    assert len(model.table()) == model.amplitude_m.size


def test_what_is_printed_behind_plus_or_minus_is_the_interval_of_so_few_runs() -> None:
    rng = np.random.default_rng(3)
    model = combined([run(rng, scatter=5e-4) for _ in range(3)])
    rows = model.table()
    for name, column in (
        ("modal_frequency_hz", "modal_frequency_bound_95_hz"),
        ("damping_ratio", "damping_ratio_bound_95"),
    ):
        low, high = model.interval(name).T
        np.testing.assert_allclose([row[column] for row in rows], 0.5 * (high - low))
    # Student's quantile of two degrees of freedom, not the normal one
    np.testing.assert_allclose(model.bound_95("modal_frequency_hz") / model.modal_frequency_std_hz, 4.3027, rtol=1e-3)
    single = nonlinear_mode(run(rng))
    unknown = replace(single, interval_95=np.full(single.interval_95.shape, np.nan))
    np.testing.assert_array_equal(unknown.bound_95("damping_ratio"), 1.96 * single.damping_ratio_std)
    lopsided = single.interval_95.copy()
    lopsided[..., 1] += 1.0
    farther = replace(single, interval_95=lopsided).bound_95("damping_ratio")
    np.testing.assert_allclose(farther, 1.0 + single.interval("damping_ratio")[:, 1] - single.damping_ratio)


def test_passes_of_one_backbone_are_runs() -> None:
    rng = np.random.default_rng(1)
    up, down = run(rng), run(rng)
    both = Backbone((*up.points, *down.points), "beam", PHI, ("up",) * 4 + ("down",) * 4, (1,) * 8)
    assert [len(one.points) for one in both.passes()] == [4, 4]
    found = repeatability([both])
    assert found.modal_frequency_hz.shape == (2, 4)
    np.testing.assert_allclose(found.mean("damping_ratio"), 0.004, rtol=2e-3)
    assert set(found.table()[0]) >= {"amplitude_m", "modal_frequency_hz_between", "damping_ratio_range"}


def test_runs_with_other_levels_are_compared_over_their_common_range() -> None:
    rng = np.random.default_rng(1)
    long, short = run(rng), run(rng)
    short = short.select([False, True, True, True])
    found = repeatability([long, short])
    assert found.amplitude_m.size == 3
    assert found.amplitude_m[0] >= short.amplitude_m[0]


def test_what_cannot_be_compared_is_refused_by_name() -> None:
    rng = np.random.default_rng(1)
    one = run(rng)
    with refused(IdentificationError, "given-repeatability-needs-two", field="runs"):
        repeatability([one])
    with refused(IdentificationError, "of-different-specimens-beam-plate", field="runs"):
        repeatability([one, replace(one, specimen="plate")])
    fewer = tuple(
        replace(p, channels=p.channels[:2], harmonics=p.harmonics[:2], harmonics_std=None, residual_rms=np.zeros(2))
        for p in one.points
    )
    with refused(IdentificationError, "channels-of-backbone-are-force-drive", field="runs"):
        combined([one, replace(one, points=fewer)])
    with refused(IdentificationError, "no-common-range-of-amplitudes", field="runs"):
        repeatability([one.select([True, True, False, False]), one.select([False, False, True, True])])
    with refused(IdentificationError, "run-has-amplitude", field="runs"):
        repeatability([one, one.select([True, False, False, False])])
    with refused(IdentificationError, field="quantity", value="mac", allowed="modal_frequency_hz, damping_ratio"):
        repeatability([one, run(rng)]).mean("mac")
