"""Several elements in one fit: a cubic spring where no sensor is, and a joint, on a structure integrated with tiny steps."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from numba import njit

from identification import Channel, ElementPlan, IdentificationError, LinearModes, NonlinearElement, fit_structured
from identification.experiments.experiment import Experiment
from identification.models.structured.laws import Damper, Jenkins, PolynomialSpring, Spring, Stop
from tests.refused import refused

OMEGA, ZETA = 2.0 * np.pi * np.array([20.0, 55.0, 130.0]), np.array([0.01, 0.012, 0.015])
INPUT = np.array([0.9, 0.7, 0.5])
OUTPUTS = np.array([[0.9, 0.7, 0.5], [1.3, -0.8, -0.6]])
SPRING, CUBIC_N_M3 = np.array([0.6, 1.0, -0.3]), 2e8
JOINT, STIFFNESS_N_M, SLIP_M = np.array([1.2, -0.3, -0.4]), 3e3, 3e-4
RATE_HZ, PERIOD, FINE, PERIODS = 1000.0, 4000, 64, 6
FORCE = Channel("force", "force", "N")
CHANNELS = (Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
NOISE = 0.002


@njit(cache=True)
def accelerations(u, h, every, omega, zeta, b, spring, cubic, joint, stiffness, slip):  # pragma: no cover compiled
    """Modal accelerations at every ``every``-th step of the leapfrog rule, from rest."""
    n = omega.size
    q, v, a, r = np.zeros(n), np.zeros(n), np.zeros(n), 0.0
    out = np.zeros((u.size // every, n))
    for step in range(u.size):
        z = np.dot(spring, q)
        a[:] = b * u[step] - omega * omega * q - spring * (cubic * z**3) - joint * r
        if step % every == 0:
            out[step // every] = a - 2.0 * zeta * omega * v
        v += 0.5 * h * (a - 2.0 * zeta * omega * v)
        q += h * v
        r = min(max(r + stiffness * h * np.dot(joint, v), -stiffness * slip), stiffness * slip)
        z = np.dot(spring, q)
        a[:] = b * u[(step + 1) % u.size] - omega * omega * q - spring * (cubic * z**3) - joint * r
        v[:] = (v + 0.5 * h * a) / (1.0 + h * zeta * omega)
    return out


def force_of(rms_n: float, seed: int, fine: int = FINE) -> np.ndarray:
    """A period of a multisine from 10 to 75 Hz, at the steps of the integration."""
    spectrum = np.zeros(PERIOD * fine // 2 + 1, complex)
    frequency_hz = np.arange(spectrum.size) * RATE_HZ / PERIOD
    lines = (frequency_hz >= 10.0) & (frequency_hz <= 75.0)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(int(lines.sum())))
    force = np.fft.irfft(spectrum)
    return force * rms_n / np.std(force)


def periods(rms_n: float, seed: int, fine: int = FINE) -> np.ndarray:
    """float[n_outputs, PERIODS, PERIOD]: outputs from rest, without noise."""
    found = accelerations(
        np.tile(force_of(rms_n, seed, fine), PERIODS),
        1.0 / RATE_HZ / fine,
        fine,
        OMEGA,
        ZETA,
        INPUT,
        SPRING,
        CUBIC_N_M3,
        JOINT,
        STIFFNESS_N_M,
        SLIP_M,
    )
    return (OUTPUTS @ found.T).reshape(len(OUTPUTS), PERIODS, PERIOD)


def experiment(rms_n: float, seed: int) -> Experiment:
    """The last two periods, without noise."""
    return Experiment(
        inputs=np.tile(force_of(rms_n, seed)[::FINE], 2)[None],
        outputs=periods(rms_n, seed)[:, -2:].reshape(len(OUTPUTS), -1),
        sample_rate_hz=RATE_HZ,
        input_channels=(FORCE,),
        output_channels=CHANNELS,
        counted_from=PERIOD,
        period_samples=PERIOD,
        excited_hz=(10.0, 75.0),
        name=f"{rms_n:g} N, {seed}",
    )


def noisy(one: Experiment, seed: int) -> Experiment:
    noise = np.random.default_rng(seed).standard_normal(one.outputs.shape)
    return replace(one, outputs=one.outputs + NOISE * np.std(one.outputs, axis=1, keepdims=True) * noise)


def modes() -> LinearModes:
    """Two modes of small vibrations, with the joint stuck, and the third as a residual."""
    squared, shapes = np.linalg.eigh(np.diag(OMEGA**2) + STIFFNESS_N_M * np.outer(JOINT, JOINT))
    omega, outputs = np.sqrt(squared), OUTPUTS @ shapes
    zeta = np.diag(shapes.T @ np.diag(ZETA * OMEGA) @ shapes) / omega
    outputs = outputs * np.sign(INPUT @ shapes)
    return LinearModes(
        channels=CHANNELS,
        frequency_hz=omega[:2] / (2.0 * np.pi),
        frequency_std_hz=np.zeros(2),
        damping_ratio=zeta[:2],
        damping_ratio_std=np.zeros(2),
        shapes=outputs[:, :2],
        shapes_std=np.zeros((2, 2)),
        phase_collinearity=np.ones(2),
        lower=np.zeros(2, complex),
        upper=(outputs[:, 2] * outputs[0, 2] / squared[2]).astype(complex),
        lowest_hz=10.0,
        highest_hz=75.0,
        upper_hz=110.0,
    )


@pytest.fixture(scope="module")
def tested():
    """Training data at two levels, and validation data."""
    training = [noisy(experiment(rms, seed), seed) for rms, seed in ((2.0, 1), (6.0, 2), (6.0, 3))]
    return training, [noisy(experiment(rms, seed), seed) for rms, seed in ((2.0, 11), (6.0, 12), (6.0, 13))]


def angle(element, true):
    """Angle between directions, rad."""
    cosine = abs(element.direction @ true) / np.linalg.norm(element.direction) / np.linalg.norm(true)
    return np.arccos(min(cosine, 1.0))


JOINT_FIRST = (ElementPlan((Jenkins(),)), ElementPlan((PolynomialSpring((0.0, 0.0)),)))


@pytest.mark.slow
def test_two_elements_are_found_and_no_third(tested):
    """The weakest is listed first, which does not matter."""
    training, validation = tested
    plans = (ElementPlan((Stop(),)), *reversed(JOINT_FIRST))
    found = fit_structured(modes(), training, elements=plans, validation=validation, support=False, steps=8)
    assert found.training_error < 1.02 * NOISE
    kept = [trial for trial in found.trials if trial.kept]
    assert [trial.elements for trial in kept] == [("jenkins",), ("jenkins", "polynomial-spring")]
    assert kept[1].gain > 5.0
    (third,) = [trial for trial in found.trials if len(trial.elements) == 3]
    assert third.gain < 1.05
    joint, spring = found.model.elements
    assert angle(joint, JOINT) < 0.002
    assert angle(spring, SPRING) < 0.01
    # scale and direction are one freedom: what the law does to the first mode per displacement there is not
    ratio = joint.direction[0] / JOINT[0]
    (jenkins,) = joint.laws
    assert jenkins.stiffness_n / joint.scale_m * ratio**2 == pytest.approx(STIFFNESS_N_M, rel=0.002)
    assert jenkins.slip * joint.scale_m / ratio == pytest.approx(SLIP_M, rel=0.002)
    ratio = spring.direction[1] / SPRING[1]
    square, cube = spring.laws[0].coefficients_n
    assert cube / spring.scale_m**3 * ratio**4 == pytest.approx(CUBIC_N_M3, rel=0.01)
    assert abs(square) < 0.02 * cube
    np.testing.assert_allclose(found.model.frequency_hz[:2], OMEGA[:2] / (2.0 * np.pi), rtol=1e-4)
    np.testing.assert_allclose(found.model.damping_ratio[:2], ZETA[:2], rtol=2e-3)


@pytest.mark.slow
def test_an_element_at_a_channel_keeps_to_it(tested):
    """A spring at the tip, where there is none, does not pay; its direction is that of the tip's shapes."""
    training, _ = tested
    plans = (JOINT_FIRST[0], ElementPlan((PolynomialSpring((0.0, 0.0)),), between=("tip",)))
    found = fit_structured(modes(), training, elements=plans, support=False)
    tip = found.model.elements[1]
    assert tip.between == ("tip",)
    np.testing.assert_allclose(tip.direction, found.model.output_shapes[1], rtol=1e-12)
    free = fit_structured(modes(), training, elements=JOINT_FIRST, support=False)
    assert free.training_error < 0.2 * found.training_error


