from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic import ValidationError

from simulators.scatter import Deviation
from simulators.sites.elements import Magnet
from simulators.stepping import run_open_loop
from simulators.virtual_rig import VirtualRig
from tests.refused import refused
from tests.simulators.references import ideal

EVERYTHING = {
    "frequency": 5e-4,
    "damping": 0.02,
    "joint_stiffness": 0.1,
    "joint_slip": 0.2,
    "magnet_strength": 0.03,
    "magnet_gap": 0.01,
}


def scattering(**scatter: Any) -> VirtualRig:
    return VirtualRig.shipped("magnet-beam", scatter=scatter)


def readings(rig: VirtualRig, seed: int) -> np.ndarray:
    arrays, state = rig.build(seed)
    out_v = np.empty((400, 4))
    run_open_loop(arrays, state, np.sin(0.03 * np.arange(400)), out_v)
    return out_v


def test_nothing_scatters_unasked() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    assert not rig.scatters
    assert rig.realised(1).model_dump() == rig.realised(2).model_dump() == rig.model_dump()
    assert not scattering(**EVERYTHING | {"frequency": 0.0, "damping": 0.0}, assembly=0).scatters
    assert not scattering(assembly=5).scatters


def test_frequencies_of_the_structure_scatter_from_run_to_run_as_asked() -> None:
    rig = VirtualRig.shipped("magnet-beam", elements=[], friction=[], scatter={"frequency": 1e-3})
    runs = np.array([rig.realised(seed).linear_modes.frequency_hz for seed in range(300)])
    relative = runs / rig.linear_modes.frequency_hz - 1.0
    assert np.std(relative, axis=0) == pytest.approx(np.full(4, 1e-3), rel=5 / np.sqrt(600))
    assert np.abs(np.mean(relative, axis=0)).max() < 4e-3 / np.sqrt(300)
    assert np.abs(np.corrcoef(relative.T) - np.eye(4)).max() < 4 / np.sqrt(300)


def test_damping_scatters_from_run_to_run_as_asked() -> None:
    rig = VirtualRig.shipped("magnet-beam", elements=[], friction=[], scatter={"damping": 0.05})
    runs = np.array([rig.realised(seed).linear_modes.damping_ratio for seed in range(300)])
    relative = runs / rig.linear_modes.damping_ratio - 1.0
    assert np.std(relative, axis=0) == pytest.approx(np.full(4, 0.05), rel=5 / np.sqrt(600))


def test_deviation_moves_the_modes_by_what_it_says() -> None:
    rig = ideal(
        friction=(), elements=(), deviation={"frequency": [0.01, 0.0, -0.02, 0.0], "damping": [0.5, 0, 0, -0.5]}
    )
    nominal = ideal(friction=(), elements=()).linear_modes
    assert rig.linear_modes.frequency_hz / nominal.frequency_hz == pytest.approx([1.01, 1.0, 0.98, 1.0], rel=1e-6)
    assert rig.linear_modes.damping_ratio / nominal.damping_ratio == pytest.approx([1.5, 1.0, 1.0, 0.5], rel=1e-6)


def test_deviated_structure_is_the_structure_with_other_modal_data() -> None:
    modes = {
        "frequency_hz": [20.0, 130.0],
        "damping_ratio": [0.004, 0.001],
        "shapes": {"drive": [1.0, -0.7], "m": [2, 1]},
    }
    sensors = [ideal().sensors[1].model_dump() | {"at": "m"}]
    parts = {"friction": [], "elements": [ideal().elements[0].model_dump() | {"at": "m"}], "sensors": sensors}
    moved = modes | {"frequency_hz": [20.2, 130.0], "damping_ratio": [0.004, 0.0011]}
    direct = VirtualRig.shipped("magnet-beam", structure={"kind": "modal"} | moved, **parts)
    deviation = {"frequency": [0.01, 0.0], "damping": [0.0, 0.1]}
    by_deviation = VirtualRig.shipped("magnet-beam", structure={"kind": "modal"} | modes, deviation=deviation, **parts)
    assert by_deviation.plant.dynamics == pytest.approx(direct.plant.dynamics, rel=1e-12, abs=1e-9)
    assert by_deviation.plant.modal_stiffness == pytest.approx(direct.plant.modal_stiffness, rel=1e-12)
    assert by_deviation.plant.modal_damping == pytest.approx(direct.plant.modal_damping, rel=1e-12)


