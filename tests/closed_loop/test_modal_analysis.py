import numpy as np
import pytest

from identification import LinearModes, best_linear_approximation, linear_modes
from simulators import VirtualRig
from tests.recorded import recorded_run
from tests.rig.rigs import bench_with

NEAR_HZ = {"magnet-beam": [24.37, 134.06, 380.9], "friction-beam": [149.0, 564.3, 1138.3, 1496.5]}


def modal_test(name: str, level_rms_v: float, **options: object) -> LinearModes:
    """The shipped modal test at one level, identified as `rig identify` does; on another bench with two realisations."""
    changes = {"levels_rms_v": [level_rms_v], "realisations": 2} if options else {}
    bench = bench_with(name=name, **options) if options else None
    with recorded_run(f"{name}/modal", bench, seed=3, **changes) as run:
        assert run.complete
        spectra = run.spectra()[level_rms_v]
    names = [channel.name for channel in spectra.channels if channel.role != "monitor"]
    responses = best_linear_approximation(spectra, inputs=("voltage",), outputs=names)
    return linear_modes(responses, modes=NEAR_HZ[name], orders=range(20, 25, 2))


def against_truth(name: str, modes: LinearModes, **options: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Relative errors of frequencies, damping ratios and shapes."""
    virtual = VirtualRig.shipped(name, **options)
    truth = virtual.linear_modes
    rows = [truth.nearest(f) for f in NEAR_HZ[name]]
    shapes = np.array([truth.at(virtual.shape(s.at)) for s in virtual.sensors if s.kind == "acceleration"])[:, rows]
    return (
        modes.frequency_hz / truth.frequency_hz[rows] - 1.0,
        modes.damping_ratio / truth.damping_ratio[rows] - 1.0,
        modes.shapes / shapes - 1.0,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "level_rms_v"), [("magnet-beam", 0.1), ("friction-beam", 0.02)])
def test_the_shipped_modal_test_finds_the_modes_of_the_virtual_rig(name: str, level_rms_v: float) -> None:
    frequency, damping, shapes = against_truth(name, modal_test(name, level_rms_v))
    assert np.abs(frequency).max() < 1e-4
    assert np.abs(damping).max() < (0.02 if name == "magnet-beam" else 0.025)  # micro-slip: 1.3 % at this level
    assert np.abs(shapes).max() < 5e-3


@pytest.mark.slow
def test_ten_times_the_noise_leaves_a_complete_test_and_modes_within_their_errors() -> None:
    modes = modal_test("friction-beam", 0.02, noise_scale=10.0)
    frequency, damping, shapes = against_truth("friction-beam", modes)
    assert np.abs(frequency).max() < 1e-4
    assert np.abs(damping).max() < 0.06
    assert np.abs(shapes).max() < 5e-3
    assert modes.fit_residual == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
def test_a_beam_whose_joints_cannot_slip_returns_its_own_damping() -> None:
    modes = modal_test("friction-beam", 0.04, friction=[])
    frequency, damping, shapes = against_truth("friction-beam", modes, friction=[])
    assert np.abs(frequency).max() < 5e-5
    assert np.abs(damping).max() < 5e-3
    assert np.abs(shapes).max() < 1e-3
