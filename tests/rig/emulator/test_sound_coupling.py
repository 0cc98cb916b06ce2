"""High-passes of an emulated sound card, a calibration through its cables, and a phase-locked test with what it has found."""

from functools import cache

import numpy as np
import pytest

import rig
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.emulator.settings import EmulatorSettings
from rig.emulator.sound import PERIOD, RATE_HZ, card_bench
from rig.errors import ConfigurationError
from tests.refused import refused
from tests.rig.emulator.calibrating import (
    AT_HZ,
    CORNERS_HZ,
    calibrated,
    latency_frames,
    phases_deg,
    plan,
    require_harmonic_balance,
    true_phase_deg,
)
from tests.rig.emulator.sound_without_clock import PERIODS, Behind, sound_card
from tests.rig.rigs import bench_with


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """What a calibration through these high-passes finds, and the bench that it writes: made once."""

    def made(corners_hz):
        with pytest.MonkeyPatch.context() as patch, sound_card(patch, bench_with(), corners_hz, cables=True) as bench:
            return calibrated(bench, tmp_path_factory.mktemp("card"))

    return cache(made)


@pytest.mark.parametrize("corners_hz", [(), (5.0,), CORNERS_HZ])
def test_an_output_passes_both_high_passes_of_its_cable(corners_hz):
    card = Behind(bench_with(), corners_hz, cables=True)
    at = np.arange(3 * RATE_HZ // PERIOD * PERIOD) / RATE_HZ
    sent = 0.1 * np.sin(2.0 * np.pi * 25.0 * at)
    read = np.concatenate([card.client.period(part) for part in sent.reshape(-1, PERIOD)])
    last = slice(2 * RATE_HZ, 3 * RATE_HZ - RATE_HZ // 25)
    turn = np.exp(-2j * np.pi * 25.0 * at[last])
    found = np.degrees(np.angle(turn @ read[last] / (turn @ sent[last])))
    delay = 0.5 + VirtualDAQ(card_bench(bench_with(), float(RATE_HZ))).rig.filter_delay_samples
    each = np.broadcast_to(corners_hz or 0.0, 6)
    true = [true_phase_deg(each[0], 25.0) + true_phase_deg(corner, 25.0) for corner in each[1:]]
    assert found + 360.0 * 25.0 * delay / RATE_HZ == pytest.approx(true, abs=0.01)


def test_the_rig_s_own_channels_pass_them_too():
    still, coupled = Behind(bench_with()), Behind(bench_with(), (5.0,))
    for card in (still, coupled):
        card.read = np.concatenate([card.client.period(np.full(PERIOD, 0.01)) for _ in range(400)])
    assert abs(still.read[-1, -1]) == pytest.approx(0.01, rel=1e-3)
    assert np.abs(coupled.read[-100:, -1]).max() < 1e-4


def test_corners_are_one_or_each():
    with refused(ConfigurationError, field="high_pass_hz"):
        Behind(bench_with(), (5.0, 2.0))


def test_a_wire_has_neither_cables_nor_high_passes():
    for field, value in {"cables": True, "high_pass_hz": [5.0]}.items():
        with refused(ValueError, "is-for-a-sound-card", field=field):
            EmulatorSettings.model_validate({"wire": "serial", "bench": bench_with(), field: value})


@pytest.mark.slow
@pytest.mark.parametrize("corners_hz", [(2.0,), (10.0,), CORNERS_HZ])
def test_phases_between_channels_are_right_after_a_calibration(monkeypatch, calibration, corners_hz):
    found, calibrated_bench = calibration(corners_hz)
    with sound_card(monkeypatch, bench_with(), corners_hz, cables=True) as bench:
        before = phases_deg(bench)
        after = phases_deg(calibrated_bench)
        with make_daq(calibrated_bench) as daq:
            daq.start(calibrated_bench.block)
            latency = latency_frames(daq)
    assert np.abs(after).max() < 0.2
    if corners_hz == CORNERS_HZ:
        true = [[true_phase_deg(c, f) - true_phase_deg(CORNERS_HZ[-1], f) for c in CORNERS_HZ[1:-1]] for f in AT_HZ]
        assert before == pytest.approx(np.array(true), abs=0.1)
        assert [one.high_pass_hz for one in found.paths.inputs] == pytest.approx(CORNERS_HZ[1:], abs=0.05)
        assert found.paths.output_high_pass_hz == pytest.approx(CORNERS_HZ[0], abs=0.05)
    filters = VirtualDAQ(card_bench(bench_with(), float(RATE_HZ))).rig.filter_delay_samples
    assert latency == pytest.approx(PERIODS * PERIOD + 0.5 + filters, abs=0.1)


@pytest.mark.slow
def test_a_locked_test_through_high_passes_keeps_to_harmonic_balance(monkeypatch, calibration):
    _, bench = calibration(CORNERS_HZ)
    with sound_card(monkeypatch, bench_with(), CORNERS_HZ), rig.run(plan(), bench=bench, seed=5) as run:
        assert run.complete
        points = list(run.recording.latest.values())
    require_harmonic_balance(points)
