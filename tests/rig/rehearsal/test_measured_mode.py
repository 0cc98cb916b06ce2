"""A mode that was measured at low levels is the mode of the twins there, and a guess beyond."""

import dataclasses

import numpy as np
import pytest

from identification import nonlinear_mode
from rig.drivers.virtual import VirtualDAQ
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.knowledge import Knowledge
from rig.rehearsal.twins import draw_twin
from simulators.analysis import phase_resonance_backbone
from tests.rig.rehearsal.known import knowledge_of_the_magnet_beam
from tests.rig.rehearsal.plans import PLAN, magnet_beam

NOTHING = Hypotheses(stop=0.0, second_mode=0.0, gain=0.0, frequency_drift=0.0, damping_drift=0.0)


@pytest.fixture(scope="module")
def measured():
    import rig

    plan = PLAN.model_copy(update={"levels_v": (0.2618, 0.5852, 1.0743, 1.6525, 2.2971), "record_periods": 20})
    with rig.run(plan) as run:
        return nonlinear_mode(run.backbone())


def backbone_of(measured, number, amplitudes_m):
    known = knowledge_of_the_magnet_beam(1e-6)
    told = Knowledge(**{**vars(known), "mode": measured})
    twin = draw_twin(magnet_beam(), PLAN, told, NOTHING, 0, number)
    return phase_resonance_backbone(VirtualDAQ(twin.bench).rig, amplitudes_m=amplitudes_m, near_hz=24.37)


def test_twins_have_the_measured_shift_and_damping(measured):
    for number in range(4):
        found = backbone_of(measured, number, [1e-5, *measured.amplitude_m])
        shift = found.modal_frequency_hz[1:] / found.modal_frequency_hz[0] - 1.0
        asked = measured.modal_frequency_hz / 24.371 - 1.0
        assert np.max(np.abs(shift - asked)) < 5e-4, number
        assert np.max(np.abs(found.damping_ratio[1:] / measured.damping_ratio - 1.0)) < 0.1, number


def test_twins_have_the_mode_of_a_stop_that_was_met(measured):
    amplitude = np.geomspace(1e-4, 1e-3, 5)
    gap = 0.45e-3
    ratio = np.minimum(gap / amplitude, 1.0)
    added = 0.2 * (
        1.0 - 2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
    )  # Gelb and Vander Velde, 1968
    frequency_hz = 24.37 * np.sqrt(1.0 + added)
    assert frequency_hz[-1] > 1.03 * frequency_hz[0]
    stopped = dataclasses.replace(
        measured,
        amplitude_m=amplitude,
        modal_frequency_hz=frequency_hz,
        modal_frequency_std_hz=np.full(5, 1e-4),
        damping_ratio=np.full(5, 0.004),
        damping_ratio_std=np.full(5, 1e-5),
    )
    found = backbone_of(stopped, 0, amplitude)
    np.testing.assert_allclose(found.modal_frequency_hz, frequency_hz, rtol=2e-3)


def test_a_stop_within_what_was_measured_is_no_longer_a_hypothesis(measured):
    known = knowledge_of_the_magnet_beam(1e-6)
    always = NOTHING.model_copy(update={"stop": 1.0, "stop_gap": (0.2, 1.0)})
    highest = dataclasses.replace(
        measured, amplitude_m=measured.amplitude_m * 10.0
    )  # beyond all that the plan asks for
    for mode, seen in ((None, True), (highest, False)):
        told = dataclasses.replace(known, mode=mode)
        gaps = [draw_twin(magnet_beam(), PLAN, told, always, 0, number).unknowns["stop_gap"] for number in range(4)]
        assert [gap > 0.0 for gap in gaps] == [seen] * 4


def test_twins_differ_beyond_what_was_measured_more_than_below(measured):
    inside, beyond = float(measured.amplitude_m[-1]), 2.0 * float(measured.amplitude_m[-1])
    found = [backbone_of(measured, number, [inside, beyond]).modal_frequency_hz for number in range(8)]
    low, high = np.std(found, axis=0) / np.mean(found, axis=0)
    assert low < 3e-4
    assert high > 5.0 * low
