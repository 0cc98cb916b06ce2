"""`rig tune` as typed, with its rehearsal, on rigs drawn at random that have once ended it without a word."""

import re
from pathlib import Path

import pytest

RIGS = sorted((Path(__file__).parent / "drawn_rigs").glob("*.toml"))


@pytest.mark.slow
@pytest.mark.parametrize("bench", RIGS, ids=lambda path: path.stem)
def test_a_plan_and_its_rehearsal_come_of_a_rig_drawn_at_random(command, bench):
    told = command("tune", "--bench", bench, "-o", "tuned.toml").succeeded()
    assert re.search(r"of \d+\) and trips in", told.out)  # no more twins than the verdict needs
    assert Path("tuned-rehearsal.h5").exists()
