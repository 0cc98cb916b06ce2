"""Twins are reproducible, are what their unknowns say, and can be written and run by themselves."""

import numpy as np
import pytest

from rig.bench import load_bench
from rig.bench.bench import DriverChoice
from rig.campaigns.plans import load_plan
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError
from rig.rehearsal import rehearsal
from rig.rehearsal.files import write_bench
from rig.rehearsal.hypotheses import Hypotheses, load_hypotheses
from rig.rehearsal.rehearsal import RehearsalRequest
from rig.rehearsal.trial import not_computed, run_trial
from rig.rehearsal.twins import draw_twin, highest_displacement_m
from simulators.analysis import phase_resonance_backbone
from tests.refused import refused
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import PLAN, SHORT, magnet_beam

EVERYTHING = Hypotheses(
    hardening=1.0, hardening_powers=(2,), softening=0.0, joint=1.0, stop=1.0, second_mode=1.0, gain=1.0
)


def draw(number, hypotheses=None, bench=None, plan=PLAN, seed=0, knowledge=None):
    known = knowledge or knowledge_of_the_magnet_beam()
    return draw_twin(bench or magnet_beam(), plan, known, hypotheses or Hypotheses(), seed, number)


def test_the_same_seed_and_number_give_the_same_twin():
    again = [draw(n).bench.model_dump() for n in (3, 1, 3)]
    assert again[0] == again[2] != again[1]
    assert draw(3, seed=1).bench.model_dump() != again[0]


def test_a_property_keeps_its_random_numbers_when_another_is_switched_off():
    with_stop, without = (draw(2, Hypotheses(stop=p)).unknowns for p in (1.0, 0.0))
    assert with_stop["stop_gap"] > 0.0 == without["stop_gap"]
    assert {k: v for k, v in with_stop.items() if "stop" not in k} == {
        k: v for k, v in without.items() if "stop" not in k
    }


def test_everything_at_once_is_in_the_rig():
    twin = draw(1, EVERYTHING)
    options = twin.bench.driver.options
    assert [element["kind"] for element in options["elements"]] == ["cubic", "user", "clearance"]
    assert [joint["kind"] for joint in options["friction"]] == ["iwan"]
    assert len(options["structure"]["frequency_hz"]) == 4
    assert twin.unknowns["gain_factor"] != 1.0


def test_faults_of_the_device_are_those_that_are_supposed():
    faults = {"late_per_s": 0.5, "held_per_s": 0.2, "lost_per_s": 0.1}
    options = draw(1, Hypotheses(**faults)).bench.driver.options
    assert {name: rate for name, rate in options["faults"].items() if rate} == faults


@pytest.mark.slow
def test_properties_come_as_often_as_they_are_probable():
    drawn = [draw(n).unknowns for n in range(200)]
    share = {name: np.mean([one[name] != 0.0 for one in drawn]) for name in ("shift", "joint_shift", "stop_gap")}
    assert share["shift"] == pytest.approx(0.7, abs=0.1)
    assert share["joint_shift"] == pytest.approx(0.2, abs=0.09)
    assert share["stop_gap"] == pytest.approx(0.1, abs=0.07)
    assert all(abs(one["shift"]) <= 0.12 and 1.0 <= one["damping_growth"] <= 1.5 for one in drawn)


def test_a_mode_shape_that_nobody_measured_is_drawn_wide():
    known = knowledge_of_the_magnet_beam()
    guessed = type(known)(**{**vars(known), "shape_measured": False})
    shapes = [[draw(n, knowledge=k).unknowns["drive_shape"] for n in range(60)] for k in (known, guessed)]
    assert np.std(np.log(shapes[0])) < 0.01
    assert np.std(np.log(shapes[1])) == pytest.approx(0.5 * np.log(1.5), rel=0.4)


def test_the_highest_level_is_that_of_harmonic_balance_of_the_linear_rig():
    known = knowledge_of_the_magnet_beam(1e-9)
    twin = draw(0, Hypotheses(hardening=0, softening=0, damping_growth=(1, 1), joint=0, stop=0, second_mode=0, gain=0))
    rig = VirtualDAQ(twin.bench).rig
    exact = phase_resonance_backbone(rig, voltages_v=[max(PLAN.levels)], near_hz=24.37).amplitude_m[0]
    assert highest_displacement_m(magnet_beam(), PLAN, known.linear.rig()) == pytest.approx(exact, rel=0.2)
    sweep = load_plan("magnet-beam/multisine-1")
    assert highest_displacement_m(magnet_beam(), sweep, known.linear.rig()) == pytest.approx(0.3 * 0.006)


def test_a_twin_as_a_file_is_the_same_rig(tmp_path):
    twin = draw(1, EVERYTHING, plan=SHORT)
    write_bench(twin.bench, tmp_path / "twin.toml", ["what it is", "a very long line " * 20])
    read = load_bench(tmp_path / "twin.toml")
    assert run_trial(SHORT, read, 1).points == run_trial(SHORT, twin.bench, 1).points


def test_a_device_of_another_driver_keeps_its_block_and_its_latency():
    known = knowledge_of_the_magnet_beam()
    measured = type(known)(**{**vars(known), "loop_delay_samples": 10 + 0.5 + 20})
    bench = magnet_beam(driver=DriverChoice(name="serial", options={"port": "nowhere"}), block=10)
    daq = VirtualDAQ(draw(0, bench=bench, knowledge=measured).bench)
    assert daq.latency_samples == pytest.approx(20.5)
    assert draw(0, bench=bench, knowledge=measured).bench.block == 10


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("hardening = 0.7\nsoftening = 0.7", "hardening + softening = 1.4: allowed is up to 1"),
        ("shift = [0.1, 0.05]", "`shift` = [0.1, 0.05]"),
        ("stop = 2.0", "stop"),
        ("nonsense = 1", "nonsense"),
    ],
)
def test_wrong_hypotheses_are_named(tmp_path, text, says):
    (tmp_path / "h.toml").write_text(text)
    with refused(ConfigurationError, "toml") as error:
        load_hypotheses(tmp_path / "h.toml")
    assert says in str(error.value)


@pytest.mark.parametrize("exact", [True, False])
def test_images_are_judged_on_a_twin_that_is_the_bench_itself(monkeypatch, exact):
    """Another twin is like the rig near its mode only; images come through what lies far above."""
    known = []

    def run(plan, bench, seed, *, images_known):
        known.append(images_known)
        return not_computed(ValueError("seen"))

    monkeypatch.setattr(rehearsal, "run_trial", run)
    knowledge = None if exact else knowledge_of_the_magnet_beam()
    RehearsalRequest(plan=SHORT, bench=magnet_beam(), knowledge=knowledge, balanced=False)(0)
    assert known == [exact]
