import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from identification import stepped_sine_mode
from rig.errors import ConfigurationError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.reading import read_frequency_responses, read_mapping
from tests.refused import refused

EXAMPLE = Path(__file__).parents[3] / "docs" / "examples" / "brake-reuss-mapping.toml"
LEVELS = [5, 20, 30, 40, 50, 60, 70, 80]
FREQUENCY_HZ = np.arange(79.0, 81.01, 0.05)


def stored_level(f0_hz: float, zeta: float, level: float, *, controlled: str = "response") -> dict[str, Any]:
    """One linear mode in the layout and convention of the measured file: phase of the displacement, falling to -pi."""
    omega, omega0 = 2 * np.pi * FREQUENCY_HZ, 2 * np.pi * f0_hz
    compliance = 1 / (1.9 * (omega0**2 - omega**2 + 2j * zeta * omega0 * omega))
    per_force = omega**2 * np.abs(compliance)
    force = level / per_force if controlled == "response" else np.full(omega.size, level)
    return {
        "frequency": FREQUENCY_HZ,
        "force": force,
        "amplitude": force * per_force,
        "phase": np.angle(compliance),
        "units": "Hz, N, m/s^2, rad",
    }


@pytest.fixture
def mat_path(tmp_path: Path) -> Path:
    response = [stored_level(80.0 + 0.01 * level, 0.001 + 5e-5 * level, level) for level in LEVELS]
    force = [stored_level(80.2, 0.003, level, controlled="force") for level in (0.2, 0.5, 1.0, 1.3)]
    path = tmp_path / "responses.mat"
    cells = {"ForceControl": np.array(force, dtype=object), "ResponseControl": np.array(response, dtype=object)}
    scipy.io.savemat(path, {"FRdata": cells})
    return path


def test_the_shipped_example_reads_a_file_of_the_same_layout(mat_path: Path) -> None:
    responses = read_frequency_responses(mat_path, EXAMPLE)
    assert [item.controlled for item in responses] == ["force"] * 4 + ["response"] * 8
    assert [item.level for item in responses[4:]] == LEVELS
    assert [item.label for item in responses[3:5]] == ["force control 4", "5 m/s2"]
    mode = stepped_sine_mode(responses)
    np.testing.assert_allclose(mode.modal_frequency_hz, 80.0 + 0.01 * np.array(LEVELS), rtol=1e-9)
    np.testing.assert_allclose(mode.damping_ratio, 0.001 + 5e-5 * np.array(LEVELS), rtol=1e-6)


def test_a_missing_path_names_both_files_and_what_there_is(mat_path: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(EXAMPLE.read_text().replace("FRdata.ForceControl", "FRdata.Force"))
    message = {"says": "responses-mat-does-not-fit-wrong"}
    with refused(ImportFailed, **message):
        read_frequency_responses(mat_path, wrong)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'force = "N"',
            'force = "dyn"',
            {"field": "units.force", "value": "dyn", "allowed": "'N', 'mN', 'kN', 'lbf' or 'kgf'"},
        ),
        ('unit = "rad"', 'unit = "rad"\nsign = 1', {"says": "unknown-key", "field": "phase.sign"}),
        ('values = "peak"', "", {"says": "missing", "field": "units.values"}),
        ("[5, 20,", "[-5, 20,", {"field": "sets[1].level_values[0]", "value": -5, "allowed": "greater than 0"}),
        ("[units]", "[units", {"says": "is-not"}),
    ],
)
def test_a_wrong_mapping_is_named_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = EXAMPLE.read_text()
    assert old in text
    path = tmp_path / "mapping.toml"
    path.write_text(text.replace(old, new))
    with refused(ConfigurationError, **message) as caught:
        read_mapping(path)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_said_so(tmp_path: Path) -> None:
    with refused(ImportFailed, "nowhere-mat-there-is-no-such"):
        read_frequency_responses(tmp_path / "nowhere.mat", EXAMPLE)
    with refused(ConfigurationError, "nowhere-toml-there-is-no-such"):
        read_mapping(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("content", [b"", b"plain text, not at all a MAT file " * 20, bytes(range(256)) * 3])
def test_a_file_that_is_no_mat_file_is_said_so(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "foreign.mat"
    path.write_bytes(content)
    with refused(ImportFailed, "foreign-mat-is-no-file-or"):
        read_frequency_responses(path, EXAMPLE)


def test_a_mat_file_with_damaged_compressed_data_is_said_so(mat_path: Path) -> None:
    scipy.io.savemat(mat_path, {"x": np.arange(1000.0)}, do_compression=True)
    content = bytearray(mat_path.read_bytes())
    content[-200] ^= 0xFF
    mat_path.write_bytes(content)
    with refused(ImportFailed, "is-no-file-or-damaged-one"):
        read_frequency_responses(mat_path, EXAMPLE)


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.95])
def test_a_truncated_mat_file_is_said_so(mat_path: Path, kept: float) -> None:
    content = mat_path.read_bytes()
    mat_path.write_bytes(content[: int(kept * len(content))])
    with refused(ImportFailed, "responses-mat"):
        read_frequency_responses(mat_path, EXAMPLE)


def test_a_mat_file_of_version_7_3_without_content_is_said_to_be_damaged(tmp_path: Path) -> None:
    path = tmp_path / "new.mat"
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    path.write_bytes(header.ljust(512, b"\0"))
    with refused(ImportFailed, "is-no-file-or-damaged-one-2"):
        read_frequency_responses(path, EXAMPLE)


def test_the_measured_brake_reuss_levels_give_the_documented_backbone() -> None:
    folder = os.environ.get("VIBROLOCK_DATA")
    path = Path(folder or ".") / "ForcedFrequencyResponses.mat"
    if folder is None or not path.is_file():
        pytest.skip(
            "set VIBROLOCK_DATA to a folder that holds ForcedFrequencyResponses.mat "
            "from https://github.com/mattiacenedese/BRBtesting (measured data, GPL-3.0, not shipped)"
        )
    mode = stepped_sine_mode(read_frequency_responses(path, EXAMPLE))
    expected_hz = [80.37, 80.19, 80.19, 80.13, 80.28, 80.38, 80.47, 80.53]
    expected_percent = [0.152, 0.197, 0.239, 0.302, 0.382, 0.461, 0.555, 0.640]
    np.testing.assert_allclose(mode.modal_frequency_hz, expected_hz, atol=0.05)
    np.testing.assert_allclose(100 * mode.damping_ratio, expected_percent, atol=0.02)
    assert np.all(mode.fit_residual < 0.03)
