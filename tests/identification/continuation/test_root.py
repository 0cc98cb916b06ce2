"""Roots between two ends."""

import math
from collections.abc import Callable

import pytest

from identification.continuation.root import root_between

ROOTS: tuple[tuple[Callable[[float], float], float], ...] = (
    (lambda x: x - 0.3, 0.3),
    (lambda x: math.cos(x) - x, 0.7390851332151607),
    (lambda x: (x - 0.7) ** 3, 0.7),
    (lambda x: math.tanh(200.0 * (x - 0.9)), 0.9),
    (lambda x: x**9 - 1e-4, 1e-4 ** (1.0 / 9.0)),
)


@pytest.mark.parametrize(("function", "root"), ROOTS)
def test_it_is_found_to_within_the_tolerance_in_few_calls(function: Callable[[float], float], root: float) -> None:
    calls = []

    def counted(x: float) -> float:
        calls.append(x)
        return function(x)

    assert root_between(counted, 0.0, 1.0, 1e-9) == pytest.approx(root, abs=1e-9)
    assert len(calls) < 40


def test_there_is_none_without_a_change_of_sign_or_where_a_value_is_missing() -> None:
    assert root_between(lambda x: x + 1.0, 0.0, 1.0, 1e-9) is None
    assert root_between(lambda x: math.nan if 0.2 < x < 0.9 else x - 0.5, 0.0, 1.0, 1e-9) is None
    assert root_between(lambda x: x, 0.0, 1.0, 1e-9) == 0.0
