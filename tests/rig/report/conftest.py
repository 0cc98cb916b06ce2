"""Short recordings of every kind of campaign."""

from pathlib import Path

import pytest

import rig
from rig.bench import Bench, load_bench
from rig.campaigns.plans import load_plan, plan_from
from tests.recorded import recorded_at

LINES = {"realisations": 2, "transient_periods": 1, "periods": 2, "levels_rms_v": [0.1]}
CHANGES = {
    "magnet-beam/backbone": {"levels_v": [0.4, 0.8], "record_periods": 8},
    "magnet-beam/stepped-phase-fast": {"levels_n": [0.25], "start_deg": -110.0, "stop_deg": -80.0, "step_deg": 15.0},
    "magnet-beam/continuous-backbone": {},
    "magnet-beam/decay": {"levels_v": [0.8]},
    "magnet-beam/response-controlled": {
        "levels_m": [0.00045, 0.00055, 0.0007],
        "phase_lags_deg": [-120.0, -100.0, -80.0, -60.0],
    },
    "magnet-beam/stepped-sine-up": {"levels_n": [0.25], "steps": 3, "record_periods": 8},
    "magnet-beam/sweep-1": {"rate_hz_per_s": 2.0},
    "magnet-beam/multisine-1": LINES | {"resolution_hz": 0.5},
    "friction-beam/dwell": {"cycles": 300, "mean_s": 0.5, "record_every": 4, "telemetry_s": 0.02, "ramp_periods": 20.0},
}
"""A plan of every kind, and what makes it short."""


def short(name: str):
    """The shipped plan, shortened."""
    table = load_plan(name).model_dump(mode="json") | CHANGES[name]
    return plan_from({key: value for key, value in table.items() if value is not None}, name)


@pytest.fixture(scope="session")
def recordings(tmp_path_factory) -> dict[str, Path]:
    """A recording of every kind, by kind."""
    folder = tmp_path_factory.mktemp("report")
    found = {}
    for name in CHANGES:
        plan = short(name)
        found[plan.kind] = folder / f"{plan.kind}.h5"
        recorded_at(found[plan.kind], plan, seed=1)
    return found


HOSTILE = "<script>alert(1)</script>\"'&$x^$\u202e"


def laboratory_bench() -> Bench:
    """The magnet beam with sensors as a laboratory has them, one overdue, and with text that wants to be HTML."""
    table = load_bench("magnet-beam").model_dump(mode="json")
    table |= {"name": "bench <b>4</b>", "description": HOSTILE}
    table["specimen"]["name"] = HOSTILE
    table["channels"][0] |= {
        **{"sensor": "PCB <i>208C02</i>", "serial_number": "SN & 4711"},
        **{"calibrated": "2020-01-15", "calibration_due": "2021-01-15"},
    }
    return Bench.model_validate(table)


@pytest.fixture(scope="session")
def hostile(tmp_path_factory) -> Path:
    """A recording whose texts are hostile."""
    path = tmp_path_factory.mktemp("hostile") / "run<b>.h5"
    plan = short("magnet-beam/backbone").model_copy(update={"description": "</table><img src=x onerror=alert(2)>"})
    operator, notes = "<a href='http://example.org'>Eve</a>", ["<style>*{}</style>"]
    rig.run(plan, bench=laboratory_bench(), output=path, operator=operator, specimen_serial="<&>", notes=notes).close()
    return path
