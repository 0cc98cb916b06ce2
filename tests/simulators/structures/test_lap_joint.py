"""The lap-jointed beam against beams whose modes are known: a glued joint, no joint at all, hinges and masses."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.linalg import eigh

from simulators.structures.beam import Lump, Spring
from simulators.structures.lap_joint import Interface, LapJointModes, LapMesh, Section, lap_joint_modes
from simulators.structures.structure import LapJointedBeam
from tests.refused import refused

LENGTH_M, LAP_M = 0.72, 0.12
STEEL = Section(193e9, 7900.0, 0.0254, 0.0254)
AREA_M2 = STEEL.width_m * STEEL.thickness_m
MASS_KG = STEEL.density_kg_m3 * AREA_M2 * LENGTH_M


def jointed(
    tangential: float,
    normal: float,
    section: Section = STEEL,
    n_mode: int = 6,
    n_lap: int = 12,
    lumps: tuple[Lump, ...] = (),
    springs: tuple[Spring, ...] = (),
) -> LapJointModes:
    mesh = LapMesh(LENGTH_M, LAP_M, section.thickness_m, 10, n_lap)
    interface = Interface(tangential, normal, (0.33, 0.36, 0.39), 0.012, 0.1)
    return lap_joint_modes(mesh, section, interface, n_mode, lumps, springs)


def uniform_rayleigh_omega(n_mode: int) -> np.ndarray:
    """Free-free Rayleigh beam by Ritz in Legendre polynomials: a method that shares nothing with finite elements."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    basis = [np.polynomial.legendre.Legendre.basis(k) for k in range(24)]
    value, slope, curvature = (np.array([p.deriv(d)(nodes) if d else p(nodes) for p in basis]) for d in (0, 1, 2))
    half = LENGTH_M / 2
    inertia = AREA_M2 * STEEL.thickness_m**2 / 12
    stiffness = STEEL.youngs_modulus_pa * inertia / half**3 * (curvature * weights) @ curvature.T
    mass = STEEL.density_kg_m3 * AREA_M2 * half * (value * weights) @ value.T
    mass += STEEL.density_kg_m3 * inertia / half * (slope * weights) @ slope.T
    squared = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(squared[2 : 2 + n_mode])


def test_glued_joint_is_the_full_thickness_beam() -> None:
    # The glue hands a leg's bending moment over as a couple of forces one element apart: an error of first order.
    exact = uniform_rayleigh_omega(4)
    coarse, fine = (jointed(1e17, 1e17, n_lap=n).omega_rad_s[2:] for n in (40, 80))
    assert np.abs(coarse / exact - 1.0) == pytest.approx(np.zeros(4), abs=0.012)
    assert (coarse - exact) / (fine - exact) == pytest.approx(np.full(4, 2.0), abs=0.15)
    assert 2.0 * fine - coarse == pytest.approx(exact, rel=1e-3)


def test_glued_joint_does_not_slip_and_a_free_one_does() -> None:
    assert np.max(np.abs(jointed(1e16, 1e16).slip(0.33))) < 1e-6
    free = jointed(0.0, 1e10)
    assert np.count_nonzero(free.omega_rad_s == 0.0) == 3  # the halves slide apart
    assert np.min(np.abs(free.slip(0.33)[3:])) > 1e-2


def test_without_an_interface_there_are_two_separate_beams() -> None:
    # Each half alone is an arm with a leg, free: two rigid motions each, one axial motion left (the common one is out).
    modes = jointed(0.0, 0.0, n_mode=8)
    assert np.count_nonzero(modes.omega_rad_s == 0.0) == 5
    # The two halves are each other's image: their elastic modes come in pairs.
    assert modes.omega_rad_s[5] == pytest.approx(modes.omega_rad_s[6], rel=1e-9)


def test_legs_that_slide_freely_bend_as_two_thin_beams() -> None:
    # Nearly all of the beam is lap: held together but sliding it has a quarter of the full bending stiffness.
    thin = STEEL._replace(thickness_m=0.006)
    mesh = LapMesh(LENGTH_M, 0.716, thin.thickness_m, 2, 100)
    modes = lap_joint_modes(mesh, thin, Interface(0.0, 1e12, (0.36,), 0.1, 1.0), 5)
    stiffness = thin.youngs_modulus_pa * thin.thickness_m**2 / 12 / thin.density_kg_m3
    full = np.array([4.7300407449, 7.8532046241]) ** 2 / LENGTH_M**2 * np.sqrt(stiffness)
    assert modes.omega_rad_s[3:] == pytest.approx(full / 2.0, rel=5e-3)


