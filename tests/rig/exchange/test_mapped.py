"""Measurements of others, read with a mapping."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from identification import Backbone, FrequencyResponseMatrix, NonlinearMode
from rig.errors import RigError
from rig.exchange.child_reading import ImportFailed
from rig.exchange.conversion import encoded
from rig.exchange.export import write_contents
from rig.exchange.reading import import_file, read_mapping
from rig.results.time_data.series import TimeData
from tests.refused import refused
from tests.rig.exchange.conftest import CHANNELS

GRAVITY = 9.80665
F0, ZETA, PHI = 25.0, 0.01, 0.8
FREQUENCY = np.arange(20.0, 30.01, 0.1)


def accelerance(frequency_hz: Any) -> Any:
    """Of one mode, mass-normalised shape PHI at the drive point: closed form."""
    s, w0 = 2j * np.pi * np.asarray(frequency_hz), 2 * np.pi * F0
    return PHI**2 * s**2 / (s**2 + 2 * ZETA * w0 * s + w0**2)


def table(path: Path, columns: dict[str, Any], comma: str = ",", units: str = "") -> Path:
    rows = [comma.join(f"{value:.17g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text(
        "\n".join(["# measured on a Monday", comma.join(columns), *([units] if units else []), *rows]) + "\n"
    )
    return path


def mapping(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mapping.toml"
    path.write_text(text)
    return path


MATRIX = """
kind = "frequency-response-matrix"
specimen = "plate"
estimator = "H1"
frequency = "f"
outputs = [{ name = "acc", role = "drive", unit = "g" }]
inputs = [{ name = "hammer", role = "force", unit = "lbf" }]
"""
STORED = accelerance(FREQUENCY) * 4.4482216152605 / GRAVITY


@pytest.mark.parametrize("comma", [",", ";", "\t"])
@pytest.mark.parametrize(
    ("value", "columns", "sense"),
    [
        ("{ real = 're', imaginary = 'im' }", {"re": STORED.real, "im": STORED.imag}, "exp(+iwt)"),
        ("{ real = 're', imaginary = 'im' }", {"re": STORED.real, "im": -STORED.imag}, "exp(-iwt)"),
        ("{ amplitude = 'a', phase = 'p' }", {"a": abs(STORED), "p": np.degrees(np.angle(STORED))}, "exp(+iwt)"),
        (
            "{ amplitude = 'a', phase = 'p', phase_unit = 'rad' }",
            {"a": abs(STORED), "p": np.angle(STORED)},
            "exp(+iwt)",
        ),
    ],
)
def test_frequency_responses_of_a_table_in_any_form_are_those_of_the_mode(tmp_path, comma, value, columns, sense):
    path = table(tmp_path / "frf.csv", {"f": FREQUENCY, **columns}, comma)
    told = f'{MATRIX}sense = "{sense}"\npaths = [{{ output = "acc", input = "hammer", value = {value} }}]\n'
    found = import_file(path, mapping=mapping(tmp_path, told))
    assert isinstance(found, FrequencyResponseMatrix)
    np.testing.assert_allclose(found.value[:, 0, 0], accelerance(FREQUENCY), rtol=1e-12)
    assert (found.outputs[0].unit, found.inputs[0].unit, found.specimen) == ("m/s2", "N", "plate")


def test_a_matrix_of_responses_is_read_from_mat(tmp_path):
    stored = np.stack([STORED, 2 * STORED], axis=1)[:, :, None]
    scipy.io.savemat(tmp_path / "frf.mat", {"S": {"f": 2 * np.pi * FREQUENCY, "H": stored}})
    told = (
        MATRIX.replace('"f"', '"S.f"').replace(
            'unit = "g" }', 'unit = "g" }, { name = "tip", role = "response", unit = "g" }'
        )
        + 'frequency_unit = "rad/s"\nmatrix = "S.H"\n'
    )
    found = import_file(tmp_path / "frf.mat", mapping=mapping(tmp_path, told))
    np.testing.assert_allclose(found.path("tip"), 2 * accelerance(FREQUENCY), rtol=1e-12)
    np.testing.assert_allclose(found.frequency_hz, FREQUENCY, rtol=1e-14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('value = "H"', 'value = "G"'), {"says": "no-at-the-top-which-has"}),
        (('output = "acc", input', 'output = "nose", input'), {"says": "paths-nose-is-none-of-acc"}),
        (("paths = [", "nothing = ["), {"says": "unknown-key", "field": "nothing"}),
        (('unit = "g"', 'unit = "stone"'), {"says": "unit-stone-of-channel-acc-allowed", "field": "outputs[0]"}),
        (
            ('kind = "frequency-response-matrix"', 'kind = "spectrum"'),
            {"says": "allowed-frequency-responses", "field": "kind", "value": "spectrum"},
        ),
    ],
)
def test_a_mapping_that_does_not_fit_is_named(tmp_path, change, message):
    told = MATRIX + 'paths = [{ output = "acc", input = "hammer", value = "H" }]\n'
    assert change[0] in told
    scipy.io.savemat(tmp_path / "frf.mat", {"f": FREQUENCY, "H": STORED})
    with refused(RigError, **message) as caught:
        import_file(tmp_path / "frf.mat", mapping=mapping(tmp_path, told.replace(*change)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("frequency", "value", "message"),
    [
        (FREQUENCY, STORED[:-1], {"says": "values-for-frequencies", "field": "paths[0].value"}),
        (FREQUENCY, np.where(FREQUENCY > 25.05, np.nan, STORED), {"says": "not-finite-at", "field": "paths[0].value"}),
        (
            FREQUENCY[::-1],
            STORED,
            {"field": "frequency_hz", "allowed": "at least one, none below zero, each above the one before"},
        ),
    ],
)
def test_numbers_that_do_not_fit_are_named(tmp_path, frequency, value, message):
    scipy.io.savemat(tmp_path / "frf.mat", {"f": frequency, "H": value})
    told = mapping(tmp_path, MATRIX + 'paths = [{ output = "acc", input = "hammer", value = "H" }]\n')
    with refused(ImportFailed, **message):
        import_file(tmp_path / "frf.mat", mapping=told)


MULTISINE = """
kind = "multisine"
specimen = "plate"
period_samples = 2000
lowest_hz = 20
highest_hz = 30
transient_periods = 1
instrument = "voltage"
channels = [
  { name = "force", role = "force", unit = "N", value = "F" },
  { name = "acc", role = "drive", unit = "g", value = "A" },
  { name = "voltage", role = "monitor", unit = "V", value = "U" },
]
"""
RATE = 1000.0


def records(realisations: int = 2, noise: float = 0.0) -> dict[str, np.ndarray]:
    """Three periods of a multisine: the force follows the voltage with a resonance of its own, the motion the force."""
    random = np.random.default_rng(3)
    lines = np.arange(40, 61)
    time = np.arange(6000) / RATE
    out: dict[str, list[np.ndarray]] = {"F": [], "A": [], "U": []}
    for _ in range(realisations):
        voltage = np.exp(2j * np.pi * random.random(lines.size))
        turn = np.exp(2j * np.pi * np.outer(time, lines * 0.5))
        force = voltage * (1.0 + 0.3 * accelerance(lines * 0.5))
        for name, spectrum in (("U", voltage), ("F", force), ("A", force * accelerance(lines * 0.5) / GRAVITY)):
            out[name].append((turn @ spectrum).real + noise * random.normal(size=time.size))
    return {name: np.array(columns).T for name, columns in out.items()}


@pytest.mark.parametrize("instrument", ['instrument = "voltage"', ""])
def test_time_data_of_a_multisine_gives_the_response_of_the_mode(tmp_path, instrument):
    scipy.io.savemat(tmp_path / "time.mat", records())
    told = MULTISINE.replace('instrument = "voltage"', f"{instrument}\nsample_rate_hz = 1000.0")
    found = import_file(tmp_path / "time.mat", mapping=mapping(tmp_path, told))
    np.testing.assert_allclose(found.frequency_hz, np.arange(40, 61) * 0.5)
    np.testing.assert_allclose(found.path("acc"), accelerance(found.frequency_hz), rtol=1e-9)
    assert found.estimator == ("instrument" if instrument else "H1")
    assert found.input_rms[0] > 0


def test_realisations_in_structures_and_instants_are_read(tmp_path):
    data = records()
    runs = [
        {"F": data["F"][:, k], "A": data["A"][:, k], "U": data["U"][:, k], "t": np.arange(6000) / RATE} for k in (0, 1)
    ]
    scipy.io.savemat(tmp_path / "time.mat", {"runs": np.array(runs, dtype=object)})
    told = MULTISINE.replace("channels =", 'realisations = "runs"\ntime = "t"\nchannels =')
    found = import_file(tmp_path / "time.mat", mapping=mapping(tmp_path, told))
    np.testing.assert_allclose(found.path("acc"), accelerance(found.frequency_hz), rtol=1e-9)


def test_time_data_of_a_universal_file_says_rate_and_units_itself(tmp_path):
    data = records()
    channels = CHANNELS[:1]
    items = []
    for k in (0, 1):
        samples = np.array([data["A"][:, k] * GRAVITY])
        items.append(encoded(TimeData(channels, samples, RATE, point=k + 1)))
    write_contents(items, tmp_path / "acc.uff", "uff")
    told = (
        MULTISINE.replace('"A" }', '"acc_drive" }').replace('"F" }', '"acc_drive" }').replace('"U" }', '"acc_drive" }')
    )
    with refused(ImportFailed, "the-file-own-units-make-it", field="channels.force.unit", value="N"):
        import_file(tmp_path / "acc.uff", mapping=mapping(tmp_path, told))


@pytest.mark.parametrize(
    ("told", "change", "message"),
    [
        ("", {}, {"says": "missing-give-it-or-time", "field": "sample_rate_hz"}),
        ('time = "t"', {"t": np.arange(6000) ** 1.01}, {"says": "time-is-not-evenly-spaced"}),
        (
            'time = "t"\nsample_rate_hz = 900.0',
            {"t": np.arange(6000) / RATE},
            {"says": "disagrees-sample-rate-hz-hz-time", "field": "sample_rate_hz"},
        ),
        ("sample_rate_hz = 1000.0", {"F": np.ones(10)}, {"says": "unequal-lengths-force", "field": "channels"}),
        (
            "sample_rate_hz = 1000.0",
            {name: np.ones(10) for name in "FAU"},
            {"says": "have-samples", "field": "channels", "allowed": "one period, 2000 at least"},
        ),
        ("sample_rate_hz = 1000.0", {"A": np.full((6000, 2), np.nan)}, {"field": "records[0]", "allowed": "finite"}),
    ],
)
def test_time_data_that_cannot_be_used_is_named(tmp_path, told, change, message):
    scipy.io.savemat(tmp_path / "time.mat", records() | change)
    with refused(ImportFailed, **message):
        import_file(
            tmp_path / "time.mat", mapping=mapping(tmp_path, MULTISINE.replace("channels =", f"{told}\nchannels ="))
        )


BACKBONE = """
kind = "backbone"
specimen = "plate"
frequency = "Frequency (Hz)"
values = "rms"
periods = 100
drive_mode_shape = 0.8
channels = [
  { name = "force", role = "force", unit = "N", value = { amplitude = "F.1" } },
  { name = "acc", role = "drive", unit = "g", value = { amplitude = "a", phase = "lead" } },
]
"""


def test_a_measured_backbone_is_peak_and_si_with_its_lag(tmp_path):
    columns = {
        "Frequency (Hz)": np.array([24.0, 24.5]),
        "F.1": np.array([0.1, 0.2]),
        "a": np.array([0.5, 1.0]),
        "lead": np.array([90.0, 88.0]),
    }
    path = table(tmp_path / "backbone.csv", columns, units="Hz,N,g,deg")
    found = import_file(path, mapping=mapping(tmp_path, BACKBONE))
    assert isinstance(found, Backbone)
    np.testing.assert_allclose(found.force_n, np.sqrt(2) * columns["F.1"])
    omega = 2 * np.pi * columns["Frequency (Hz)"]
    np.testing.assert_allclose(found.amplitude_m, np.sqrt(2) * GRAVITY * columns["a"] / omega**2)
    np.testing.assert_allclose([point.phase_lag_deg for point in found.points], [90.0, 92.0])
    assert found.drive_mode_shape == 0.8


def test_a_table_of_a_nonlinear_mode_becomes_one(tmp_path):
    path = table(
        tmp_path / "mode.csv", {"w": np.array([150.0, 155.0]), "d": np.array([0.4, 0.6]), "v": np.array([10.0, 50.0])}
    )
    told = mapping(
        tmp_path,
        'kind = "nonlinear-mode"\nvalues = "peak"\nfrequency = "w"\nfrequency_unit = "rad/s"\ndamping = "d"\n'
        'damping_unit = "%"\namplitude = "v"\namplitude_unit = "mm/s"\ndrive_mode_shape = 0.5\n',
    )
    found = import_file(path, mapping=told)
    assert isinstance(found, NonlinearMode)
    np.testing.assert_allclose(found.damping_ratio, [0.004, 0.006])
    np.testing.assert_allclose(found.amplitude_m, [0.01 / 150.0, 0.05 / 155.0])
    np.testing.assert_allclose(found.modal_amplitude, found.amplitude_m / 0.5)
    assert np.all(np.isnan(found.force_n))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", {"says": "holds-no-table"}),
        ("f,H\n", {"says": "holds-no-table"}),
        ("f,H\nHz,1\n", {"says": "holds-no-table"}),
        ("1,2\n3,4\n", {"says": "the-first-line-must-name-every"}),
        ("f,f\n3,4\n", {"says": "the-first-line-must-name-every-2"}),
        ("f;H\n3,5;4\n", {"says": "line-is-no-number-write-decimals"}),
        ("f,H\n1,2\n3,x\n", {"says": "line-is-no-number"}),
        ("f,H\n1,2\n3\n", {"says": "line-values-for-names"}),
    ],
)
def test_a_table_that_is_none_is_said_so_with_its_line(tmp_path, text, message):
    (tmp_path / "frf.csv").write_text(text)
    told = mapping(tmp_path, MATRIX + 'paths = [{ output = "acc", input = "hammer", value = "H" }]\n')
    with refused(ImportFailed, **message) as caught:
        import_file(tmp_path / "frf.csv", mapping=told)
    assert "frf.csv" in str(caught.value)


@pytest.mark.parametrize("name", ["frf.csv", "frf.mat"])
def test_foreign_files_without_a_mapping_are_refused_with_advice(tmp_path, name):
    table(tmp_path / "frf.csv", {"f": FREQUENCY})
    scipy.io.savemat(tmp_path / "frf.mat", {"f": FREQUENCY})
    with refused(ImportFailed, "was-not-written-by-this-package"):
        import_file(tmp_path / name)


def test_changed_files_of_ours_are_said_so(mode, tmp_path):
    write_contents([encoded(mode)], tmp_path / "mode.csv", "csv")
    lines = (tmp_path / "mode.csv").read_text().splitlines()
    (tmp_path / "mode.csv").write_text("\n".join([*lines[:-1], lines[-1].split(",", 1)[1]]))
    with refused(ImportFailed, "mode-csv-is-damaged-or-changed"):
        import_file(tmp_path / "mode.csv")


def test_the_shipped_examples_are_mappings():
    folder = Path(__file__).parents[3] / "docs" / "examples"
    kinds = {read_mapping(path).kind for path in sorted(folder.glob("*.toml"))}
    assert kinds >= {"frequency-responses", "multisine", "frequency-response-matrix", "backbone", "nonlinear-mode"}
