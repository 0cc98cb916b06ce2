"""Recordings whose force had controlled and prescribed harmonics are shown and drawn by the command."""

import pytest

from rig.recording.reader import Recording
from rig.show.summary import summarise_recording
from tests.recorded import recorded_at
from tests.rig.campaigns.evaluation.test_force_harmonics import VARIED, plan_with


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    file = tmp_path_factory.mktemp("varied") / "varied.h5"
    with Recording(recorded_at(file, plan_with(**VARIED), seed=1)) as recording:
        assert recording.complete
        return file, summarise_recording(recording)


def test_the_command_shows_every_point_with_the_purity_of_its_force(command, recorded):
    file, summary = recorded
    purity = [point["force_purity"] for point in summary["points"]]
    assert purity == pytest.approx([1.0, 1 / 1.25**0.5] * 2, abs=2e-3)
    out = command("show", file).succeeded().out
    assert out.count("89.4") >= 2
    assert "the plan was carried out" in out


def test_the_command_draws_them(command, recorded, tmp_path):
    file, _ = recorded
    command("plot", file, "-o", "varied.png").succeeded()
    assert (tmp_path / "varied.png").stat().st_size > 10_000