@pytest.mark.slow
def test_derivatives_by_shapes_of_an_element_at_a_place(tested):
    """Against central differences of simulations."""
    from identification.models.structured.parameters import Parameters
    from identification.models.structured.start import linear_start

    (one, *_), _ = tested
    linear = linear_start(modes(), one, 2)
    place = linear.output_selector(("tip", "drive"))
    np.testing.assert_array_equal(place, [-1.0, 1.0])
    element = NonlinearElement(
        direction=place @ linear.output_shapes,
        scale_m=1e-3,
        laws=(PolynomialSpring((0.5, 2.0)),),
        between=("tip", "drive"),
    )
    model = replace(linear, elements=(element,))
    parameters = Parameters(model, (0,), False)
    assert not [name for name in parameters.names if "direction" in name]
    vector = parameters.vector(model)
    _, derivatives = parameters.derivatives(model, one.inputs, 7000)
    for name in ("shape 1 at force", "shape 2 at tip", "frequency 1"):
        at = parameters.names.index(name)
        step = 1e-5 * max(abs(vector[at]), 1.0)
        outputs = [
            parameters.model(vector + sign * step * np.eye(vector.size)[at]).simulate(one.inputs).outputs[:, 7000:]
            for sign in (1.0, -1.0)
        ]
        expected = (outputs[0] - outputs[1]).T / (2.0 * step)
        np.testing.assert_allclose(derivatives[..., at], expected, atol=2e-5 * np.max(np.abs(expected)), err_msg=name)


