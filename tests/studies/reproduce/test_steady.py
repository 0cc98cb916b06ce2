from dataclasses import replace
from typing import Any

import numpy as np

from identification import SteadyPrediction
from studies.reproduce.steady import Steady
from studies.reproduce.true_responses import Truth


def rising(**changes: Any) -> SteadyPrediction:
    """Of amplitudes that rise to the end, as of a path that was cut off."""
    none, n = np.zeros(0), 5
    return SteadyPrediction(
        force_n=1.0,
        force="pure-sine",
        channels=("drive",),
        frequency_hz=np.linspace(20.0, 24.0, n),
        modal_amplitude=np.full(n, np.nan),
        fundamental_n=np.ones(n),
        displacement_m=-1j * np.linspace(1e-3, 2e-3, n)[:, None],
        stable=np.ones(n, dtype=bool),
        branch=np.zeros(n, dtype=np.int64),
        range_use=np.linspace(1.0, 3.0, n),
        fold_frequency_hz=none,
        fold_amplitude_m=none,
        fold_modal_amplitude=none,
        notes=("ends at 24 Hz",),
        **changes,
    )


def test_a_response_that_was_cut_off_has_no_peak_error() -> None:
    truth = Truth("pure-sine", 1.0, 1.0, None, 2e-3, 24.0)  # type: ignore[arg-type]
    whole = Steady("low", "low 01", truth, rising(), "").row()
    assert (whole["error"], whole["frequency_error"], whole["complete"]) == (0.0, 0.0, True)
    cut = Steady("low", "low 01", truth, rising(complete=False), "").row()
    assert (cut["error"], cut["frequency_error"], cut["complete"]) == (None, None, False)
    assert cut["notes"][-1] == "ends at 24 Hz"
    over = replace(rising(complete=False), displacement_m=-1j * np.array([[1e-3], [2e-3], [1e-3], [5e-4], [2e-4]]))
    assert Steady("low", "low 01", truth, over, "").row()["error"] is not None
