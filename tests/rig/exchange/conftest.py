import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import rig
from identification import Channel, FrequencyResponse, FrequencyResponseMatrix, LinearModes, nonlinear_mode
from rig.campaigns.plans import load_plan, plan_from
from rig.exchange import child_reading, process
from tests.recorded import recorded_at

CHANNELS = (
    Channel("acc_drive", "drive", "m/s2"),
    Channel("tip, left", "response", "m/s2"),
    Channel("v", "response", "m/s"),
)

IN_A_CHILD = ("test_bombs", "test_broken", "test_mat_process", "test_reading")
"""Modules of tests about damaged files, and about what a child may do and how it ends."""


@pytest.fixture(autouse=True)
def readers_in_this_process(request, monkeypatch):
    """Read files in this process: to start a child takes forty times as long as to read a small file."""
    if request.module.__name__.rpartition(".")[2] not in IN_A_CHILD:
        monkeypatch.setattr(child_reading, "ask_child", _answer)


def _answer(module: str, reader: str, options: str, path: str, folder: str, *, timeout_s: float) -> bytes:
    assert module == process.__name__
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a child's are not read
        return process.main(reader, json.loads(options), Path(path), Path(folder)).encode()


@pytest.fixture(scope="session")
def backbone_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("exchange") / "backbone.h5"
    table = load_plan("magnet-beam/backbone").model_dump(mode="json") | {"levels_v": [0.4, 0.8], "record_periods": 8}
    recorded_at(path, plan_from(table, "test"))
    return path


@pytest.fixture(scope="session")
def multisine_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("exchange") / "multisine.h5"
    table = {
        **{"kind": "multisine", "bench": "magnet-beam", "levels_rms_v": [0.05, 0.1], "realisations": 2, "periods": 2},
        **{"lowest_hz": 22.0, "highest_hz": 28.0, "resolution_hz": 0.5, "transient_periods": 2},
    }
    recorded_at(path, plan_from(table, "test"))
    return path


@pytest.fixture(scope="session")
def backbone(backbone_file):
    with rig.Recording(backbone_file) as recording:
        return rig.measurements.backbone(recording)


@pytest.fixture(scope="session")
def mode(backbone):
    return nonlinear_mode(backbone)


@pytest.fixture(scope="session")
def matrix() -> FrequencyResponseMatrix:
    random = np.random.default_rng(1)
    lines = 10.0 + 0.05 * np.arange(401)
    value = random.normal(size=(401, 3, 2)) + 1j * random.normal(size=(401, 3, 2))
    return FrequencyResponseMatrix(
        outputs=CHANNELS,
        inputs=(Channel("force", "force", "N"), Channel("voltage", "monitor", "V")),
        frequency_hz=lines,
        value=value,
        noise_covariance=np.tile(np.eye(6) + 0.1j, (401, 1, 1)),
        estimator="instrument",
        input_rms=(0.3, 0.1),
        specimen="beam",
        notes=("a remark",),
    )


@pytest.fixture(scope="session")
def modes() -> LinearModes:
    return LinearModes(
        channels=CHANNELS,
        frequency_hz=[24.1234567, 151.7, 430.0],
        frequency_std_hz=[1e-3, 2e-3, np.nan],
        damping_ratio=[0.0041, 0.002, 0.0013],
        damping_ratio_std=[1e-5, np.nan, 1e-5],
        shapes=[[0.9, 1.1, 0.5], [1.4, -1.2, 0.1], [-0.3, 0.123456789, 0.7]],
        shapes_std=np.full((3, 3), 1e-3),
        phase_collinearity=[1.0, 0.99, np.nan],
        lower=[1 + 2j, 3.0, 4.0],
        upper=[1e-6j, 0.0, 1e-7],
        upper_hz=1234.5,
        small_terms=np.arange(9.0).reshape(3, 3) / 7.0,
        residues=np.arange(9.0).reshape(3, 3) / 3.0 + 0.1j,
        covariance=np.diag(np.linspace(1e-9, 1e-7, 15)),
        lowest_hz=10.0,
        highest_hz=500.0,
        force_rms_n=0.2,
        specimen="beam",
        notes=("first", "second"),
    )


@pytest.fixture(scope="session")
def responses() -> tuple[FrequencyResponse, ...]:
    frequency = np.array([23.1, 23.912345678, 24.0, 24.5, 24.3])
    force = np.array([1.0, 0.2 + 0.1j, 0.5j, 0.3, 0.4])
    motion = force * np.array([1.0, 30.0 - 2j, 40j, -20.0, 5.0])
    return (
        FrequencyResponse(frequency, force, motion, "acceleration", "force", 0.5, "0.5 N", "beam"),
        FrequencyResponse(frequency[:3], force[:3], motion[:3], "acceleration", "response", 5.0, "5 m/s2", "beam"),
    )
