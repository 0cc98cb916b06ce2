"""Sliders of an Iwan joint against integrals of its density."""

import numpy as np
import pytest

from vibrolock.iwan import iwan_sliders


@pytest.mark.parametrize(("chi", "beta"), [(-0.5, 0.1), (0.0, 0.0), (1.3, 2.0)])
def test_stuck_stiffness_and_force_at_full_slip_are_those_of_the_density(chi, beta):
    stiffness, slip = iwan_sliders(1.0, chi, beta, np.array([0.0, 0.02, 0.3, 1.0]))
    assert np.sum(stiffness) == pytest.approx(1.0, rel=1e-12)
    phi = (np.arange(200_000) + 0.5) / 200_000
    density = phi**chi / np.mean(phi**chi)  # of unit stiffness
    full = (np.mean(density * phi) + beta) / (1.0 + beta)
    assert stiffness @ slip == pytest.approx(full, rel=1e-3)


def test_each_slider_slips_within_its_bin():
    edges = np.array([0.0, 0.1, 0.5, 1.0])
    _, slip = iwan_sliders(3.0, 0.4, 0.2, edges)
    assert np.all((edges[:-1] < slip[:-1]) & (slip[:-1] < edges[1:]))
    assert slip[-1] == 1.0
