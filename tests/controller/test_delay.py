"""The longest delay that gains bear, against closed forms and modes."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from controller import AmplitudeLaw, preset
from controller.delay import LARGEST_TURN_DEG, highest_crossover_rad_s, longest_delay_s
from tests.refused import refused
from vibrolock.errors import InputError

GAINS = st.floats(0.01, 1000.0)


@given(GAINS, GAINS)
def test_without_a_proportional_part_the_crossover_is_the_root_of_a_quadratic(ki, low_pass):
    square = 0.5 * low_pass * (math.sqrt(low_pass**2 + 4.0 * ki**2) - low_pass)
    found = highest_crossover_rad_s(0.0, ki, low_pass, integrates=False)
    assert found == pytest.approx(math.sqrt(square), rel=1e-6)


@given(GAINS, GAINS)
def test_a_pi_law_on_an_integrator_without_a_low_pass_has_the_crossover_of_the_closed_form(kp, ki):
    """``|kp + ki/(i w)| = w``: w^4 - kp^2 w^2 - ki^2 = 0."""
    square = 0.5 * (kp**2 + math.sqrt(kp**4 + 4.0 * ki**2))
    found = highest_crossover_rad_s(kp, ki, 1e12, integrates=True)
    assert found == pytest.approx(math.sqrt(square), rel=1e-6)


def test_without_gains_every_delay_is_allowed():
    assert highest_crossover_rad_s(0.0, 0.0, 6.0, integrates=True) == 0.0
    assert longest_delay_s(0.0) == math.inf
    assert longest_delay_s(2.0) == pytest.approx(math.radians(LARGEST_TURN_DEG) / 2.0)


@given(st.floats(0.0, 50.0), st.floats(0.1, 500.0), st.floats(1.0, 100.0), st.floats(1e-3, 1e3), st.booleans())
def test_no_mode_whose_force_does_not_answer_it_has_its_crossover_above_the_bound(kp, ki, low_pass, decay, integrates):
    omega = np.geomspace(1e-3, 1e5, 2000)
    plant = (1.0 if integrates else decay) / (1j * omega + decay)
    size = np.abs((kp + ki / (1j * omega)) * low_pass / (1j * omega + low_pass) * plant)
    crossed = omega[size >= 1.0].max(initial=0.0)
    assert crossed <= highest_crossover_rad_s(kp, ki, low_pass, integrates=integrates) * (1.0 + 1e-9)


def test_what_is_refused_names_gains_delay_and_what_is_allowed():
    law = preset("magnet-beam")
    longest = longest_delay_s(highest_crossover_rad_s(law.k1, law.k2, law.low_pass_rad_s, integrates=True))
    assert longest == pytest.approx(0.284, abs=0.001)
    law.check_delay(0.999 * longest, AmplitudeLaw.VOLTAGE)
    with refused(ValueError, "ms-from-may-take-deg-up", field="k1 = 2, k2 = 6.28319"):
        law.check_delay(0.3, AmplitudeLaw.VOLTAGE)


@pytest.mark.parametrize(
    ("changes", "amplitude_law", "named"),
    [
        (
            {"force_loop": "logarithmic", "force_integral_per_s": 100.0},
            AmplitudeLaw.FORCE,
            "force_proportional = 0.3, ",
        ),
        ({"force_loop": "through-response", "response_integral_per_s": 100.0}, AmplitudeLaw.FORCE_RMS, "response_"),
        ({"response_integral_per_s": 100.0}, AmplitudeLaw.RESPONSE, "response_integral_per_s = 100"),
        ({"force_loop": "linear", "k3": 50.0, "k4": 50.0, "response_integral_per_s": 100.0}, AmplitudeLaw.FORCE, None),
        ({"response_integral_per_s": 100.0, "force_integral_per_s": 100.0}, AmplitudeLaw.VOLTAGE, None),
    ],
)
def test_only_the_loops_in_use_are_judged(changes, amplitude_law, named):
    law = preset("magnet-beam").model_copy(update={"low_pass_rad_s": 30.0, **changes})
    assert law.gain_names(amplitude_law)[:2] == ("k1", "k2")
    if named is None:
        law.check_delay(0.1, amplitude_law)
        return
    with refused(InputError, field=lambda text: text.startswith(named)):
        law.check_delay(0.1, amplitude_law)