def test_plans_that_cannot_be_are_refused(tested):
    training, _ = tested
    with refused(IdentificationError, "empty", field="laws", allowed="one at least"):
        ElementPlan(())
    with refused(IdentificationError, "tip-tip", field="between", allowed="one or two different outputs"):
        ElementPlan(between=("tip", "tip"))
    with refused(IdentificationError, "nowhere"):
        fit_structured(modes(), training[:1], elements=(ElementPlan(between=("nowhere",)),))


class Straight(Spring):
    """``2 x``."""

    free: ClassVar = {}

    def force(self, x):
        return 2.0 * x


class Dashpot(Damper):
    """3 N s/m everywhere."""

    free: ClassVar = {}

    def damping(self, x):
        return np.full(np.shape(x), 3.0)


@pytest.mark.parametrize("scale_m", [1e-3, 0.5, 2.0])
@pytest.mark.parametrize("reach", [1.0, 3.0])
def test_small_motions_have_the_stiffness_of_springs_and_stuck_sliders_and_the_damping_of_dashpots(scale_m, reach):
    """With ``z = scale x`` the energy is ``k scale x^2 / 2`` for a force of k x, and the power lost is ``c scale^2 x'^2``."""
    laws = (Straight(), PolynomialSpring((0.7, 0.4)), Jenkins(stiffness_n=5.0, slip=0.2), Dashpot(), Dashpot())
    element = NonlinearElement(direction=[1.0], scale_m=scale_m, laws=laws, reach=reach)
    stiffness_j, damping_j_s = element.at_rest
    assert stiffness_j == pytest.approx((2.0 + 5.0) * scale_m, rel=1e-8)
    assert damping_j_s == pytest.approx((3.0 + 3.0) * scale_m**2, rel=1e-12)
