"""What is said while a model is fitted: how long it usually takes, once, and errors without those that nothing has."""

import math

from identification import FitProgress
from rig.show import waiting
from rig.show.progress import FitLines
from rig.show.waiting import Waiting


def at(usual_s=None):
    return FitProgress(
        iteration=0,
        iterations=100,
        training_error=0.5,
        validation_error=math.nan,
        damping=math.nan,
        seconds=1.0,
        usual_s=usual_s,
    )


def test_the_usual_time_is_printed_once_as_soon_as_the_command_is_slow(capsys, monkeypatch):
    monkeypatch.setattr(waiting, "FIRST_S", math.inf)
    lines = FitLines()
    with Waiting("identifying"):
        lines(at((60.0, 240.0)))
        assert "usually" not in capsys.readouterr().err
        monkeypatch.setattr(waiting, "FIRST_S", 0.0)
        for _ in range(3):
            lines(at())
    err = capsys.readouterr().err
    assert err.count("a fit of this size usually takes 60 s to 4 min 0 s") == 1


def test_an_error_that_is_not_known_is_not_printed(capsys):
    FitLines()(at())
    line = capsys.readouterr().err
    assert "training 50 %" in line
    assert "validation" not in line
