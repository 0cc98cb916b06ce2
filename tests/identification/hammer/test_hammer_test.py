import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identification import Channel, HammerTest, IdentificationError, hammer_test, linear_modes
from identification.storage import decode, encode
from tests.identification.hammer.virtual import (
    CHANNELS,
    DAMPING,
    FAR,
    FREQUENCY_HZ,
    PULSE_S,
    RATE_HZ,
    SHAPES,
    blow,
    record,
)
from tests.refused import refused

TRUTH = np.concatenate([FREQUENCY_HZ, DAMPING, SHAPES.ravel()])
BAND = {"lowest_hz": 20.0, "highest_hz": 300.0}
CLEAN = [record(2.2, [(0.1 + 0.00013 * k, height)]) for k, height in enumerate((60.0, 80.0, 140.0, 50.0, 110.0, 90.0))]
RMS = np.sqrt(np.mean(CLEAN[1] ** 2, axis=1, keepdims=True))


def noisy(records, noise_db, seed):
    """The records with the same noise in all, so many dB below the RMS of the channels in one of them."""
    random = np.random.default_rng(seed)
    return [one + RMS * 10 ** (-noise_db / 20) * random.normal(size=one.shape) for one in records]


def accelerance(s):
    """complex[n, 2]: the structure's own transfer functions."""
    modes = [*zip(FREQUENCY_HZ, DAMPING, SHAPES.T, strict=True), FAR]
    parts = [
        s[:, None] ** 2 / (s[:, None] ** 2 + 2 * z * w * s[:, None] + w**2) * phi * phi[0]
        for w, z, phi in ((2 * np.pi * f, z, phi) for f, z, phi in modes)
    ]
    return np.sum(parts, axis=0)


def test_the_virtual_structure_moves_as_an_integrator_says():
    w, z, phi = 2 * np.pi * FREQUENCY_HZ[0], DAMPING[0], SHAPES[:, 0]
    force = lambda t: 80.0 * np.sin(np.pi * (t - 0.01) / PULSE_S) * (0.01 <= t < 0.01 + PULSE_S)  # noqa: E731
    others = [*zip(FREQUENCY_HZ, DAMPING, SHAPES.T, strict=True), FAR]
    omega = 2 * np.pi * np.array([f for f, _, _ in others])
    zeta, shapes = np.array([z for _, z, _ in others]), np.array([phi for _, _, phi in others]).T
    assert (omega[0], zeta[0], shapes[0, 0]) == (w, z, phi[0])

    def slope(t, state):
        q, v = state[:4], state[4:]
        return np.concatenate([v, shapes[0] * force(t) - 2 * zeta * omega * v - omega**2 * q])

    instants = np.linspace(0.0, 0.1, 401)
    exact = solve_ivp(slope, (0.0, 0.1), np.zeros(8), "DOP853", instants, rtol=1e-10, atol=1e-13, max_step=1e-4)
    motion = shapes @ np.array([slope(t, y)[4:] for t, y in zip(instants, exact.y.T, strict=True)]).T
    np.testing.assert_allclose(blow(instants, 0.01, 80.0)[1:], motion, atol=1e-5 * np.abs(motion).max())


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_without_noise_responses_are_the_transfer_functions_beside_the_imaginary_axis(estimator):
    found = hammer_test(CLEAN, CHANNELS, RATE_HZ, estimator=estimator, **BAND)
    assert len(found.used) == len(CLEAN)
    assert found.responses.decay_rate_1_s > 1.0  # the first mode needs seven times the record to die away
    exact = accelerance(found.responses.s)
    np.testing.assert_allclose(found.responses.value[:, :, 0], exact, atol=2e-4 * np.abs(exact).max())
    assert found.coherence.min() > 0.999


@pytest.mark.parametrize("rate_1_s", [3.0, 6.0, 15.0])
def test_the_damping_of_the_exponential_window_is_not_in_the_modes(rate_1_s):
    found = hammer_test(CLEAN, CHANNELS, RATE_HZ, decay_rate_1_s=rate_1_s, **BAND)
    modes = linear_modes(found.responses)
    added = rate_1_s / (2 * np.pi * FREQUENCY_HZ)
    assert np.abs(modes.damping_ratio - DAMPING).max() < 1e-3 * added.max()
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ, rtol=1e-5)
    np.testing.assert_allclose(modes.shapes, SHAPES, rtol=1e-3)


