"""Runs over time and backbones beyond the training data: how far the input goes, bands, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from identification import ExtrapolationError, structured_mode
from identification.models import Jenkins, PolynomialDamper, PolynomialSpring, peak_band, run_band
from identification.models.structured.trained_range import input_use, trained_force_n
from tests.identification.models.structured.models import RATE_HZ
from tests.identification.models.structured.steady.test_mode import fit_of
from tests.identification.models.structured.test_extrapolation import FORCE_N, JOINT, one_mode
from tests.refused import refused

STEPS = 8
"""Steps in a sample, so that the same stiffness in an element or beside it is the same to 1e-3 of a response."""
FINE = replace(JOINT, steps=STEPS)
FIT = replace(fit_of(FINE, {"frequency 1": 1e-7}), training_error=1e-3)
HIDDEN = 2.0
"""Stiffness of a slider that the data do not show, N per scale: it slips at 1.2 times their range."""
SOFTER_HZ = np.sqrt((2.0 * np.pi * JOINT.frequency_hz[0]) ** 2 - HIDDEN / 1e-3 * 0.9**2) / (2.0 * np.pi)
TRUTH = replace(
    one_mode(Jenkins(4.0, 0.3), Jenkins(HIDDEN, 1.2)),
    frequency_hz=np.array([SOFTER_HZ, JOINT.frequency_hz[1]]),
    damping_ratio=JOINT.damping_ratio * [JOINT.frequency_hz[0] / SOFTER_HZ, 1.0],
    steps=STEPS,
)


def sine(level, hz, seconds=4.0):
    """A force over that of the training data, from its first sample."""
    return level * FORCE_N * np.sin(2.0 * np.pi * hz * np.arange(round(seconds * RATE_HZ)) / RATE_HZ)


def last(model, force_n):
    """Outputs of the last quarter."""
    return model.simulate(force_n[None]).outputs[:, -force_n.size // 4 :]


@pytest.mark.parametrize(
    "laws", [(PolynomialSpring((0.0, 3.0)),), (PolynomialDamper((5.0,)),)], ids=["spring", "damper"]
)
def test_input_use_of_a_settled_sine_is_its_force_over_that_of_the_training_range(laws):
    model = one_mode(*laws)
    force_n = trained_force_n(model, 10.0, 60.0)

    def use(hz, n):
        return input_use(model, 1.5 * force_n * np.sin(2.0 * np.pi * hz * np.arange(n) / RATE_HZ), settled=True)

    near = max(np.arange(20.0, 45.0, 0.25), key=lambda hz: use(hz, 4000))
    found = {hz: use(hz, 20000) for hz in near + np.arange(-0.25, 0.3, 0.05)}
    assert max(found.values()) == pytest.approx(1.5, rel=0.01)
    (at_rest,) = model.simulate(1.5 * force_n * sine(1.0, max(found, key=found.__getitem__))[None] / FORCE_N).input_use
    assert at_rest == pytest.approx(1.5, rel=0.1)  # not settled yet, but nearly
    assert np.isnan(input_use(replace(model, elements=()), np.ones(100), settled=False))


def test_training_forces_that_drive_beyond_the_training_range_are_the_measure():
    model = one_mode(PolynomialSpring((0.0, 3.0)))
    force_n = sine(0.5, 26.0)
    own = input_use(model, force_n, settled=False)
    driven = replace(model, elements=(replace(model.elements[0], driven=2.0 * own),))
    expected = 0.5 if 2.0 * own > 1.0 else own
    assert input_use(driven, force_n, settled=False) == pytest.approx(expected)


def test_a_band_of_a_run_holds_a_joint_whose_other_slider_the_data_do_not_show():
    force_n = sine(1.5, 25.2)
    own, true = last(FINE, force_n), last(TRUTH, force_n)
    rms, peak, error = run_band(FIT, "sine", 1.5, own, lambda model: last(model, force_n))
    for (low, high), value in ((rms, np.sqrt(np.mean(true**2, axis=1))), (peak, np.max(np.abs(true), axis=1))):
        assert np.all((low <= value) & (value <= high))
    away = np.sqrt(np.mean((own - true) ** 2, axis=1) / np.mean(own**2, axis=1))
    assert np.all(away > 0.02)
    assert np.all(away <= error)


def test_a_run_that_is_beyond_what_the_data_say_is_refused():
    force_n = sine(2.3, 26.0)
    with refused(ExtrapolationError, "above-2-nothing-is-known-of-the-error"):
        run_band(FIT, "sine", 2.3, last(FINE, force_n), lambda model: last(model, force_n))
    with refused(ExtrapolationError, "models-that-fit-these-data-as-well-reach"):
        peak_band(
            FIT,
            "sweep",
            1.9,
            (1e-3, 25.0),
            0.01,
            lambda model: (1e-3 if len(model.elements[0].laws) == 1 else 3e-3, 25.0),
        )


def test_a_backbone_beyond_the_data_has_errors_that_hold_another_slider_or_is_refused():
    found, true = structured_mode(FIT, 1.3 * FORCE_N), structured_mode(TRUTH, 1.7 * FORCE_N)
    inside = structured_mode(FIT, 0.9 * FORCE_N)
    both = found.amplitude_m < true.amplitude_m.max()
    for name, of_std in (("modal_frequency_hz", "modal_frequency_std_hz"), ("damping_ratio", "damping_ratio_std")):
        own, std = getattr(found, name)[both], getattr(found, of_std)[both]
        there = np.interp(found.amplitude_m[both], true.amplitude_m, getattr(true, name))
        assert np.all(np.abs(own - there) <= 1.96 * std + 0.05 * own)  # between few points
        assert 1.96 * std[-1] > abs(own[-1] - there[-1]) > 1e-3 * own[-1]
    assert np.all(inside.modal_frequency_std_hz < 1e-4)
    with refused(ExtrapolationError, "above-2-nothing-is-known-of-the-error"):
        structured_mode(FIT, 2.3 * FORCE_N)
