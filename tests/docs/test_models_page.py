"""Bad input gets the answers that the page on mending a model lists, from a recording of the magnet beam."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identification import (
    Backbone,
    Channel,
    IdentificationError,
    LinearModes,
    PeriodicSpectra,
    frequency_response,
    identify_exciter,
    nonlinear_mode,
)
from tests.docs.pages import ROOT
from tests.recorded import SHORT, recorded_run

PAGE = (ROOT / "docs" / "how-to" / "mend-a-model.md").read_text(encoding="utf-8")
SHAPES = {"drive": 0.908, "acc_drive": 1.011, "acc_magnet": 1.445}


@pytest.fixture(scope="module")
def backbone() -> Backbone:
    with recorded_run("magnet-beam/backbone", **SHORT) as run:
        return run.backbone()


def modes(frequency_hz=(24.37,), shapes=SHAPES, drive="drive") -> LinearModes:
    """Modes with alike shapes at the given channels."""
    count, names = len(frequency_hz), list(shapes)
    shape = np.array([[value * (1.0 + 0.01 * k * i) for k in range(count)] for i, value in enumerate(shapes.values())])
    unknown = np.full(count, np.nan)
    return LinearModes(
        channels=tuple(Channel(name, "drive" if name == drive else "response", "m/s^2") for name in names),
        frequency_hz=frequency_hz,
        frequency_std_hz=unknown,
        damping_ratio=np.full(count, 0.004),
        damping_ratio_std=unknown,
        shapes=shape,
        shapes_std=np.full(shape.shape, np.nan),
        phase_collinearity=unknown,
        lower=np.zeros(len(names)),
        upper=np.zeros(len(names)),
        lowest_hz=10.0,
        highest_hz=200.0,
    )


def with_first(backbone: Backbone, **changes) -> Backbone:
    return replace(backbone, points=(replace(backbone.points[0], **changes), *backbone.points[1:]))


def first_force(backbone: Backbone, factor: complex) -> Backbone:
    harmonics = backbone.points[0].harmonics.copy()
    harmonics[[channel.role for channel in backbone.channels].index("force")] *= factor
    return with_first(backbone, harmonics=harmonics)


def one_period() -> PeriodicSpectra:
    channels = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s^2"), Channel("voltage", "monitor", "V"))
    lines = np.arange(1, 41)
    values = np.exp(1j * np.outer(np.arange(3), lines))[None, None]
    return PeriodicSpectra(channels, 1.0 * lines, np.ones(lines.size, dtype=bool), values)


def listed(message: str) -> bool:
    """Whether the page has this answer in code; three dots stand for anything."""
    wanted = re.findall(r"`([^`]+)`", PAGE)
    return any(
        re.search(re.sub(r"\d", r"\\d", re.escape(one)).replace("…", ".*"), message) for one in wanted if len(one) > 20
    )


REFUSED = {
    "unsettled": lambda b: nonlinear_mode(with_first(b, settled=False)),
    "force near zero": lambda b: nonlinear_mode(first_force(b, 1e-6)),
    "NaN": lambda b: nonlinear_mode(first_force(b, np.nan)),
    "force in millinewtons": lambda b: nonlinear_mode(first_force(b, 1e3j)),
    "another beam": lambda b: nonlinear_mode(b, modes=modes((30.0,))),
    "closely spaced": lambda b: nonlinear_mode(b, modes=modes((24.36, 24.41))),
    "more modes than sensors": lambda b: nonlinear_mode(b, modes=modes((24.37, 25.5, 26.5, 27.5))),
    "another drive point": lambda b: nonlinear_mode(b, modes=modes(drive="acc_drive")),
    "beyond the range": lambda b: frequency_response(nonlinear_mode(b), 2.0),
    "one period": lambda _: identify_exciter(one_period()),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_is_answered_as_the_page_says(case, backbone):
    with pytest.raises(IdentificationError) as refused:
        REFUSED[case](backbone)
    assert listed(str(refused.value).replace("`", "")), str(refused.value)


NOTED = {
    "sensor missing": lambda b: nonlinear_mode(b, modes=modes(shapes={"drive": 0.908, "acc_drive": 1.011})),
    "units mixed": lambda b: nonlinear_mode(b, modes=modes(shapes=SHAPES | {"acc_drive": 9.80665 * 1.011})),
    "flipped sensor": lambda b: nonlinear_mode(first_force(b, -1.0)),
}


@pytest.mark.parametrize("case", NOTED)
def test_what_is_only_noted_is_noted_as_the_page_says(case, backbone):
    notes = NOTED[case](backbone).notes
    assert any(listed(note) for note in notes), notes


def test_an_answer_that_is_not_on_the_page_is_not_taken_for_one():
    assert not listed("something else went wrong")