@pytest.mark.parametrize(("noise_db", "frequency", "damping"), [(60, 1e-6, 3e-4), (40, 1e-5, 3e-3), (20, 1e-4, 2e-2)])
def test_modes_are_right_and_their_intervals_hold_them(noise_db, frequency, damping):
    inside, errors = [], []
    for seed in range(8):
        modes = linear_modes(hammer_test(noisy(CLEAN, noise_db, seed), CHANNELS, RATE_HZ, **BAND).responses)
        found = np.concatenate([modes.frequency_hz, modes.damping_ratio, modes.shapes.ravel()])
        errors.append(found / TRUTH - 1.0)
        inside.append(np.abs(found - TRUTH) < 1.96 * np.sqrt(np.diag(modes.covariance)))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert rms[:3].max() < frequency
    assert rms[3:6].max() < damping
    assert np.mean(inside) >= 0.85


def test_relative_weights_keep_the_errors_of_the_hits():
    responses = hammer_test(noisy(CLEAN, 40, 4), CHANNELS, RATE_HZ, **BAND).responses
    modes, relative = (linear_modes(responses, weighting=weighting) for weighting in ("total", "relative"))
    assert np.all(np.abs(relative.damping_ratio - DAMPING) < 3.0 * relative.damping_ratio_std)
    assert np.all(relative.damping_ratio_std > 0.7 * modes.damping_ratio_std)


def test_several_hits_in_one_record_are_found_and_each_has_its_own_window():
    hits = [(0.3, 60.0), (6.9, 90.0), (13.4, 75.0)]
    found = hammer_test([record(16.0, hits, noise_db=50)], CHANNELS, RATE_HZ, record_s=2.2, pretrigger_s=0.1, **BAND)
    assert [round(hit.time_s, 2) for hit in found.used] == [at for at, _ in hits]
    assert [hit.peak_n for hit in found.used] == pytest.approx([height for _, height in hits], rel=0.03)
    assert found.record_s == pytest.approx(2.2, abs=1.0 / RATE_HZ)
    modes = linear_modes(found.responses)
    np.testing.assert_allclose(modes.frequency_hz, FREQUENCY_HZ, rtol=1e-4)
    np.testing.assert_allclose(modes.damping_ratio, DAMPING, rtol=0.02)


def test_hits_while_the_structure_still_moves_are_left_out():
    early = record(2.2, [(0.1, 90.0)])
    ringing = record(3.2, [(0.1, 90.0), (1.1, 90.0)])[:, round(1.0 * RATE_HZ) :]
    found = hammer_test([*CLEAN, early, ringing], CHANNELS, RATE_HZ, **BAND)
    assert [hit.fault[:12] for hit in found.hits] == [""] * 7 + ["still moving"]


@pytest.mark.parametrize("noise_db", [20, 40, 60])
def test_every_double_hit_is_found_and_no_single_one_called_so(noise_db):
    for number, (share, delay_s) in enumerate(
        [(0.05, 0.03), (0.1, 0.009), (0.2, 0.006), (0.4, 0.015), (0.8, 0.15), (1.2, 0.06)]
    ):
        double = record(2.2, [(0.1, 90.0), (0.1 + delay_s, 90.0 * share)])
        found = hammer_test(noisy([*CLEAN[:3], double, *CLEAN[3:]], noise_db, number), CHANNELS, RATE_HZ, **BAND)
        assert [hit.fault[:10] for hit in found.hits] == ["", "", "", "double hit", "", "", ""]


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("noise_db", [20, 60])
def test_overloads_are_found_with_and_without_the_full_scale(channel, noise_db):
    records = noisy([*CLEAN[:2], record(2.2, [(0.1, 120.0)]), *CLEAN[2:]], noise_db, 7)
    limit = 0.75 * np.abs(records[2][channel]).max()
    records[2][channel] = np.clip(records[2][channel], -limit, limit)
    records[3] = records[3] * 0.5  # the others stay below the limit
    assert max(np.abs(one[channel]).max() for one in (*records[:2], records[3])) < limit
    for full_scale in ({}, {CHANNELS[channel].name: limit}):
        found = hammer_test([*records[:4], *records[5:]], CHANNELS, RATE_HZ, full_scale=full_scale, **BAND)
        assert [hit.fault[:8] for hit in found.hits][:4] == ["", "", "overload", ""]


def test_numbers_of_a_coarse_converter_are_no_overload():
    step = np.array([[0.05], [2.0], [2.0]])
    coarse = [np.round(one / step) * step for one in CLEAN]
    assert all(not hit.fault for hit in hammer_test(coarse, CHANNELS, RATE_HZ, **BAND).hits)


