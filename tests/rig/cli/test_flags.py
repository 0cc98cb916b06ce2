from dataclasses import fields

import pytest

from rig.arming.run_options import RunOptions
from rig.cli.app import app
from rig.cli.flags import flags, with_flags
from rig.errors import ConfigurationError
from rig.results.kinds import identifications, predictions
from rig.tuning import TuningRequest
from studies.reproduce.options import Options

FILLED_OTHERWISE = {"specimen", "folder", "progress", "about"}
"""Fields that no single option fills."""


@pytest.mark.parametrize(
    "request_",
    [
        TuningRequest,
        Options,
        RunOptions,
    ],
)
def test_every_field_of_a_request_has_its_option(request_):
    assert {field.name for field in fields(request_)} - FILLED_OTHERWISE <= set(flags(app))


@pytest.mark.parametrize("kinds", [identifications(), predictions()])
def test_every_option_of_a_kind_has_its_flag_and_its_kind(kinds):
    for word, kind in kinds.items():
        assert kind.options.kind == word
        assert set(kind.options.names()) <= set(flags(app))


def test_a_field_becomes_its_option_and_other_words_in_backticks_stay():
    error = ConfigurationError("add `planned` or `no_such_field`, see `rig show x.h5`", field="band_hz", value=3)
    line = with_flags(error, app, ["identify", "x.h5"])
    assert line == "--band = 3 Hz: add --planned-sweep or `no_such_field`, see `rig show x.h5`"


def test_a_key_of_a_file_keeps_its_name():
    error = ConfigurationError("is missing", where="plan.toml", field="band_hz")
    assert with_flags(error, app, ["identify"]) == "plan.toml: band_hz: is missing"


def test_options_of_other_commands_are_not_named():
    assert with_flags(ConfigurationError("is missing", field="band_hz"), app, ["run"]) == "band_hz: is missing"
