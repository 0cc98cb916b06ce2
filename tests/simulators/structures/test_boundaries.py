"""Frequencies of uniform beams against the characteristic equations of the textbooks (beta L of each boundary)."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import brentq

from simulators.structures.beam import BeamModes, Boundary, Lump, Spring, beam_modes
from simulators.structures.structure import BeamStructure
from tests.refused import refused

LENGTH_M, STIFFNESS, MASS = 0.55, 184.0, 1.3
PI = np.pi
TAN_IS_TANH = (3.9266023120, 7.0685827456, 10.2101761228)
COS_COSH_IS_1 = (4.7300407449, 7.8532046241, 10.9956078380)
TAN_IS_MINUS_TANH = (2.3650203724, 5.4978039190, 8.6393798287)

# Number of rigid-body modes, then beta L of the first three elastic ones.
CLOSED_FORM: dict[Boundary, tuple[int, tuple[float, float, float]]] = {
    "clamped-free": (0, (1.8751040687, 4.6940911330, 7.8547574382)),
    "clamped-clamped": (0, COS_COSH_IS_1),
    "clamped-pinned": (0, TAN_IS_TANH),
    "clamped-guided": (0, TAN_IS_MINUS_TANH),
    "pinned-pinned": (0, (PI, 2 * PI, 3 * PI)),
    "pinned-guided": (0, (PI / 2, 3 * PI / 2, 5 * PI / 2)),
    "pinned-free": (1, TAN_IS_TANH),
    "guided-guided": (1, (PI, 2 * PI, 3 * PI)),
    "guided-free": (1, TAN_IS_MINUS_TANH),
    "free-free": (2, COS_COSH_IS_1),
}
MIRRORED: dict[Boundary, Boundary] = {
    "clamped-free": "free-clamped",
    "clamped-pinned": "pinned-clamped",
    "clamped-guided": "guided-clamped",
    "pinned-guided": "guided-pinned",
    "pinned-free": "free-pinned",
    "guided-free": "free-guided",
}


def beam(
    boundary: Boundary, n_mode: int = 4, springs: tuple[Spring, ...] = (), lumps: tuple[Lump, ...] = ()
) -> BeamModes:
    return beam_modes(
        length_m=LENGTH_M,
        bending_stiffness_n_m2=STIFFNESS,
        mass_per_length_kg_m=MASS,
        n_element=60,
        n_mode=n_mode,
        boundary=boundary,
        springs=springs,
        lumps=lumps,
    )


def omega_rad_s(beta_l: tuple[float, ...]) -> np.ndarray:
    omega: np.ndarray = np.array(beta_l) ** 2 / LENGTH_M**2 * np.sqrt(STIFFNESS / MASS)
    return omega


@pytest.mark.parametrize("boundary", sorted(CLOSED_FORM))
def test_frequencies_are_those_of_the_closed_form_for_every_boundary(boundary: Boundary) -> None:
    n_rigid, beta_l = CLOSED_FORM[boundary]
    omega = beam(boundary, n_rigid + 3).omega_rad_s
    assert np.all(omega[:n_rigid] == 0.0)
    assert omega[n_rigid:] == pytest.approx(omega_rad_s(beta_l), rel=3e-6)


@pytest.mark.parametrize("boundary", sorted(MIRRORED))
def test_turned_beam_has_the_same_frequencies_and_the_mirrored_shapes(boundary: Boundary) -> None:
    here, turned = beam(boundary), beam(MIRRORED[boundary])
    assert turned.omega_rad_s == pytest.approx(here.omega_rad_s, rel=1e-8)
    assert np.abs(turned.shape(0.12)) == pytest.approx(np.abs(here.shape(LENGTH_M - 0.12)), rel=1e-6)


def test_ends_are_held_as_their_names_say() -> None:
    modes = beam("pinned-guided")
    assert modes.shape(0.0) == pytest.approx(np.zeros(4), abs=1e-12)
    assert modes.shape(LENGTH_M, "slope") == pytest.approx(np.zeros(4), abs=1e-9)
    assert np.all(np.abs(modes.shape(0.0, "slope")) > 1.0)
    assert np.all(np.abs(modes.shape(LENGTH_M)) > 0.1)


def test_free_beam_on_soft_springs_has_the_suspension_modes_of_a_rigid_body() -> None:
    stiffness, inset = 20.0, 0.03
    modes = beam("free-free", 3, (Spring(inset, stiffness), Spring(LENGTH_M - inset, stiffness)))
    mass = MASS * LENGTH_M
    arm = LENGTH_M / 2 - inset
    bounce, pitch = np.sqrt(2 * stiffness / mass), np.sqrt(2 * stiffness * arm**2 / (mass * LENGTH_M**2 / 12))
    assert modes.omega_rad_s[:2] == pytest.approx([bounce, pitch], rel=1e-3)
    assert modes.omega_rad_s[2] == pytest.approx(omega_rad_s((4.7300407449,))[0], rel=2e-3)


def test_one_spring_leaves_one_rigid_body_mode() -> None:
    assert np.count_nonzero(beam("free-free", 3, (Spring(0.1, 50.0),)).omega_rad_s == 0.0) == 1


def test_cantilever_with_a_spring_at_its_tip_is_the_closed_form() -> None:
    kappa = 7.0

    def characteristic(x: float) -> float:
        closed = x**3 * (1 + np.cos(x) * np.cosh(x))
        return float(closed + kappa * (np.sin(x) * np.cosh(x) - np.cos(x) * np.sinh(x)))

    spring = Spring(LENGTH_M, kappa * STIFFNESS / LENGTH_M**3)
    beta_l = (brentq(characteristic, 1.8752, 3.9), brentq(characteristic, 4.6, 5.4))
    assert beam("clamped-free", 2, (spring,)).omega_rad_s == pytest.approx(omega_rad_s(beta_l), rel=1e-6)


def test_stiff_rotational_spring_makes_a_pinned_end_a_clamped_one() -> None:
    spring = Spring(0.0, 0.0, 1e9 * STIFFNESS / LENGTH_M)
    assert beam("pinned-free", 3, (spring,)).omega_rad_s == pytest.approx(
        omega_rad_s((1.8751040687, 4.6940911330, 7.8547574382)), rel=1e-6
    )


def test_rotational_spring_at_a_pin_is_the_closed_form() -> None:
    # Pinned-pinned with a rotational spring r EI/L at one end.
    r = 3.0

    def characteristic(x: float) -> float:
        return float(2 * x * np.sin(x) * np.sinh(x) + r * (np.sin(x) * np.cosh(x) - np.cos(x) * np.sinh(x)))

    beta_l = (brentq(characteristic, PI, 3.92), brentq(characteristic, 2 * PI, 7.06))
    modes = beam("pinned-pinned", 2, (Spring(0.0, 0.0, r * STIFFNESS / LENGTH_M),))
    assert modes.omega_rad_s == pytest.approx(omega_rad_s(beta_l), rel=1e-6)


def test_rotary_inertia_at_the_tip_lowers_the_frequencies_as_in_the_closed_form() -> None:
    ratio = 0.05

    def characteristic(x: float) -> float:
        return float(1 + np.cos(x) * np.cosh(x) - ratio * x**3 * (np.sin(x) * np.cosh(x) + np.cos(x) * np.sinh(x)))

    beta_l = (brentq(characteristic, 1.0, 1.8751), brentq(characteristic, 2.0, 4.6940))
    modes = beam("clamped-free", 2, lumps=(Lump(LENGTH_M, 0.0, ratio * MASS * LENGTH_M**3),))
    assert modes.omega_rad_s == pytest.approx(omega_rad_s(beta_l), rel=1e-6)


TABLE = {
    "kind": "beam",
    "length_m": 0.5,
    "width_m": 0.03,
    "thickness_m": 0.005,
    "youngs_modulus_pa": 70e9,
    "density_kg_m3": 2700.0,
    "boundary": "pinned-pinned",
    "damping_ratio": [0.01, 0.01],
    "points_m": {"drive": 0.1, "tip": 0.5},
}


def test_measured_frequencies_replace_the_computed_ones_and_the_shapes_stay() -> None:
    computed = BeamStructure.model_validate(TABLE)
    updated = BeamStructure.model_validate(TABLE | {"frequency_hz": [40.0, 170.0]})
    assert updated.omega_rad_s == pytest.approx([80 * PI, 340 * PI], rel=1e-12)
    assert np.array_equal(updated.shape("drive"), computed.shape("drive"))


BAD = [
    ({"boundary": "pinned"}, {"field": "boundary", "value": "pinned"}),
    ({"supports": [{"at": "tip"}]}, {"says": "supports-stiffness-n-m-allowed-is", "field": "supports.0"}),
    (
        {"supports": [{"at": "top", "stiffness_n_m": 1.0}]},
        {"field": "supports[0].at", "value": "top", "allowed": "one of drive, tip"},
    ),
    ({"supports": [{"at": "tip", "stiffness_n_m": -1.0}]}, {"says": "greater-than-or-equal-to", "value": -1.0}),
    (
        {"lumped_masses": [{"at": "top", "mass_kg": 1.0}]},
        {"field": "lumped_masses[0].at", "value": "top", "allowed": "one of drive, tip"},
    ),
    ({"lumped_masses": [{"at": "tip", "mass_kg": -1.0}]}, {"says": "greater-than-or-equal-to", "value": -1.0}),
    ({"frequency_hz": [40.0]}, {"field": "frequency_hz", "allowed": "2, one per damping_ratio"}),
    ({"n_element": 4, "damping_ratio": [0.01] * 9}, {"field": "damping_ratio", "allowed": "1 to 8"}),
    ({"points_m": {"drive": 0.6}}, {"field": "points_m.drive", "value": 0.6, "allowed": "0 to length_m = 0.5"}),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_beam_is_refused_with_the_field_and_what_is_allowed(
    change: dict[str, object], message: dict[str, object]
) -> None:
    with refused(ValidationError, **message):
        BeamStructure.model_validate(TABLE | change)
