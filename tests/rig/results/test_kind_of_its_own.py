"""A kind of result that is declared here alone is identified, stored, shown, drawn and exported by the command line."""

import json
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
import pytest
from pydantic import Field

from identification import FrequencyResponse
from rig.results import kinds
from rig.results.files import load, load_as, save
from rig.results.kind import Exchange, Identification, ResultKind, Table
from rig.results.options import Options
from rig.text.contents import Contents
from vibrolock.results import Result


@dataclass(frozen=True)
class Oscillator(Result):
    """One degree of freedom."""

    frequency_hz: float
    damping_ratio: float
    specimen: str = ""
    notes: tuple[str, ...] = ()


class OscillatorOptions(Options):
    """Options of ``rig identify oscillator``."""

    kind: ClassVar[str] = "oscillator"

    damping_ratio: float = Field(0.01, gt=0.0)
    """Damping ratio, which is taken as given."""


def identify(paths, options, progress):
    (response,) = load_as(tuple, paths[0])
    top = int(np.argmax(response.amplitude_m))
    return Oscillator(float(response.frequency_hz[top]), options.damping_ratio, response.specimen)


def _say(summary):
    print(f"oscillator at {summary['frequency_hz']:g} Hz")


def draw(page, found):
    page.subplots().plot([0.0, found.frequency_hz], [0.0, 1.0])


def _apart(found):
    arrays = {"frequency_hz": np.array([found.frequency_hz]), "damping_ratio": np.array([found.damping_ratio])}
    return Contents("oscillator", found.specimen, arrays, {}, dict.fromkeys(arrays, 0))


def _together(arrays, attributes):
    return Oscillator(*(float(arrays[name][0]) for name in ("frequency_hz", "damping_ratio")))


TABLE = Table(asdict, _say)
EXCHANGE = Exchange("oscillator", Oscillator, _apart, _together)
KIND = ResultKind(
    name="oscillator",
    holds=(f"{__name__}:Oscillator",),
    table=f"{__name__}:TABLE",
    draw=f"{__name__}:draw",
    exchange=f"{__name__}:EXCHANGE",
    identification=Identification(
        "oscillator", "One degree of freedom.", f"{__name__}:OscillatorOptions", f"{__name__}:identify"
    ),
)


@pytest.fixture
def there(command, tmp_path, monkeypatch):
    """The command in a folder with a stepped sine, and with the kind in the list."""
    caches = (kinds.identifications, kinds.exchanges)
    monkeypatch.setitem(kinds.KINDS._addresses, "oscillator", f"{__name__}:KIND")
    for one in caches:
        one.cache_clear()
    monkeypatch.chdir(tmp_path)
    frequency_hz = np.linspace(15.0, 25.0, 41)
    response = 1.0 / (20.0**2 - frequency_hz**2 + 0.4j * frequency_hz)
    measured = FrequencyResponse(
        frequency_hz=frequency_hz,
        force=np.ones(frequency_hz.size, complex),
        response=response,
        kind="displacement",
        level=1.0,
        controlled="force",
        specimen="a spring",
    )
    save((measured,), tmp_path / "sine.h5")
    yield command
    for one in caches:
        one.cache_clear()


def test_a_kind_of_its_own_is_identified_stored_shown_drawn_and_exported(there, tmp_path):
    there("identify oscillator sine.h5 --damping-ratio 0.02 -o o.h5").succeeded()
    assert load(tmp_path / "o.h5") == Oscillator(20.0, 0.02, "a spring")
    assert "oscillator at 20 Hz" in there("show o.h5").succeeded().out
    told = json.loads(there("show o.h5 --json").succeeded().out)
    assert (told["kind"], told["frequency_hz"], told["damping_ratio"]) == ("oscillator", 20.0, 0.02)
    there("plot o.h5 -o o.png").succeeded()
    there("export o.h5 --to mat -o o.mat").succeeded()
    there("import o.mat -o again.h5").succeeded()
    assert load(tmp_path / "again.h5") == Oscillator(20.0, 0.02)
    assert "oscillator at 20 Hz" in load(tmp_path / "o.h5")._repr_html_()


def test_its_options_stand_in_its_help_and_in_messages(there):
    told = there("identify oscillator --help").out
    assert "--damping-ratio" in told
    assert "--states" not in told
    assert "One degree of freedom." in there("identify --help").out
    wrong = there("identify oscillator sine.h5 --damping-ratio 0 -o o.h5")
    assert wrong.err == "rig: --damping-ratio = 0: allowed is any number above 0\n"
    other = there("identify oscillator sine.h5 --states 2 -o o.h5")
    assert (other.status, other.err.count("\n")) == (2, 1)
    assert "allowed are --output, --damping-ratio" in other.err
    flat = there("identify sine.h5 --model oscillator --states 2 -o o.h5")
    assert flat.err == "rig: --states: does not apply to --model oscillator, which takes --damping-ratio\n"
