"""Arc-length continuation on curves with a closed form."""

import numpy as np
import pytest

from identification.continuation.follow import continued
from identification.continuation.newton import solved
from identification.continuation.path import Path, Steps
from identification.errors import IdentificationError
from tests.refused import refused
from vibrolock.arrays import Float

Answer = tuple[Float, Float, Float]


def circle(z: Float, p: float) -> Answer:
    return np.array([z[0] ** 2 + p**2 - 1.0]), np.array([[2.0 * z[0]]]), np.array([2.0 * p])


def cubic(z: Float, p: float) -> Answer:
    return np.array([z[0] ** 3 - 3.0 * z[0] - p]), np.array([[3.0 * z[0] ** 2 - 3.0]]), np.array([-1.0])


def test_a_circle_is_followed_round_until_it_closes() -> None:
    path = continued(circle, [1.0], 0.0)
    assert path.ending == "closed"
    np.testing.assert_allclose(path.unknowns[:, 0] ** 2 + path.parameter**2, 1.0, atol=1e-13)
    np.testing.assert_array_equal(path.unknowns[-1], path.unknowns[0])
    np.testing.assert_allclose(np.sort(path.turning_parameter), [-1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(path.turning_unknowns, 0.0, atol=1e-6)
    turned = np.abs(np.diff(np.unwrap(np.arctan2(path.parameter, path.unknowns[:, 0]))))
    assert turned.sum() == pytest.approx(2.0 * np.pi)
    assert turned.max() < 0.1 * 1.01


def test_folds_of_a_cubic_lie_where_its_slope_vanishes() -> None:
    path = continued(cubic, [-3.0], -18.0, scale=0.1, parameter_scale=5.0, lowest=-20.0, highest=18.0)
    assert path.ending == "range"
    np.testing.assert_allclose(path.turning_parameter, [2.0, -2.0], atol=1e-10)
    np.testing.assert_allclose(path.turning_unknowns[:, 0], [-1.0, 1.0], atol=1e-5)
    assert path.parameter[-1] == 18.0
    assert path.unknowns[-1, 0] == pytest.approx(3.0)
    np.testing.assert_array_equal(np.sign(path.direction), np.sign(path.unknowns[:, 0] ** 2 - 1.0))
    for after, fold in zip(path.turning_after, path.turning_unknowns[:, 0], strict=True):
        assert path.unknowns[after, 0] < fold < path.unknowns[after + 1, 0]


def duffing(force: float, damping: float) -> tuple[float, Float]:
    """Largest amplitude, and the folds' ``(W^2, a^2)``, of x'' + d x' + x + x^3 = f cos(W t) in one harmonic."""
    # (1 + 0.75 s - w)^2 s + d^2 w s = f^2 with s = a^2, w = W^2: folds where the derivative with respect to s vanishes
    folds = []
    for s in np.linspace(0.01, 40.0, 200001):
        b = -2.0 * (1.0 + 0.75 * s) + damping**2
        c = (1.0 + 0.75 * s) ** 2 - force**2 / s
        if (root := b * b / 4.0 - c) < 0.0:
            continue
        for w in (-b / 2.0 + np.sqrt(root), -b / 2.0 - np.sqrt(root)):
            k = 1.0 + 0.75 * s - w
            folds.append((w, s, k * k + 1.5 * s * k + damping**2 * w))
    found = np.array(folds)
    upper, lower = found[::2], found[1::2]
    crossings = [
        0.5 * (branch[k, :2] + branch[k + 1, :2])
        for branch in (upper, lower)
        for k in np.flatnonzero(branch[1:, 2] * branch[:-1, 2] < 0.0)
    ]
    return float(np.sqrt(found[:, 1].max())), np.array(crossings)


def one_harmonic(z: Float, p: float, force: float = 0.3, damping: float = 0.1) -> Answer:
    a, b = z
    k = 1.0 + 0.75 * (a * a + b * b) - p * p
    residual = np.array([k * a + damping * p * b - force, k * b - damping * p * a])
    by_z = np.array(
        [[k + 1.5 * a * a, damping * p + 1.5 * a * b], [1.5 * a * b - damping * p, k + 1.5 * b * b]],
    )
    return residual, by_z, np.array([-2.0 * p * a + damping * b, -2.0 * p * b - damping * a])


def test_a_hardening_oscillator_turns_where_the_closed_form_says() -> None:
    path = continued(one_harmonic, [0.4, 0.0], 0.3, scale=0.3, parameter_scale=0.5, lowest=0.3, highest=4.0)
    largest, folds = duffing(0.3, 0.1)
    amplitude = np.linalg.norm(path.unknowns, axis=1)
    assert path.ending == "range"
    assert amplitude.max() == pytest.approx(largest, rel=1e-3)
    found = np.column_stack([path.turning_parameter**2, np.sum(path.turning_unknowns**2, axis=1)])
    order, expected = np.argsort(found[:, 0]), folds[np.argsort(folds[:, 0])]
    np.testing.assert_allclose(found[order, 0], expected[:, 0], rtol=1e-6)
    np.testing.assert_allclose(found[order, 1], expected[:, 1], rtol=1e-3)
    assert path.parameter.size < 150


def test_the_curve_does_not_depend_on_the_units_of_the_unknowns() -> None:
    def stretched(z: Float, p: float) -> Answer:
        residual, by_z, by_p = one_harmonic(z * [1e6, 1e-6], p)
        return residual * [1.0, 1e9], by_z * [1e6, 1e-6] * [[1.0], [1e9]], by_p * [1.0, 1e9]

    kwargs = {"parameter_scale": 0.5, "lowest": 0.3, "highest": 4.0}
    plain = continued(one_harmonic, [0.4, 0.0], 0.3, scale=0.3, **kwargs)
    other = continued(stretched, [0.4e-6, 0.0], 0.3, scale=[0.3e-6, 0.3e6], **kwargs)
    np.testing.assert_allclose(other.parameter, plain.parameter, rtol=1e-9)
    np.testing.assert_allclose(other.turning_parameter, plain.turning_parameter, rtol=1e-9)


def test_a_path_ends_where_it_was_told_to() -> None:
    def end(**more: object) -> Path:
        return continued(cubic, [-3.0], -18.0, parameter_scale=5.0, **more)  # type: ignore[arg-type]

    assert end(highest=0.0).parameter[-1] == 0.0
    few = end(points=7)
    assert (few.ending, few.parameter.size) == ("points", 7)
    stopped = end(stop=lambda z, p: "too far" if p > 0.0 else "")
    assert (stopped.ending, stopped.reason) == ("stopped", "too far")
    assert stopped.parameter[-1] > 0.0 >= stopped.parameter[-2]
    last = end(highest=0.0, stop=lambda z, p: "at the end" if p == 0.0 else "")
    assert (last.ending, last.reason, last.parameter[-1]) == ("stopped", "at the end", 0.0)
    first = end(stop=lambda z, p: "at once")
    assert (first.ending, first.parameter.tolist()) == ("stopped", [-18.0])


def test_a_system_that_has_no_answer_any_more_ends_the_path() -> None:
    def broken(z: Float, p: float) -> Answer:
        residual, by_z, by_p = circle(z, p)
        return residual + (np.nan if p > 0.5 else 0.0), by_z, by_p

    path = continued(broken, [1.0], 0.0)
    assert path.ending == "step"
    assert path.parameter[-1] == pytest.approx(0.5, abs=1e-4)


def test_newton_says_where_there_is_no_solution() -> None:
    assert solved(circle, [1.0], 2.0) is None
    found = solved(circle, [0.9], 0.6)
    assert found is not None
    assert found[0] == pytest.approx(0.8, abs=1e-12)
    with refused(IdentificationError, "no-solution-found-near-them-at", field="unknowns"):
        continued(circle, [1.0], 2.0)
    with refused(IdentificationError, "begins-at", field="parameter", allowed="-1 to 1"):
        continued(circle, [1.0], 2.0, lowest=-1.0, highest=1.0)
    with refused(IdentificationError, field="largest", allowed="finite and above zero"):
        Steps(largest=0.0)


def bent(z: Float, p: float) -> Answer:
    """``z = 0`` below p = 0.5, a line of slope 5 above it."""
    slope = 5.0 if p > 0.5 else 0.0
    return np.array([z[0] - slope * (p - 0.5)]), np.array([[1.0]]), np.array([-slope])


def peaked(z: Float, p: float) -> Answer:
    """``p = 1 - |z - 1|/2``."""
    return np.array([p - 1.0 + 0.5 * abs(z[0] - 1.0)]), np.array([[0.5 * np.sign(z[0] - 1.0)]]), np.array([1.0])


def test_a_curve_goes_on_behind_a_kink_if_kinks_are_allowed() -> None:
    assert continued(bent, [0.0], 0.0, highest=1.0).ending == "step"
    path = continued(bent, [0.0], 0.0, highest=1.0, steps=Steps(kinks=True))
    assert path.ending == "range"
    np.testing.assert_allclose(path.unknowns[:, 0], np.maximum(5.0 * (path.parameter - 0.5), 0.0), atol=1e-9)
    assert path.unknowns[-1, 0] == pytest.approx(2.5)


def test_a_kink_at_which_the_parameter_turns_back_is_a_turning_point() -> None:
    path = continued(peaked, [-0.8], 0.1, lowest=-1.0, highest=2.0, steps=Steps(kinks=True))
    assert path.ending == "range"
    assert path.unknowns[-1, 0] == pytest.approx(5.0)
    assert path.turning_parameter == pytest.approx([1.0], abs=1e-4)
    assert path.turning_unknowns[:, 0] == pytest.approx([1.0], abs=1e-4)
