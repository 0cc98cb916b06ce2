"""The friction-joint beam against the paper's modes and against the calibrated modal data that its geometry was fitted to."""

import numpy as np
import pytest

from simulators.structures.structure import LapJointedBeam
from simulators.virtual_rig import VirtualRig

# Mass-normalised shapes of the two suspension modes and the four bending modes.
DRIVE = (0.512743, 0.149233, 0.568833, 0.588332, 0.320331, 0.693546)
SHAPES = {
    "acc_left": (0.512741, 0.224455, 0.445914, 0.653435, -0.023957, 0.405165),
    "acc_right": (0.512326, -0.226913, 0.445913, -0.666046, -0.021894, -0.415496),
    "tip_left": (0.512522, 0.876261, -0.907995, -0.816720, 0.894695, 0.701855),
    "tip_right": (0.510909, -0.878720, -0.904411, 0.826465, 0.880218, -0.709969),
}
# Relative displacement of the legs at the six friction sites, in the four bending modes.
SITES = np.array(
    [
        [-1.580803e-02, -2.643728e-02, -5.468195e-02, -1.075952e-01],
        [-8.887063e-03, -7.471160e-03, -3.682488e-02, -4.720439e-02],
        [-3.687245e-03, 4.619459e-03, -1.793335e-02, -5.197643e-03],
        [3.695105e-03, 4.560572e-03, 1.794195e-02, -6.035011e-03],
        [8.878113e-03, -7.579840e-03, 3.664380e-02, -4.874285e-02],
        [1.577175e-02, -2.657142e-02, 5.417046e-02, -1.093840e-01],
    ]
)
BENDING_HZ = (149.0, 564.3, 1138.3, 1496.5)


@pytest.fixture(scope="module")
def rig() -> VirtualRig:
    return VirtualRig.shipped("friction-beam")


def computed(rig: VirtualRig) -> LapJointedBeam:
    assert isinstance(rig.structure, LapJointedBeam)
    return rig.structure


def test_modes_are_those_of_the_paper(rig: VirtualRig) -> None:
    modes = rig.linear_modes
    assert modes.frequency_hz[2:] == pytest.approx(BENDING_HZ, rel=1e-3)
    assert modes.damping_ratio[3:] == pytest.approx([0.0005, 0.0008, 0.0011], abs=1e-6)
    assert modes.damping_ratio[2] == pytest.approx(0.00158, abs=5e-6)


def test_suspension_modes_lie_far_below_the_first_bending_mode(rig: VirtualRig) -> None:
    assert rig.linear_modes.frequency_hz[:2] == pytest.approx([3.0, 4.5], rel=1e-6)


def test_geometry_alone_has_the_frequencies_within_3_5_percent(rig: VirtualRig) -> None:
    hz = computed(rig).modes.omega_rad_s / (2 * np.pi)
    assert hz[2:] == pytest.approx(BENDING_HZ, rel=0.035)
    assert hz[0] == pytest.approx(3.0, rel=0.01)


def test_geometry_has_the_calibrated_shapes(rig: VirtualRig) -> None:
    assert rig.shape("drive") == pytest.approx(DRIVE, rel=0.02)
    assert rig.shape("drive")[2] == pytest.approx(DRIVE[2], rel=1e-3)
    for at, shape in SHAPES.items():
        assert rig.shape(at) == pytest.approx(np.array(shape), abs=0.013)
        assert rig.shape(at)[2] == pytest.approx(shape[2], abs=0.0025)


def test_geometry_has_the_calibrated_slip_at_the_friction_sites(rig: VirtualRig) -> None:
    slip = np.array([rig.shape(joint.at) for joint in rig.friction])
    # Which leg counts as the upper one turns all signs together.
    slip *= np.sign(slip[0, 2] * SITES[0, 0])
    assert slip[:, 2] == pytest.approx(SITES[:, 0], rel=0.006)
    for mode, share in ((3, 0.025), (4, 0.03), (5, 0.03)):
        largest = np.max(np.abs(SITES[:, mode - 2]))
        assert slip[:, mode] == pytest.approx(SITES[:, mode - 2], abs=share * largest)
    assert np.max(np.abs(slip[:, :2])) < 2e-5


def test_friction_is_part_of_the_interface(rig: VirtualRig) -> None:
    total = sum(joint.stuck_stiffness for joint in rig.friction)
    assert total == pytest.approx(1.117e9, rel=1e-3)
    assert computed(rig).tangential_stiffness_n_m == 1.369e9


def test_channels_are_an_impedance_head_and_two_accelerometers(rig: VirtualRig) -> None:
    assert rig.channel_names == ("force", "drive", "acc_left", "acc_right")
    noise = {sensor.name: sensor.noise_rms for sensor in rig.sensors}
    assert noise == {"force": 0.009, "drive": 0.02, "acc_left": 0.002, "acc_right": 0.002}
    assert rig.sensitivities_v_per_unit == pytest.approx([0.0224, 0.0102, 0.0102, 0.0102])


def test_stinger_is_a_steel_rod_of_2_mm_and_65_mm(rig: VirtualRig) -> None:
    assert rig.stinger.stiffness_n_m == pytest.approx(200e9 * np.pi * 0.001**2 / 0.065, rel=1e-9)


def test_dumped_rig_validates_to_itself(rig: VirtualRig) -> None:
    assert VirtualRig.model_validate_json(rig.model_dump_json()) == rig
    assert set(rig.provenance) == {"published", "calibrated", "chosen", "unverified"}
