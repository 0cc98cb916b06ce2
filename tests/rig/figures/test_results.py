"""Results draw themselves: the axes that come back hold the numbers of the result."""

import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import identification
from identification import (
    Channel,
    FrequencyResponse,
    FrequencyResponseMatrix,
    MultisineDesign,
    Predictions,
    Transient,
    periodic_spectra,
)
from rig import figures
from rig.results.files import save
from rig.results.kinds import all_kinds
from simulators import VirtualRig
from simulators.analysis import constant_force_response
from tests.identification.rigs import CHANNELS, one_mode_point
from tests.refused import refused


@pytest.fixture(autouse=True)
def pyplot():
    """Figures without a screen, closed after the test."""
    found = pytest.importorskip("matplotlib.pyplot")
    found.switch_backend("agg")
    yield found
    found.close("all")


def drawn(axes) -> list[tuple[np.ndarray, np.ndarray]]:
    """All curves in these axes."""
    return [
        (np.asarray(x, float), np.asarray(y, float)) for axis in axes for x, y in (one.get_data() for one in axis.lines)
    ]


def holds(axes, x, y) -> bool:
    """Whether some curve goes through these points, all of them and in their order."""
    return any(
        a.shape == np.shape(x) and np.allclose(a, x, rtol=1e-9) and np.allclose(b, y, rtol=1e-9) for a, b in drawn(axes)
    )


@pytest.fixture(scope="module")
def mode():
    """Four points of a linear mode at phase resonance, at rising force."""
    points = [one_mode_point(forces=(0.0, force)) for force in (0.1, 0.2, 0.3, 0.4)]
    return identification.nonlinear_mode(identification.Backbone(tuple(points), "beam", 1.7))


@pytest.fixture(scope="module")
def hardening(mode):
    """The same with a frequency that rises with the amplitude, so that responses fold."""
    share = mode.amplitude_m / mode.amplitude_m.max()
    return replace(
        mode,
        modal_frequency_hz=mode.modal_frequency_hz * (1.0 + 0.02 * share**2),
        modal_frequency_std_hz=np.full(4, 1e-3),
        damping_ratio_std=np.full(4, 1e-5),
    )


def test_a_mode_draws_frequency_and_damping_over_the_amplitude(mode):
    axes = mode.plot()
    amplitude = figures_unit(mode.amplitude_m)
    assert holds(axes, amplitude, mode.modal_frequency_hz)
    assert holds(axes, amplitude, 100.0 * mode.damping_ratio)


def figures_unit(amplitude_m: np.ndarray) -> np.ndarray:
    """Amplitudes as they are drawn: micrometres where all lie below half a millimetre."""
    return amplitude_m * (1e6 if amplitude_m.max() < 5e-4 else 1e3)


def test_a_response_draws_amplitude_and_lag_over_the_frequency():
    frequency = np.linspace(20.0, 30.0, 9)
    one = FrequencyResponse(
        frequency, np.full(9, 0.5 + 0j), 1e-3 * np.exp(-1j * np.linspace(0.1, 3.0, 9)), "displacement", "force", 0.5
    )
    axes = one.plot()
    assert holds(axes, frequency, one.amplitude_m * 1e3)
    assert holds(axes, frequency, one.phase_lag_deg)
    assert len(figures.plot((one, one))) == len(axes)


def test_a_prediction_marks_its_folds_and_draws_what_is_unstable_otherwise(hardening):
    predicted = identification.frequency_response(hardening, 0.3)
    axes = predicted.plot()
    assert predicted.fold_frequency_hz.size == 2
    assert holds(axes, predicted.fold_frequency_hz, figures_unit(predicted.fold_amplitude_m))
    solid = [line for line in axes[0].lines if line.get_linestyle() == "-" and np.size(line.get_xdata()) > 9]
    seen = np.isfinite(solid[0].get_ydata())
    assert seen[predicted.stable].all()
    assert 0 < (~seen).sum() <= (~predicted.stable).sum()


def test_harmonic_balance_draws_its_curve_with_the_lag_of_the_displacement():
    found = constant_force_response(VirtualRig.shipped("magnet-beam"), 0.1, [-150.0, -90.0, -30.0], harmonics=3)
    axes = found.plot()
    assert holds(axes, found.frequency_hz, figures_unit(found.amplitude_m))
    lag = np.sort(np.concatenate([y for _, y in drawn(axes[1:])]))
    assert {30, 90, 150} <= set(np.round(lag[np.isfinite(lag)]))


def test_a_sweep_draws_the_fundamentals_over_time():
    time = np.linspace(0.0, 1.0, 11)
    one = Transient(CHANNELS, time, 20.0 + time, np.array([np.full(11, 0.2 + 0j), (1.0 + time) * 1j]), 5)
    axes = one.plot()
    assert holds(axes, time, np.full(11, 0.2))
    assert holds(axes, time, 1.0 + time)
    assert holds(axes, time, 20.0 + time)


