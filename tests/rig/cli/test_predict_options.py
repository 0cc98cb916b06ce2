"""What ``rig predict`` asks for is what was typed."""

from pathlib import Path

import pytest

from rig.errors import ConfigurationError


@pytest.fixture
def asked(command, monkeypatch):
    """What a line asks for; nothing is predicted."""
    requests = []

    def note(model, request, *, kind):
        assert not kind
        requests.append((model, request))
        raise ConfigurationError("noted")

    monkeypatch.setattr("rig.results.predict.predict_vibrations", note)

    def of(options):
        ended = command(f"predict MODEL.h5 -o P.h5 --frequency-response 0.25 {options}")
        assert "noted" in ended.err, ended.err
        ((model, request),) = requests
        assert model == Path("MODEL.h5")
        return {name: tuple(value) if isinstance(value, list) else value for name, value in request.items()}

    return of


PLAIN = {"forces_n": (0.25,)}


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        ("", {}),
        ("--frequency-response 1.5", {"forces_n": (0.25, 1.5)}),
        ("--voltage-response 0.5 --voltage-response 2", {"voltages_v": (0.5, 2.0)}),
        ("--sweep a.h5 --sweep b.h5", {"sweeps": (Path("a.h5"), Path("b.h5"))}),
        ("--multisine a.h5 --multisine b.h5", {"multisines": (Path("a.h5"), Path("b.h5"))}),
        ("--planned-sweep a --planned-sweep b.toml", {"planned": ("a", "b.toml")}),
        ("--planned-multisine a --planned-multisine b", {"planned_multisines": ("a", "b")}),
        ("--constant t=1 --constant u=2", {"constants": ("t=1", "u=2")}),
        ("--reference a.h5 --reference b.h5", {"references": (Path("a.h5"), Path("b.h5"))}),
        ("--force rms --over phase", {"held": "rms", "over": "phase"}),
        ("--exciter e.h5 --modes m.h5", {"exciter": Path("e.h5"), "modes": Path("m.h5")}),
        ("--sweep a.h5 --zero-crossings periods", {"sweeps": (Path("a.h5"),), "zero_crossings": "periods"}),
        ("--allow-extrapolation", {"allow_extrapolation": True}),
        ("--bands", {"bands": True}),
        ("--trust-code", {"trust_code": True}),
    ],
)
def test_an_option_fills_its_field_and_no_other(asked, options, wanted):
    assert asked(options) == PLAIN | wanted