def test_assembly_scatters_joints_and_magnets_whatever_the_seed() -> None:
    rig = scattering(**EVERYTHING, assembly=3)
    first, second = rig.realised(1), rig.realised(2)
    assert first.friction == second.friction != rig.friction
    assert first.elements == second.elements != rig.elements
    assert first.deviation != second.deviation
    other = scattering(**EVERYTHING, assembly=4).realised(1)
    assert other.friction != first.friction
    assert other.deviation == first.deviation


def test_joints_and_magnets_scatter_by_what_was_asked_for() -> None:
    drawn = [scattering(**EVERYTHING, assembly=k).realised(0) for k in range(1, 301)]
    nominal = VirtualRig.shipped("magnet-beam")
    (magnet,), (joint,) = nominal.elements, nominal.friction
    assert isinstance(magnet, Magnet)
    factors = {
        "joint_stiffness": [rig.friction[0].stiffness[2] / joint.stiffness[2] for rig in drawn],
        "joint_slip": [rig.friction[0].slip[2] / joint.slip[2] for rig in drawn],
        "magnet_strength": [rig.elements[0].strength_n_m4 / magnet.strength_n_m4 for rig in drawn],
        "magnet_gap": [rig.elements[0].gap_m / magnet.gap_m for rig in drawn],
    }
    for name, values in factors.items():
        assert np.std(np.log(values)) == pytest.approx(EVERYTHING[name], rel=5 / np.sqrt(600))
    assert np.abs(np.corrcoef(list(factors.values())) - np.eye(4)).max() < 4 / np.sqrt(300)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**63 - 1), assembly=st.integers(0, 2**63 - 1))
def test_same_seed_and_assembly_give_the_same_rig(seed: int, assembly: int) -> None:
    rig = scattering(**EVERYTHING, assembly=assembly)
    assert rig.realised(seed).model_dump() == rig.realised(seed).model_dump()
    assert np.array_equal(readings(rig, seed), readings(rig, seed))
    assert np.array_equal(readings(rig, seed), readings(rig.realised(seed), seed))


def test_realised_rig_has_nothing_left_to_draw() -> None:
    drawn = scattering(**EVERYTHING, assembly=2).realised(7)
    assert not drawn.scatters
    assert drawn.realised(8).model_dump() == drawn.model_dump()


def test_one_more_scattering_quantity_leaves_the_others_as_they_were() -> None:
    few, many = scattering(frequency=5e-4).realised(4), scattering(**EVERYTHING, assembly=1).realised(4)
    assert few.deviation.frequency == many.deviation.frequency
    assert few.deviation.damping == (0.0,) * 4


def test_scatter_leaves_the_noise_as_it_was() -> None:
    plain, scattered = VirtualRig.shipped("magnet-beam"), scattering(frequency=5e-4)
    assert np.array_equal(plain.build(3)[0].noise_keys, scattered.build(3)[0].noise_keys)


def test_scatter_comes_on_top_of_a_deviation() -> None:
    rig = VirtualRig.shipped("magnet-beam", deviation={"frequency": [0.02, 0, 0, 0]}, scatter={"frequency": 1e-4})
    alone = scattering(frequency=1e-4).realised(5).deviation.frequency
    both = rig.realised(5).deviation.frequency
    assert 1.0 + both[0] == pytest.approx(1.02 * (1.0 + alone[0]), rel=1e-14)
    assert both[1:] == pytest.approx(alone[1:], rel=1e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scatter": {"frequency": 0.5}}, {"field": "scatter.frequency", "value": 0.5}),
        ({"scatter": {"assembly": -1}}, {"field": "scatter.assembly", "value": -1}),
        ({"deviation": {"frequency": [0.1]}}, {"field": "deviation.frequency", "allowed": "4, one per mode, or none"}),
        ({"deviation": {"damping": [-1.0, 0, 0, 0]}}, {"field": "deviation.damping.0", "value": -1.0}),
    ],
)
def test_scatter_that_is_not_physical_is_refused(changes: dict[str, Any], message: dict[str, object]) -> None:
    with refused(ValidationError, **message):
        VirtualRig.shipped("magnet-beam", **changes)


def test_deviation_of_nothing_is_none() -> None:
    assert Deviation().combined(np.ones(2), np.ones(2)) == Deviation(frequency=(0.0, 0.0), damping=(0.0, 0.0))