def test_noise_in_the_force_biases_h1_low_and_noise_in_the_motion_h2_high():
    at = int(np.argmin(np.abs(FREQUENCY_HZ[1] - hammer_test(CLEAN, CHANNELS, RATE_HZ, **BAND).responses.frequency_hz)))
    random = np.random.default_rng(3)
    many = [CLEAN[k % 6] + np.array([[4.0], [0.0], [0.0]]) * random.normal(size=CLEAN[0].shape) for k in range(60)]
    sizes = {}
    for estimator in ("H1", "H2", "Hv"):
        found = hammer_test(many, CHANNELS, RATE_HZ, estimator=estimator, force_window_s=0.2, trigger_n=35.0, **BAND)
        sizes[estimator] = np.abs(found.responses.value[at - 20 : at + 20, 0, 0])
        exact = np.abs(accelerance(found.responses.s)[at - 20 : at + 20, 0])
    np.testing.assert_allclose(sizes["Hv"], np.sqrt(sizes["H1"] * sizes["H2"]), rtol=1e-9)
    assert np.mean(sizes["H1"] / exact) < np.mean(sizes["Hv"] / exact) < np.mean(sizes["H2"] / exact)
    assert np.mean(sizes["H1"] / exact) < 0.995
    assert np.mean(sizes["H2"] / exact) == pytest.approx(1.0, abs=0.02)


def test_arrays_and_attributes_bring_it_back():
    found = hammer_test(noisy(CLEAN, 40, 1), CHANNELS, RATE_HZ, specimen="plate", **BAND)
    again = decode(HammerTest, *encode(found))
    assert again.hits == found.hits
    assert again.responses.decay_rate_1_s == found.responses.decay_rate_1_s
    np.testing.assert_array_equal(again.responses.deviations, found.responses.deviations)
    np.testing.assert_array_equal(again.coherence, found.coherence)
    arrays, attributes = encode(found)
    with refused(IdentificationError, "hits-is-missing", where="hammer test"):
        decode(HammerTest, arrays, {name: value for name, value in attributes.items() if name != "hits"})


def test_deviations_make_the_total_covariance():
    responses = hammer_test(noisy(CLEAN, 40, 2), CHANNELS, RATE_HZ, **BAND).responses
    e, count = responses.deviations, len(CLEAN)
    np.testing.assert_allclose(np.sum(e, axis=1), 0.0, atol=1e-10 * np.abs(responses.value).max())
    expected = np.einsum("kri,krj->kij", e, np.conj(e)) * count / (count - 1)
    np.testing.assert_allclose(responses.total_covariance, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"records": []}, {"says": "empty", "field": "records"}),
        ({"records": [CLEAN[0][:2]]}, {"says": "shape", "field": "records[0]", "allowed": "3 channels by samples"}),
        ({"records": [CLEAN[0]]}, {"says": "of-count", "field": "hits", "allowed": "two at least (no faults)"}),
        ({"records": [np.zeros((3, 4000)) + 1e-3]}, {"says": "no-hit-above-2", "field": "force"}),
        ({"records": [-one for one in CLEAN]}, {"says": "force-no-hit-above-polarity-hits", "field": "hits"}),
        ({"trigger_n": 1000.0}, {"says": "no-hit-above", "field": "force"}),
        ({"trigger_n": -1.0}, {"field": "trigger_n"}),
        ({"record_s": 0.01}, {"says": "record-of-hit-has-samples", "field": "record_s"}),
        ({"record_s": 9.0}, {"says": "cut-short-until-the-next-hit", "field": "hits"}),
        ({"decay_rate_1_s": -1.0}, {"field": "decay_rate_1_s", "value": -1.0}),
        ({"full_scale": {"hamer": 10.0}}, {"says": "hamer-is-none-of-the-channels", "field": "full_scale"}),
        ({"estimator": "H3"}, {"field": "estimator", "value": "H3", "allowed": "H1, H2, Hv"}),
        ({"lowest_hz": 200.0, "highest_hz": 200.1}, {"says": "lines-in-to-hz", "field": "lowest_hz, highest_hz"}),
        (
            {"channels": (*CHANNELS[1:], Channel("x", "response", "m/s2"))},
            {"says": "have-the-role-force", "field": "channels"},
        ),
    ],
)
def test_what_cannot_be_evaluated_is_named(change, message):
    arguments = {"records": CLEAN, "channels": CHANNELS, "sample_rate_hz": RATE_HZ, **BAND, **change}
    with refused(IdentificationError, **message):
        hammer_test(arguments.pop("records"), arguments.pop("channels"), arguments.pop("sample_rate_hz"), **arguments)
