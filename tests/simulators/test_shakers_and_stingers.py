"""Shakers by name and stingers by geometry."""

import math

import pytest
from pydantic import ValidationError

from simulators.exciter import YOUNGS_MODULUS_PA, Exciter, Stinger
from simulators.shipped import shaker_descriptions, shaker_values
from simulators.virtual_rig import VirtualRig
from tests.refused import refused

POUND_N, INCH_M = 4.4482216152605, 0.0254


def test_the_v203_is_the_published_one_in_si_units():
    shaker = Exciter(shaker="lds-v203")
    assert shaker.armature_mass_kg == pytest.approx(178.04e-6 * POUND_N / INCH_M, rel=1e-5)
    assert shaker.suspension_stiffness_n_m == pytest.approx(16.54 * POUND_N / INCH_M, rel=1e-5)
    assert shaker.suspension_damping_n_s_m == pytest.approx(39.09e-3 * POUND_N / INCH_M, rel=1e-5)
    assert shaker.force_factor_n_a == pytest.approx(0.8416 * POUND_N, rel=1e-5)
    assert shaker.force_factor_n_a == pytest.approx(95.10e-3 / INCH_M, rel=2e-4)  # the source's back-EMF


@pytest.mark.parametrize("name", shaker_descriptions())
def test_a_shaker_has_every_number_that_an_exciter_needs_and_says_where_they_come_from(name):
    assert Exciter(shaker=name).shaker == name
    assert "parameters: " in shaker_descriptions()[name]


def test_a_shaker_replaces_that_of_a_specimen_and_single_keys_change_it():
    rig = VirtualRig.shipped(
        "magnet-beam", exciter={"shaker": "lds-v203", "amplifier_gain": 5.0, "resistance_ohm": 2.0}
    )
    told = shaker_values("lds-v203") | {"amplifier_gain": 5.0, "resistance_ohm": 2.0}
    assert {key: getattr(rig.exciter, key) for key in told} == told
    assert VirtualRig.model_validate(rig.model_dump()).exciter == rig.exciter


def test_an_unknown_shaker_is_refused_with_those_there_are():
    with refused(ValidationError, field="shaker", value="v203", allowed="lds-v203, modal-shop-2100e11"):
        Exciter(shaker="v203")


@pytest.mark.parametrize("material", YOUNGS_MODULUS_PA)
def test_the_stiffness_of_a_rod_is_ea_over_l(material):
    rod = {"at": "drive", "damping_n_s_m": 1.0, "diameter_m": 1.5e-3, "length_m": 0.08}
    stinger = Stinger(**rod, material=material)
    expected = YOUNGS_MODULUS_PA[material] * math.pi * 0.75e-3**2 / 0.08
    assert stinger.stiffness_n_m == pytest.approx(expected, rel=1e-12)
    assert Stinger(**rod, youngs_modulus_pa=YOUNGS_MODULUS_PA[material]).stiffness_n_m == stinger.stiffness_n_m
    assert Stinger(**rod, material=material, stiffness_n_m=1e6).stiffness_n_m == 1e6


def test_the_geometry_that_the_paper_gives_is_the_stiffness_of_the_shipped_specimen():
    geometry = {"material": "steel", "diameter_m": 0.002, "length_m": 0.1}
    shipped = VirtualRig.shipped("magnet-beam")
    assert VirtualRig.shipped("magnet-beam", stinger=geometry).stinger.stiffness_n_m == pytest.approx(
        shipped.stinger.stiffness_n_m, rel=1e-12
    )
    nylon = VirtualRig.shipped("magnet-beam", stinger=geometry | {"material": "nylon"}).stinger
    assert nylon.stiffness_n_m == pytest.approx(shipped.stinger.stiffness_n_m * 2.76 / 200.0)


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        (
            {"diameter_m": 1e-3, "length_m": 0.1},
            {"field": "material", "allowed": "stiffness_n_m, or diameter_m, length_m and a material"},
        ),
        (
            {"material": "steel", "length_m": 0.1},
            {"field": "diameter_m", "allowed": "stiffness_n_m, or diameter_m, length_m and a material"},
        ),
        (
            {"material": "wood", "diameter_m": 1e-3, "length_m": 0.1},
            {"says": "input-should-be-steel", "field": "stiffness_n_m"},
        ),
        (
            {"material": "steel", "diameter_m": -1e-3, "length_m": 0.1},
            {"says": "greater-than", "field": "stiffness_n_m"},
        ),
        (
            {"material": "steel", "youngs_modulus_pa": 1e9, "diameter_m": 1e-3, "length_m": 0.1},
            {"field": "youngs_modulus_pa", "allowed": "this or material"},
        ),
        ({}, {"field": "stiffness_n_m"}),
    ],
)
def test_half_a_geometry_is_refused(keys, fault):
    with refused(ValidationError, **fault):
        Stinger(at="drive", damping_n_s_m=1.0, **keys)
