"""What a model lacks is named by kind and place, on a structure integrated with tiny steps by a program of its own."""

from dataclasses import replace

import numpy as np
import pytest

from identification import IdentificationError, NonlinearElement, StructuredModel
from identification.models.structured.laws import Jenkins, PolynomialSpring
from identification.models.structured.missing import FORCES, missing_forces
from tests.identification.models.structured import test_elements as structure
from tests.refused import refused

DRIVE, TIP = structure.OUTPUTS
SCALE_M = 1e-3
CUBE_N = structure.CUBIC_N_M3 * SCALE_M**3


def spring(cube_n=CUBE_N):
    """The cubic spring at the drive point."""
    return NonlinearElement(direction=DRIVE, scale_m=SCALE_M, laws=(PolynomialSpring((0.0, cube_n)),))


def joint():
    """The joint at the tip."""
    law = Jenkins(structure.STIFFNESS_N_M * SCALE_M, structure.SLIP_M / SCALE_M)
    return NonlinearElement(direction=TIP, scale_m=SCALE_M, laws=(law,))


def model(*elements):
    return StructuredModel(
        frequency_hz=structure.OMEGA / (2.0 * np.pi),
        damping_ratio=structure.ZETA,
        input_shapes=structure.INPUT[:, None],
        output_shapes=structure.OUTPUTS,
        direct=np.zeros((2, 1)),
        elements=elements,
        sample_rate_hz=structure.RATE_HZ,
        inputs=(structure.FORCE,),
        outputs=structure.CHANNELS,
        steps=8,
    )


@pytest.fixture(scope="module")
def record():
    """The structure with both."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(structure, "SPRING", DRIVE)
        patch.setattr(structure, "JOINT", TIP)
        return structure.noisy(structure.experiment(6.0, 2), 2)


@pytest.mark.parametrize(
    ("there", "force", "place"), [((joint,), "spring", "drive"), ((spring,), "joint", "tip"), ((), "joint", "tip")]
)
def test_the_force_that_a_model_lacks_is_named_with_its_place(record, there, force, place):
    numbers, best, *others = missing_forces(model(*(one() for one in there)), [record], 2)
    assert (best.force, best.place) == (force, place)
    assert best.share > (0.9 if there else 0.5)
    assert numbers.force == "numbers"
    assert len(others) == len(FORCES) * 5 - 1  # two outputs, one relative to the other, two modes
    shares = [one.share for one in (best, *others)]
    assert shares == sorted(shares, reverse=True)


def test_wrong_numbers_of_a_right_structure_are_told_from_a_missing_force(record):
    numbers, *forces = missing_forces(model(joint(), spring(0.7 * CUBE_N)), [record], 2)
    assert numbers.share > 0.98
    assert all(force.share < 0.5 for force in forces)


def test_records_without_period_are_refused(record):
    with refused(IdentificationError, field="experiments"):
        missing_forces(model(), [replace(record, period_samples=0)], 2)
