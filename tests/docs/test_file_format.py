"""The page on the file format names everything that points of every kind hold."""

import re
from dataclasses import fields

import pytest

from identification import FrequencyResponseMatrix, LinearModes, NonlinearMode
from identification.common import STANDARD_ERRORS
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import load_plan, plan_from
from rig.results.kinds import KINDS as RESULTS
from tests.docs.pages import ROOT
from tests.recorded import recorded_run

SMALL = {"bench": "magnet-beam", "levels_v": [0.4]}
PLANS = {
    "backbone": load_plan("magnet-beam/backbone").model_dump(mode="json") | {"levels_v": [0.8], "record_periods": 8},
    "short points": load_plan("magnet-beam/backbone-short").model_dump(mode="json") | {"levels_m": [0.0005]},
    "stepped-phase": load_plan("magnet-beam/stepped-phase-fast").model_dump(mode="json")
    | {"levels_n": [0.25], "start_deg": -100.0, "stop_deg": -90.0},
    "continuous-backbone": load_plan("magnet-beam/continuous-backbone").model_dump(mode="json")
    | {"levels_m": [2e-4, 4e-4], "sweep_periods": 40.0},
    "response-controlled": load_plan("magnet-beam/response-controlled").model_dump(mode="json")
    | {"levels_m": [5e-4], "phase_lags_deg": [-90.0]},
    "decay": load_plan("magnet-beam/decay").model_dump(mode="json") | {"levels_v": [1.0]},
    "dwell": load_plan("friction-beam/dwell").model_dump(mode="json") | {"cycles": 150, "mean_s": 0.5},
    "stepped-sine": SMALL | {"kind": "stepped-sine", "frequencies_hz": [23.0]},
    "sweep": SMALL | {"kind": "sweep", "start_hz": 22.0, "stop_hz": 26.0, "rate_hz_per_s": 4.0},
    "multisine": {
        "kind": "multisine",
        "bench": "magnet-beam",
        "levels_rms_v": [0.1],
        "lowest_hz": 22.0,
        "highest_hz": 28.0,
        "resolution_hz": 0.5,
        "realisations": 1,
    },
}
BY_RULE = re.compile(r"(off_resonance|minimum|overshoot|peak|window)_?\w*")  # fields of ForceDropOut, named as such


def section(heading: str) -> str:
    text = (ROOT / "docs" / "reference" / "file-format.md").read_text(encoding="utf-8")
    found = re.search(rf"^## {heading}$(.*?)(?=^## )", text, re.MULTILINE | re.DOTALL)
    assert found
    return found.group(1)


def test_every_kind_of_point_is_looked_at():
    assert {plan["kind"] for plan in PLANS.values()} == set(KINDS)


@pytest.mark.parametrize("kind", PLANS)
def test_every_key_of_a_point_is_on_the_page(kind):
    named = set(re.findall(r"`(\w+)`", section("Points")))
    plan: Plan = plan_from(PLANS[kind], kind)
    with recorded_run(plan) as run:
        point, part = run.recording.points[0], run.recording.parts[0]
        assert part.information["device_flags"][0] == "law_range"
    assert point["accepted"], point["reason"]
    keys = {key for key in point if kind != "sweep" or not BY_RULE.fullmatch(key)}
    assert keys <= named


def named_in(heading: str) -> list[str]:
    """Everything between backticks, in the order of the page."""
    return re.findall(r"`(\w[\w-]*)`", section(heading))


MODELS = "HDF5 file of a model or of imported measurements"


def test_every_kind_of_file_is_in_the_table():
    assert re.findall(r"^\| `([a-z-]+)` \|", section(MODELS), re.MULTILINE) == list(RESULTS)


@pytest.mark.parametrize("model", [NonlinearMode, LinearModes, FrequencyResponseMatrix])
def test_every_field_of_a_model_is_on_the_page(model):
    texts = {"channels", "specimen", "notes", "source"}
    assert {field.name for field in fields(model)} - set(named_in(MODELS)) <= texts


def test_standard_errors_are_named_in_the_order_of_the_arrays():
    named = named_in(MODELS)
    places = [named.index(name) for name in STANDARD_ERRORS.values()]
    assert places == sorted(places)