def test_modes_are_orthonormal_with_lumps_and_have_the_right_rigid_motions() -> None:
    lump = Lump(0.36, 0.1)
    modes = jointed(1e9, 1e9, n_mode=2, lumps=(lump,))
    inertia = MASS_KG * LENGTH_M**2 / 12 + MASS_KG * STEEL.thickness_m**2 / 12
    places = np.array([0.0, 0.2, 0.36, 0.5, LENGTH_M])
    shapes = np.array([modes.shape(x) for x in places])
    # Any two orthonormal rigid motions w = a + b (x - L/2): sum over modes of their products is 1/m + x y / J.
    products = shapes @ shapes.T
    expected = 1 / (MASS_KG + lump.mass_kg) + np.outer(places - 0.36, places - 0.36) / inertia
    assert products == pytest.approx(expected, rel=1e-4)


def test_suspension_modes_are_those_of_a_rigid_body_on_springs() -> None:
    stiffness, arm = 676.0, 0.33
    modes = jointed(1e9, 1e9, springs=(Spring(0.03, stiffness), Spring(0.69, stiffness)))
    inertia = MASS_KG * (LENGTH_M**2 + STEEL.thickness_m**2) / 12
    expected = np.sqrt([2 * stiffness / MASS_KG, 2 * stiffness * arm**2 / inertia])
    assert modes.omega_rad_s[:2] == pytest.approx(expected, rel=2e-3)


def test_slip_is_odd_about_the_middle_in_modes_that_are_even_and_the_other_way_round() -> None:
    modes = jointed(1.4e9, 6e8)
    left, right = modes.slip(0.33), modes.slip(0.39)
    even = modes.shape(0.0) * modes.shape(LENGTH_M) > 0
    assert list(even[2:]) == [True, False, True, False]
    assert right[2:] == pytest.approx(np.where(even, -1.0, 1.0)[2:] * left[2:], rel=1e-6)


@pytest.mark.parametrize("position_m", [0.01, 0.2, 0.305, 0.3612, 0.5])
def test_slope_and_curvature_are_the_derivatives_of_the_deflection(position_m: float) -> None:
    modes, step = jointed(1.4e9, 6e8), 1e-5
    left, right = modes.shape(position_m - step), modes.shape(position_m + step)
    slopes = modes.shape(position_m + step, "slope") - modes.shape(position_m - step, "slope")
    assert modes.shape(position_m, "slope") == pytest.approx((right - left) / (2 * step), rel=1e-6, abs=1e-6)
    assert modes.shape(position_m, "curvature") == pytest.approx(slopes / (2 * step), rel=1e-6, abs=1e-4)


def test_edge_of_the_lap_belongs_to_the_arm() -> None:
    modes = jointed(1.4e9, 6e8)
    for edge, outwards in ((0.30, -1.0), (0.42, 1.0)):
        assert modes.shape(edge) == pytest.approx(modes.shape(edge + outwards * 1e-8), abs=1e-6)


TABLE: dict[str, Any] = {
    "kind": "lap-jointed-beam",
    "length_m": LENGTH_M,
    "width_m": 0.0254,
    "thickness_m": 0.0254,
    "lap_length_m": LAP_M,
    "youngs_modulus_pa": 193e9,
    "density_kg_m3": 7900.0,
    "tangential_stiffness_n_m": 1.4e9,
    "normal_stiffness_n_m": 6e8,
    "bolts_m": [0.36],
    "bolt_width_m": 0.01,
    "damping_ratio": [0.01] * 4,
    "points_m": {"drive": 0.3},
    "sites_m": {"joint": 0.35},
}
BAD = [
    ({"sites_m": {"joint": 0.2}}, {"field": "sites_m.joint", "value": 0.2, "allowed": "the lap, 0.3 to 0.42"}),
    ({"bolts_m": [0.5]}, {"field": "bolts_m[0]", "value": 0.5, "allowed": "the lap, 0.3 to 0.42"}),
    ({"lap_length_m": 0.8}, {"field": "lap_length_m", "value": 0.8, "allowed": "less than `length_m` = 0.72"}),
    ({"sites_m": {"drive": 0.35}}, {"field": "sites_m.drive", "allowed": "a name of its own"}),
    ({"tangential_stiffness_n_m": -1.0}, {"field": "tangential_stiffness_n_m", "value": -1.0}),
    ({"damping_ratio": [0.01] * 99}, {"field": "damping_ratio", "allowed": "1 to 40"}),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_joint_is_refused_with_the_field_and_what_is_allowed(
    change: dict[str, Any], message: dict[str, object]
) -> None:
    with refused(ValidationError, **message):
        LapJointedBeam.model_validate(TABLE | change)


def test_sites_are_asked_for_like_points_but_have_no_slope() -> None:
    beam = LapJointedBeam.model_validate(TABLE)
    assert beam.points == ("drive", "joint")
    assert np.array_equal(beam.shape("joint"), beam.modes.slip(0.35))
    with refused(ValueError, field="quantity", value="slope", allowed="'deflection' at the friction site 'joint'"):
        beam.shape("joint", "slope")
