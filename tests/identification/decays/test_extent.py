"""The beginning of a free decay and its end are found."""

import numpy as np
import pytest

from identification import Channel, IdentificationError, decay_backbone
from tests.identification.decays.signals import DRIVE, linear
from tests.refused import refused

RATE_HZ, DAMPING = 1280.0, 0.004


def held_then_free(before_s=3.0, after_s=6.0, noise=1e-3):
    """A vibration of constant amplitude that decays from ``before_s`` on."""
    rng = np.random.default_rng(1)
    t = np.arange(int(before_s * RATE_HZ)) / RATE_HZ
    held = np.cos(2.0 * np.pi * 20.0 * (t - before_s))
    free = linear(DAMPING, after_s, RATE_HZ, phase=0.0)
    x = np.concatenate([held, free])
    return x + noise * rng.normal(size=x.size)


def test_a_decay_begins_where_the_vibration_begins_to_fall():
    mode = decay_backbone([held_then_free()], DRIVE, sample_rate_hz=RATE_HZ).mode()
    assert 3.0 <= mode.start_s < 3.6
    np.testing.assert_allclose(mode.damping_ratio[:8], DAMPING, rtol=0.03)


def test_a_decay_begins_where_the_force_ends():
    x = held_then_free()
    force = np.where(
        np.arange(x.size) < 3.0 * RATE_HZ, 5.0 * np.sin(2.0 * np.pi * 20.0 * np.arange(x.size) / RATE_HZ), 0.0
    )
    force += 0.01 * np.random.default_rng(2).normal(size=x.size)
    channels = [Channel("force", "force", "N"), *DRIVE]
    mode = decay_backbone([force, x], channels, sample_rate_hz=RATE_HZ).mode()
    assert 2.999 <= mode.start_s - 2.0 / 20.0 < 3.02  # half a window later
    np.testing.assert_allclose(mode.damping_ratio[:8], DAMPING, rtol=0.03)


def test_a_hammer_blow_is_not_part_of_the_decay():
    rng = np.random.default_rng(4)
    rest, free = np.zeros(int(1.0 * RATE_HZ)), linear(DAMPING, 6.0, RATE_HZ, phase=-np.pi / 2.0)
    force = np.concatenate([rest, np.zeros(free.size)])
    blow = int(1.0 * RATE_HZ)
    force[blow - 3 : blow + 3] = 200.0 * np.hanning(6)
    x = np.concatenate([rest, free]) + 1e-3 * rng.normal(size=force.size)
    found = decay_backbone(
        [force + 0.05 * rng.normal(size=force.size), x],
        [Channel("hammer", "force", "N"), *DRIVE],
        sample_rate_hz=RATE_HZ,
    ).mode()
    assert 1.0 <= found.start_s < 1.3
    np.testing.assert_allclose(found.damping_ratio[:8], DAMPING, rtol=0.03)


def test_a_decay_ends_at_the_noise():
    x = linear(DAMPING, 30.0, RATE_HZ) + 1e-3 * np.random.default_rng(5).normal(size=int(30.0 * RATE_HZ))
    mode = decay_backbone([x], DRIVE, sample_rate_hz=RATE_HZ).mode()
    reached = np.exp(-DAMPING * 2.0 * np.pi * 20.0 * mode.stop_s)
    assert 2.0 * mode.floor_m < reached < 8.0 * mode.floor_m
    assert mode.floor_m < 5e-4  # the window leaves less noise than a sample has


def test_a_given_beginning_and_end_are_used():
    x = linear(DAMPING, 8.0, RATE_HZ)
    mode = decay_backbone([x], DRIVE, sample_rate_hz=RATE_HZ, start_s=1.0, stop_s=4.0).mode()
    assert mode.start_s >= 1.0
    assert mode.stop_s <= 4.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_s": 99.0}, {"says": "the-record-goes-from-to", "field": "start_s", "value": 99.0}),
        ({"near_hz": 50.0}, {"says": "no-vibration-near-hz-not-above", "field": "near_hz"}),
        ({"near_hz": 700.0}, {"says": "the-spectrum-ends-at-hz", "field": "near_hz", "value": 700.0}),
        ({"near_hz": -1.0}, {"field": "near_hz"}),
        ({"number": 0}, {"field": "number", "value": 0}),
        ({"drive_mode_shape": 0.0}, {"field": "drive_mode_shape", "value": 0.0}),
        ({"stop_s": 0.02}, {"field": "start_s, stop_s"}),
    ],
)
def test_wrong_arguments_are_named(changes, message):
    x = linear(DAMPING, 8.0, RATE_HZ) + 1e-4 * np.random.default_rng(0).normal(size=int(8.0 * RATE_HZ))
    with refused(IdentificationError, **message):
        decay_backbone([x], DRIVE, sample_rate_hz=RATE_HZ, **changes)


@pytest.mark.parametrize(
    ("samples", "channels", "message"),
    [
        (np.zeros((1, 5000)), DRIVE, {"says": "no-motion-channel-moves", "field": "samples"}),
        (np.ones((2, 5000)), DRIVE, {"says": "for-channels", "field": "samples"}),
        (np.full((1, 5000), np.nan), DRIVE, {"field": "samples", "allowed": "finite"}),
        (np.zeros((1, 5000)), [Channel("f", "force", "N")], {"says": "none-is-motion", "field": "channels"}),
        (np.random.default_rng(0).normal(size=(1, 20000)), DRIVE, {"field": "samples"}),
    ],
)
def test_records_without_a_decay_are_refused(samples, channels, message):
    with refused(IdentificationError, **message):
        decay_backbone(samples, channels, sample_rate_hz=RATE_HZ)
