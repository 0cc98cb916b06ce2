"""What is said while a command is silent: after a moment or at once, again after more silence, never while a person types."""

import re
import time

import pytest

from rig.show import waiting
from rig.show.waiting import Waiting, heard, say_beside, silence


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(waiting, "FIRST_S", 0.3)
    monkeypatch.setattr(waiting, "FURTHER_S", 0.6)


def said(capsys):
    return capsys.readouterr().err.splitlines()


def test_a_quick_command_says_nothing(capsys):
    with Waiting("working", "usually a minute"):
        pass
    assert said(capsys) == []


def test_a_slow_one_says_what_it_does_and_how_long_that_takes_once(capsys):
    with Waiting("working", "usually a minute"):
        time.sleep(2.0)
    first, *further = said(capsys)
    assert re.fullmatch(r"\[\d+ s\] working, usually a minute", first)
    assert further
    assert all(re.fullmatch(r"\[\d+ s\] working", line) for line in further)


def test_one_that_announces_itself_does_so_at_once_and_tells_its_next_stage(capsys):
    with Waiting("working", announced=True) as now:
        assert said(capsys) == ["[0 s] working"]
        now.now("finishing", "some seconds")
        assert said(capsys) == ["[0 s] finishing, some seconds"]


def test_nothing_is_said_while_a_person_types_or_something_else_is_shown(capsys):
    with Waiting("working"):
        with silence():
            time.sleep(1.0)
        for _ in range(10):
            heard()
            time.sleep(0.05)
    assert said(capsys) == []


def test_of_two_the_inner_one_speaks_with_what_it_is_told_when_it_does(capsys):
    with Waiting("working"), Waiting("computing", lambda: "some seconds"):
        time.sleep(0.6)
    assert said(capsys) == ["[0 s] computing, some seconds"]


def test_what_makes_a_command_slow_is_said_beside_unless_it_is_quick(capsys):
    with Waiting("working"):
        say_beside("compiling")
        time.sleep(0.5)
        say_beside("compiling")
    say_beside("compiling")
    assert [line.partition("] ")[2] for line in said(capsys)] == ["working", "compiling"]
