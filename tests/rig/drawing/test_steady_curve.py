"""Curves of steady vibrations: where they end, and what is said about it."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from identification import SteadyPrediction
from rig.drawing.steady_curve import draw_curve, draw_ends, ends_within, why_it_ends


def resonance(low_hz: float = 8.0, high_hz: float = 12.0, **changes: object) -> SteadyPrediction:
    """The linear resonance at 10 Hz with 2 % damping, to one newton per kilogram."""
    f = np.linspace(low_hz, high_hz, 201)
    w, none = 2.0 * np.pi * f, np.zeros(0)
    x = 1.0 / ((20.0 * np.pi) ** 2 - w**2 + 0.04j * 20.0 * np.pi * w)
    made = SteadyPrediction(
        force_n=1.0,
        force="fundamental",
        channels=("drive",),
        frequency_hz=f,
        modal_amplitude=np.abs(x),
        fundamental_n=np.ones(f.size),
        displacement_m=x[:, None],
        stable=np.ones(f.size, bool),
        branch=np.zeros(f.size, dtype=np.int64),
        range_use=np.full(f.size, 0.5),
        fold_frequency_hz=none,
        fold_amplitude_m=none,
        fold_modal_amplitude=none,
    )
    return replace(made, **changes)


def test_a_whole_resonance_ends_nowhere_within_the_figure() -> None:
    assert ends_within(resonance()).size == 0
    assert why_it_ends(resonance()) == []


def test_a_curve_that_stops_near_its_peak_ends_with_the_range_of_its_model() -> None:
    cut = resonance(9.8, 10.3)
    assert ends_within(cut).tolist() == [0, 200]
    assert why_it_ends(cut) == ["the range of the model ends"]


def test_a_curve_that_was_cut_off_says_why_once() -> None:
    note = "the response from {} Hz ends at 9.9 Hz: the states are beyond 3 times those of the training data"
    whole = resonance(8.0, 12.0)
    kept = (whole.frequency_hz < 9.8) | (whole.frequency_hz > 10.2)
    parts = {
        name: getattr(whole, name)[kept] for name in ("frequency_hz", "displacement_m", "modal_amplitude", "stable")
    }
    parts |= {"fundamental_n": whole.fundamental_n[kept], "range_use": whole.range_use[kept]}
    branch = (parts["frequency_hz"] > 10.0).astype(np.int64)
    cut = replace(whole, **parts, branch=branch, complete=False, notes=(note.format(8), note.format(12)))
    ends = parts["frequency_hz"][ends_within(cut)]
    assert ends == pytest.approx([9.78, 10.22], abs=0.021)  # not at the ends of the band
    assert why_it_ends(cut) == ["the states are beyond 3 times those of the training data"]


def test_a_curve_point_by_point_ends_with_its_points() -> None:
    assert ends_within(resonance(9.8, 10.3, force="recorded")).size == 0


def test_a_label_is_given_once_and_unstable_parts_are_lines_of_their_own() -> None:
    folded = resonance()
    folded = replace(folded, stable=np.abs(folded.frequency_hz - 10.1) > 0.05)
    axis = Figure().subplots()
    draw_curve(axis, folded, folded.amplitude_m(), "black", "1 N")
    draw_ends(axis, folded, folded.amplitude_m(), "black")
    assert axis.get_legend_handles_labels()[1] == ["1 N"]
    stable, unstable, ends = axis.get_lines()
    assert ends.get_xdata().size == 0
    assert np.isfinite(unstable.get_ydata()).sum() == np.count_nonzero(~folded.stable) + 1
    assert np.isnan(stable.get_ydata()).any()