def linear_measurement() -> FrequencyResponseMatrix:
    """Accelerance of one mode at the drive point."""
    frequency = np.arange(10.0, 40.0, 0.1)
    s = 2j * np.pi * frequency
    value = s**2 * 1.7**2 / (s**2 + 2 * 0.01 * 150.0 * s + 150.0**2)
    noise = np.random.default_rng(0).normal(size=(2, frequency.size)) @ np.eye(frequency.size) * 1e-4
    return FrequencyResponseMatrix(
        outputs=(CHANNELS[1],),
        inputs=(CHANNELS[0],),
        frequency_hz=frequency,
        value=(value + noise[0] + 1j * noise[1])[:, None, None],
        noise_covariance=np.full((frequency.size, 1, 1), 1e-8 + 0j)[:, :, :],
    )


def test_linear_modes_draw_with_and_without_their_responses():
    responses = linear_measurement()
    diagram = identification.stabilisation(responses, orders=[2, 4, 6, 8])
    modes = identification.linear_modes(responses, diagram=diagram)
    assert modes.plot()
    assert identification.ModalAnalysis(modes, responses, diagram).plot()
    assert responses.plot()
    poles = diagram.plot()[0]
    stable = diagram.stable
    assert holds((poles,), diagram.frequency_hz[stable], diagram.order[stable])


def test_spectra_and_distortion_draw_their_lines():
    design = MultisineDesign.with_resolution(
        sample_rate_hz=256.0, resolution_hz=1.0, lowest_hz=10.0, highest_hz=40.0, grid="odd"
    )
    wave = [np.tile(design.unit_peak(0, k), 2) for k in range(2)]
    records = [np.array([u, u + 0.1 * u**2, 2 * u + 0.1 * u**2]) for u in wave]
    channels = (Channel("voltage", "monitor", "V"), *CHANNELS)
    spectra = periodic_spectra(records, channels, design)
    assert spectra.plot()
    levels = identification.distortion_levels(spectra)
    axes = levels.plot()
    even = ~levels.excited & levels.even
    assert holds(axes, levels.frequency_hz[even], np.sqrt(levels.distortion[1, even]))


def test_a_page_of_ones_own_is_drawn_on(mode, pyplot):
    page = pyplot.figure(figsize=(5, 4))
    axes = mode.plot(page=page)
    assert {axis.figure for axis in axes} == {page}
    assert tuple(page.get_size_inches()) == (5, 4)
    assert pyplot.get_fignums() == [page.number]


def test_what_has_no_figure_is_named():
    for thing, name in ((3, "int"), ((1, 2), "tuple"), ({}, "dict")):
        with refused(TypeError, f"no-figure-for-{name}"):
            figures.plot(thing)


def test_options_of_files_are_refused_for_results(mode):
    with refused(TypeError, "lateness"):
        mode.plot(lateness=True)
    with refused(TypeError, "things"):
        figures.plot(mode, mode)


def test_files_and_runs_are_laid_over_one_another(tmp_path, mode):
    for name in ("one.h5", "two.h5"):
        save(mode, tmp_path / name)
    one = figures.plot(tmp_path / "one.h5")
    both = figures.plot(tmp_path / "one.h5", str(tmp_path / "two.h5"), labels=("first", "second"))
    assert holds(one, figures_unit(mode.amplitude_m), mode.modal_frequency_hz)
    inside = [legend for axis in both if (legend := axis.get_legend()) is not None]
    legends = [*inside, *both[0].get_figure().legends]
    assert {"first", "second"} <= {text.get_text() for legend in legends for text in legend.get_texts()}


def test_a_narrow_page_is_asked_for_once_for_all_figures(mode):
    figures.restyle("paper")
    try:
        assert mode.plot()[0].get_figure().get_figwidth() == pytest.approx(85.0 / 25.4)
    finally:
        figures.restyle()


def test_every_line_of_the_table_names_a_function():
    from pkgutil import resolve_name

    for one in all_kinds():
        assert callable(resolve_name(one.draw))


def test_the_libraries_know_figures_by_name_alone():
    code = (
        "import identification, sys; identification.NonlinearMode, identification.FrequencyResponse; "
        "print(sorted(name for name in sys.modules if name.split('.')[0] in ('rig', 'matplotlib')))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_predictions_and_exciters_draw(hardening):
    predicted = identification.frequency_response(hardening, 0.2)
    told: dict[str, Any] = {"steady_references": (None,), "steady_errors": (None,), "steady_bands": (None,)}
    assert Predictions(steady=(predicted,), **told).plot()
    exciter = identification.Exciter(
        force_per_volt_n_v=3.5,
        coil_time_constant_s=1e-4,
        moving_mass_kg=0.18,
        suspension_damping_n_s_m=12.0,
        suspension_stiffness_n_m=6000.0,
        back_emf_damping_n_s_m=18.7,
    )
    assert exciter.plot()
    assert identification.response_band(hardening, 0.2, draws=20).plot()
