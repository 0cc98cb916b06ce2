import numpy as np
import pytest

from simulators.simulation import Simulation
from simulators.sites.friction import IwanSite
from tests.simulators.friction_reference import SlippingEquations
from tests.simulators.references import ideal

DT_S = 1 / 5000
NO_FILTER = {"oversampling": 1, "anti_alias_hz": 0.0}
# From rest, a square wave of voltage near resonance drives every joint into full slip. Largest error of the stinger force at
# any sample, relative to its peak, over the sub-steps in a sample.
ALLOWED = {1: 1.2e-2, 2: 1.4e-3, 4: 2.6e-4}


@pytest.fixture(scope="module")
def errors() -> dict[int, float]:
    voltages = 1.0 * np.repeat(np.resize([1.0, -1.0], 8), 17)
    rig = ideal("friction-beam", converter=NO_FILTER)
    equations = SlippingEquations(rig)
    states = equations.solve(voltages, DT_S)
    force_n = states @ equations.force_row
    slips = np.max(np.abs(states[:, : equations.n_mode] @ equations.rows.T), axis=0)
    for joint, slip_m in zip(rig.friction, slips, strict=True):
        assert isinstance(joint, IwanSite)
        assert slip_m > joint.phi_max_m
    result = {}
    for substeps in (1, 2, 4, 8):
        run = Simulation(ideal("friction-beam", converter=NO_FILTER | {"substeps": substeps})).run(voltages)
        result[substeps] = float(np.max(np.abs(run.force_n - force_n)) / np.max(np.abs(force_n)))
    return result


@pytest.mark.slow
def test_force_error_of_the_friction_beam_against_dop853_meets_the_table(errors: dict[int, float]) -> None:
    for substeps, allowed in ALLOWED.items():
        assert errors[substeps] < allowed


def test_error_falls_with_the_third_power_of_the_step_in_full_slip(errors: dict[int, float]) -> None:
    assert np.log2(errors[1] / errors[8]) / 3 == pytest.approx(3.0, abs=0.3)
