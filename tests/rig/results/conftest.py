"""Short recordings of the one-sided magnet beam, and the models that the command line makes of them."""

import contextlib
from pathlib import Path

import pytest

from rig.campaigns.plans import load_plan, plan_from
from tests.command import run_command
from tests.recorded import recorded_at
from tests.sharing import copy_of, made_once, shared_folder

BENCH = {"bench": "magnet-beam"}
SWEEP = {**BENCH, "kind": "sweep", "start_hz": 18.0, "stop_hz": 34.0, "rate_hz_per_s": 2.0}
LINES = {**BENCH, "kind": "multisine", "realisations": 2, "transient_periods": 1, "periods": 2}
PLANS = {
    "backbone": load_plan("magnet-beam/backbone").model_dump(mode="json")
    | {"levels_v": [0.1252, 0.2, 0.289, 0.4264, 0.5962, 0.7619, 0.9662], "record_periods": 20},
    "exciter": LINES | {"lowest_hz": 8.0, "highest_hz": 200.0, "resolution_hz": 0.25, "levels_rms_v": [1.0]},
    "modal": LINES | {"lowest_hz": 10.0, "highest_hz": 200.0, "resolution_hz": 0.05, "levels_rms_v": [0.05]},
    "sweep": SWEEP | {"levels_v": [0.4, 0.9]},
    "stepped": BENCH
    | {"kind": "stepped-sine", "start_hz": 24.0, "stop_hz": 25.2, "steps": 7, "levels_v": [0.6], "record_periods": 10},
}


@pytest.fixture(scope="session")
def shelf(tmp_path_factory) -> Path:
    """A folder with the recordings, and with LIN.h5, EX.h5 and NM.h5 as ``rig identify`` makes them."""
    return copy_of(made_once(shared_folder() / "models", _fill), tmp_path_factory.mktemp("models"))


def _fill(folder: Path) -> None:
    for name, table in PLANS.items():
        recorded_at(folder / f"{name}.h5", plan_from(table, name))
    with contextlib.chdir(folder):
        for line in (
            "modal.h5 --model linear --count 2 -o LIN.h5",
            "exciter.h5 --model exciter -o EX.h5",
            "backbone.h5 --modes LIN.h5 -o NM.h5",
        ):
            run_command(f"identify {line}").succeeded()
