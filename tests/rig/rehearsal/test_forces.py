"""Hypothesised forces do to a mode what they are made for, by closed forms and by harmonic balance."""

import math

import numpy as np
import pytest

from rig.drivers.virtual import VirtualDAQ
from rig.rehearsal.forces import damping_for, describing_function, hardening_for, softening_for, spring_through
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.twins import draw_twin
from simulators.analysis import phase_resonance_backbone
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import PLAN, magnet_beam

NOTHING = {
    "hardening": 0.0,
    "softening": 0.0,
    "damping_growth": (1.0, 1.0),
    "joint": 0.0,
    "stop": 0.0,
    "second_mode": 0.0,
}
NOTHING |= {"gain": 0.0, "frequency_drift": 0.0, "damping_drift": 0.0}


def test_describing_functions_are_those_of_the_textbook():
    assert describing_function(lambda x: x**3, 2.0) == pytest.approx(0.75 * 4.0)
    assert describing_function(lambda x: x * np.abs(x), 2.0) == pytest.approx(8.0 / (3.0 * math.pi) * 2.0, rel=1e-5)


@pytest.mark.parametrize(("power", "place"), [(4, 1), (6, 2)])
def test_steeper_springs_add_their_stiffness_at_their_amplitude(power, place):
    spring = hardening_for("drive", 500.0, 2e-3, power)
    *stiffnesses, scale = spring["parameters"]
    assert [k > 0.0 for k in stiffnesses] == [n == place for n in range(3)]
    found = describing_function(lambda x: stiffnesses[place] * (x / scale) ** power * x, 2e-3)
    assert found == pytest.approx(500.0)


def test_a_steep_spring_of_micrometres_is_one_that_a_rig_takes():
    spring = hardening_for("drive", 1e6, 1e-6, 6)
    assert max(map(abs, spring["parameters"])) < 1e30  # the largest number of a rig's file


def test_a_spring_goes_through_any_stiffness_over_the_amplitude():
    amplitudes = np.array([1.0, 1.4, 2.0, 2.8]) * 1e-4
    asked = np.array([0.0, 0.0, 300.0, 250.0])  # flat, a stop, and softer again
    spring = spring_through("drive", amplitudes, asked)
    found = [
        describing_function(lambda x: np.interp(x, spring["deflection_m"], spring["force_n"]), amplitude)
        for amplitude in amplitudes
    ]
    assert found == pytest.approx(asked, abs=3.0)  # the gaps lie between nodes of the table


def test_springs_add_their_stiffness_at_their_amplitude():
    cubic = hardening_for("drive", 500.0, 2e-3)
    assert 0.75 * cubic["stiffness_n_m3"] * (2e-3) ** 2 == pytest.approx(500.0)
    factor, bound = softening_for("drive", -500.0, 2e-3)["parameters"]
    assert describing_function(lambda x: factor * x**3 / (1 + (x / bound) ** 2), 2e-3) == pytest.approx(-500.0)
    secant = factor * bound**2  # the most it ever takes from the stiffness
    assert -1.0e3 < secant < -500.0


@pytest.mark.parametrize(("kind", "powers"), [("hardening", (2,)), ("hardening", (6,)), ("softening", (2,))])
def test_a_twin_shifts_by_what_was_drawn(kind, powers):
    hypotheses = Hypotheses(**{**NOTHING, kind: 1.0, "shift": (0.03, 0.03), "hardening_powers": powers})
    twin = draw_twin(magnet_beam(), PLAN, knowledge_of_the_magnet_beam(1e-6), hypotheses, 0, 0)
    rig = VirtualDAQ(twin.bench).rig
    low, high = 1e-6, 0.0021  # of the highest level on the linear rig, 3.0948 V
    found = phase_resonance_backbone(rig, amplitudes_m=[low, high], near_hz=24.37)
    shift = found.modal_frequency_hz[1] / found.modal_frequency_hz[0] - 1.0
    assert shift == pytest.approx(0.03 if kind == "hardening" else -0.03, rel=0.1)
    assert twin.unknowns["shift"] == pytest.approx(math.copysign(0.03, shift))


def test_a_twins_damping_grows_by_what_was_drawn():
    hypotheses = Hypotheses(**{**NOTHING, "damping_growth": (2.5, 2.5)})
    twin = draw_twin(magnet_beam(), PLAN, knowledge_of_the_magnet_beam(1e-6), hypotheses, 0, 0)
    found = phase_resonance_backbone(VirtualDAQ(twin.bench).rig, amplitudes_m=[1e-6, 0.0021], near_hz=24.37)
    assert found.damping_ratio[1] / found.damping_ratio[0] == pytest.approx(2.5, rel=0.1)


def test_drag_dissipates_what_a_damper_would():
    table = damping_for("drive", 3.0, 0.4)
    assert 8.0 / (3.0 * math.pi) * table["parameters"][0] * 0.4 == pytest.approx(3.0)
