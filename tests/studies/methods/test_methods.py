"""The race of methods: what it counts, what it calls met, and which knob it calls the cheapest."""

import math
import re

import numpy as np
import pytest

from rig.drivers import make_daq
from simulators.analysis import phase_resonance_backbone
from studies.methods.choice import cheapest, meets, together
from studies.methods.outcome import carried_out, covered, driven, turns
from studies.methods.plans import METHODS, usual_knob
from studies.methods.race import Runs, cells
from studies.methods.rigs import CONDITIONS, RIGS, bench_of, levels_of, truth_at
from studies.methods.table import BEGIN, END, needed, put, tables


def row(frequency=(1e-5,), damping=(1e-3,), **changes):
    usual = {"rig": "magnet-beam", "method": "exact", "pure": False, "condition": "1 x noise", "knob": 50, "seed": 0}
    counts = {"levels": len(frequency), "asked_points": 13, "refused": 0, "seconds": 10.0, "periods": 250.0}
    errors = {"frequency_errors": list(frequency), "damping_errors": list(damping)}
    held = {"frequency_covered": [True, False], "damping_covered": []}
    return usual | counts | errors | held | {"failed": "", "reason": ""} | changes


def test_periods_are_those_of_a_wrapped_phase_whatever_the_frequency():
    frequency = np.linspace(24.0, 26.0, 5000)
    phase = 2 * np.pi * np.cumsum(frequency) / 5000.0
    assert turns(np.mod(phase, 2 * np.pi)) == pytest.approx((phase[-1] - phase[0]) / (2 * np.pi), abs=1e-9)
    assert turns(np.array([])) == 0.0


def test_a_run_counts_from_its_first_driven_sample_to_the_last_with_rests_between():
    volts = np.array([0.0, 0.0, 0.1, 0.0, -0.2, 0.0])
    assert driven(volts) == slice(2, 5)
    assert driven(np.zeros(4)) == slice(0, 0)


def test_an_interval_holds_up_to_1_96_standard_errors_and_unknown_ones_do_not_count():
    assert covered(np.array([1.95, -1.97, 0.0]), np.array([1.0, 1.0, np.nan])) == [True, False]


def test_bounds_are_met_by_whole_backbones_only():
    assert meets(row())
    assert not meets(row(frequency=(1e-5, -2.1e-4), damping=(0.0, 0.0)))
    assert not meets(row(damping=(-0.021,)))
    assert not meets(row(damping=(math.nan,)))
    assert not meets(row(levels=2))
    assert not meets(row(failed="TuningError: no mode"))


@pytest.mark.parametrize(
    ("least", "found"), [(10.0, 50.0), (50.0, 50.0), (100.0, 100.0), (101.0, 200.0), (800.0, 800.0)]
)
def test_the_cheapest_knob_is_the_smallest_that_suffices(least, found):
    assert cheapest(100.0, lambda knob: knob >= least) == found


def test_no_knob_is_the_cheapest_where_none_suffices_or_none_is_possible():
    assert math.isnan(cheapest(100.0, lambda knob: False))
    tried = []
    assert math.isnan(cheapest(100.0, lambda knob: tried.append(knob) or False, 200.0))
    assert tried == [100.0, 200.0]


def test_several_runs_give_the_worst_error_and_the_median_effort():
    one = together([row(periods=250.0), row(periods=300.0, frequency=(-3e-5,)), row(periods=900.0)])
    assert (one["periods"], one["worst_frequency"], one["median_frequency"]) == (300.0, 3e-5, 1e-5)
    assert (one["frequency_covered"], one["met"]) == (0.5, 3)
    assert math.isnan(one["damping_covered"])


def test_every_rig_runs_every_method_under_every_condition_and_sweeps_have_no_harmonics_loop():
    everything = list(cells())
    assert len(everything) == len(set(everything)) == len(RIGS) * len(CONDITIONS) * (2 * len(METHODS) - 1)
    assert not any(method == "sweep" and pure for _, method, pure, _ in everything)


@pytest.mark.parametrize("name", ["cubic-beam", "magnet-beam"])
def test_the_truth_between_its_points_is_that_of_harmonic_balance(name):
    levels = np.array(levels_of(name, True)[1])[[3, 12]] * 1.002
    exact = phase_resonance_backbone(make_daq(bench_of(name)).rig, amplitudes_m=levels, force_harmonics=7)
    frequency, damping = truth_at(name, True, levels)
    np.testing.assert_allclose(frequency, exact.modal_frequency_hz, rtol=1e-7)
    np.testing.assert_allclose(damping, exact.damping_ratio, rtol=1e-5)


def test_a_drifting_rig_loses_a_thousandth_of_its_frequency_in_a_minute():
    drifting = make_daq(bench_of("stop-beam", "drift")).rig
    ratio = drifting.worn(60.0).linear_modes.frequency_hz / drifting.worn(0.0).linear_modes.frequency_hz
    np.testing.assert_allclose(ratio, 0.999, rtol=1e-6)


def test_tables_show_the_cheapest_known_knob_and_go_into_a_page(tmp_path):
    runs = Runs(tmp_path / "runs.jsonl")
    runs.rows += [row(), row(knob=25.0, periods=150.0), row(seed=1)]
    cell = ("magnet-beam", "exact", False, "1 x noise")
    found = needed(runs, cell)
    assert found is not None
    assert (found[0], found[1]["periods"]) == (25.0, 150.0)
    runs.rows.append(row(knob=25.0, seed=1, damping=(0.5,)))
    found = needed(runs, cell)
    assert found is not None
    assert found[0] == 50
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n{BEGIN}\nold\n{END}\n\nafter\n", encoding="utf-8")
    put(page, tables(runs))
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert text.endswith("after\n")
    assert re.search(r"settled, exact laws \| exciter's \| 1 x noise \| 13 \| 0 \| 10\.0 \| 250 ", text)


@pytest.mark.slow
def test_short_points_on_the_magnet_beam_meet_the_bounds():
    found = carried_out("magnet-beam", "short", False, "1 x noise", usual_knob("short", "magnet-beam"), 0).row()
    assert meets(found), found
    assert 13 * 15 < found["periods"] < 350
    assert found["seconds"] == pytest.approx(found["periods"] / 24.5, rel=0.02)
