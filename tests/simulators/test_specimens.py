import numpy as np
import pytest

from simulators.shipped import shipped_specimens
from simulators.virtual_rig import VirtualRig

# The calibrated modal data that the shipped geometry must reproduce: angular frequencies without and with magnets
# (rad/s), shapes at the drive point, at the magnets and 20 mm beside the drive point, and curvature at the clamp.
CALIBRATED = {
    "magnet-beam": {
        "w": (134.33145243736072, 842.3211659367203, 2393.0135287940807, 4574.365411784478),
        "wl": (153.12120871342674, 842.3238222968191, 2393.4889252366916, 4574.889777768314),
        "drive": (0.9080744739291134, 1.5294361628801267, 0.4738499040170419, 1.3854900503220586),
        "magnet": (1.6140099273873727, -0.04627745908587873, 1.0469467282931442, -1.520358999108218),
        "acc_drive": (1.0109175152743386, 1.4034112839572077, 0.8758940122677026, 0.9926106663849483),
        "acc_magnet": (1.445396963446029, 0.45409639893513754, 1.4096214736702282, -1.2612758190659188),
        "clamp": (26.79440433672297, 164.7005491045365, -477.8669750976918, -877.568267465864),
    },
    "magnet-beam-symmetric": {
        "w": (135.0883096153273, 842.3214907223462, 2406.7495846177376, 4565.392482733142),
        "wl": (153.1211854051811, 842.3238222597075, 2407.230082550399, 4565.858129676754),
        "drive": (0.7725189867956028, 1.6185660418008103, 0.11887217858549058, 1.523593884132855),
        "magnet": (1.6154952131345623, -0.04424536463471648, -1.0770851070294138, -1.4604691616377705),
        "acc_drive": (0.8711750922446017, 1.558315353383994, -0.34337259883840243, 1.4482935568603696),
        "acc_magnet": (1.4466681490833697, 0.45192188211503637, -1.4480652264758516, -1.2165693994861848),
        "clamp": (26.820071439573162, 164.79099428728292, 470.26423571487476, -899.2996817142191),
    },
}


@pytest.fixture(params=sorted(CALIBRATED))
def specimen(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_every_shipped_specimen_is_tested_here() -> None:
    assert set(shipped_specimens()) == {*CALIBRATED, "friction-beam"}  # the last has a file of its own


def test_geometry_reproduces_the_calibrated_frequencies(specimen: str) -> None:
    rig, data = VirtualRig.shipped(specimen), CALIBRATED[specimen]
    assert rig.structure.omega_rad_s == pytest.approx(data["w"], rel=1e-7)
    assert 2 * np.pi * rig.linear_modes.frequency_hz == pytest.approx(data["wl"], rel=1e-7)


def test_geometry_reproduces_the_calibrated_shapes(specimen: str) -> None:
    rig, data = VirtualRig.shipped(specimen), CALIBRATED[specimen]
    for at in ("drive", "magnet", "acc_drive", "acc_magnet"):
        assert rig.shape(at) == pytest.approx(data[at], abs=1e-8)
    assert rig.plant.signs * rig.structure.shape("clamp", "curvature") == pytest.approx(data["clamp"], rel=1e-7)


def test_first_modes_are_those_of_the_paper(specimen: str) -> None:
    modes = VirtualRig.shipped(specimen).linear_modes
    assert modes.frequency_hz[:2] == pytest.approx([24.370, 134.06], abs=5e-4)
    assert modes.damping_ratio[:2] == pytest.approx([0.00400, 0.0007], abs=1e-6)


@pytest.mark.parametrize(("name", "ratio"), [("magnet-beam", 1.113), ("magnet-beam-symmetric", 1.128)])
def test_accelerometer_beside_the_drive_point_reads_more_than_the_drive_point(name: str, ratio: float) -> None:
    rig = VirtualRig.shipped(name)
    assert rig.shape("acc_drive")[0] / rig.shape("drive")[0] == pytest.approx(ratio, abs=5e-4)


def test_coupled_rig_has_another_mode_than_the_structure() -> None:
    modes = VirtualRig.shipped("magnet-beam").coupled_modes
    assert modes.frequency_hz[0] == pytest.approx(25.1, abs=0.05)
    assert modes.damping_ratio[0] == pytest.approx(0.07, abs=0.005)


def test_channels_come_in_the_documented_order(specimen: str) -> None:
    assert VirtualRig.shipped(specimen).channel_names == ("force", "drive", "acc_drive", "acc_magnet")


def test_every_number_that_was_chosen_is_said_to_be(specimen: str) -> None:
    assert set(VirtualRig.shipped(specimen).provenance) == {"published", "calibrated", "chosen", "unverified"}


def test_dumped_rig_validates_to_itself(specimen: str) -> None:
    rig = VirtualRig.shipped(specimen, converter={"substeps": 4})
    again = VirtualRig.model_validate(rig.model_dump())
    assert again == rig
    assert again.converter.substeps == 4
    assert VirtualRig.model_validate_json(rig.model_dump_json()) == rig


def test_given_modes_make_the_same_rig_as_the_geometry_they_came_from() -> None:
    beam = VirtualRig.shipped("magnet-beam")
    shapes = {at: tuple(beam.structure.shape(at)) for at in ("drive", "magnet", "acc_drive", "acc_magnet")}
    curvature = beam.structure.shape("clamp", "curvature")
    table = beam.model_dump() | {
        "specimen": None,
        "structure": {
            "kind": "modal",
            "frequency_hz": tuple(beam.structure.omega_rad_s / (2 * np.pi)),
            "damping_ratio": beam.structure.damping_ratio,
            "shapes": shapes | {"clamp": tuple(curvature / curvature[0])},
        },
    }
    table["friction"] = [table["friction"][0] | {"quantity": "deflection", "relative_to_mode_1": False}]
    modal = VirtualRig.model_validate(table)
    assert modal.plant.dynamics == pytest.approx(beam.plant.dynamics, rel=1e-12)
    assert np.abs(modal.plant.site_rows) == pytest.approx(np.abs(beam.plant.site_rows), rel=1e-12)
