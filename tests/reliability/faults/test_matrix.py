"""Every fault at every kind of level on every device: the output stays bounded, the run ends in time and says why."""

from dataclasses import replace

import pytest

from tests.reliability.faults.bounds import objections
from tests.reliability.faults.matrix import CASES
from tests.reliability.faults.observing import healthy, observe
from tests.reliability.faults.plans import LEVELS, bench_for

TESTED = [case for case in CASES if not case.is_left_to_the_command]


@pytest.mark.parametrize("case", TESTED, ids=lambda case: case.name)
def test_a_fault_is_bounded_ends_what_it_spoils_and_is_told(case):
    assert objections(case, observe(*case), bench_for(case.levels)) == []


@pytest.mark.parametrize("levels", LEVELS)
def test_without_a_fault_every_point_is_accepted(levels):
    assert healthy(levels, "virtual").finished


def test_the_matrix_has_faults_of_every_part_at_every_kind_of_level_on_both_devices():
    assert len({case.fault for case in CASES}) >= 28
    assert {case.fault.part for case in CASES} == {"force", "drive", "response", "amplifier", "structure", "driver"}
    assert {case.levels for case in CASES} == set(LEVELS)
    assert {case.device for case in CASES} == {"virtual", "emulated"}
    assert len({case.name for case in CASES}) == len(CASES)
    assert {case.fault for case in TESTED} == {case.fault for case in CASES}
    assert {(case.levels, case.device) for case in TESTED} == {(levels, "virtual") for levels in LEVELS} | {
        (levels, "emulated") for levels in ("V", "N logarithmic")
    }


@pytest.mark.parametrize("part", ["force", "drive", "response", "amplifier", "structure", "driver"])
def test_the_tests_look_at_every_kind_of_fault_in_volts_and_newtons_and_at_every_onset_with_both(part):
    here = [case for case in TESTED if case.fault.part == part and case.device == "virtual"]
    loops = {case: case.levels.replace(",", " ").split()[0] for case in here}
    onsets = {(case.fault.onset, loops[case]) for case in here}
    assert {loop for _, loop in onsets} >= {"V", "N"}
    if part in ("force", "drive", "response"):
        assert onsets >= {(onset, loop) for onset in ("start", "middle") for loop in ("V", "N")}
        for kind in {case.fault.kind for case in here if case.fault.onset == "start"}:
            assert {loops[case] for case in here if case.fault.kind == kind} >= {"V", "N"}


def test_each_bound_can_be_broken():
    case = next(case for case in CASES if case.name == "force-nan-middle, N logarithmic, virtual")
    seen, bench = observe(*case), bench_for(case.levels)
    for change, said in (
        ({"output_v": 9.5}, "output of 9.5 V"),
        ({"force_n": 51.0}, "force of 51 N"),
        ({"displacement_m": 0.008}, "displacement of 0.008 m"),
        ({"samples_to_trip": None}, "the run went on"),
        ({"samples_to_trip": 400}, "ended after 400 samples"),
        ({"samples_to_zero": 9000}, "0 V after 9000 samples"),
        ({"last_handed_v": 0.5}, "never 0 V"),
        ({"said": ("stopped",)}, "nothing said of it"),
        ({"closed": False}, "the recording has no end"),
        ({"spoilt": 1}, "spoilt points accepted"),
    ):
        assert any(said in line for line in objections(case, replace(seen, **change), bench))
