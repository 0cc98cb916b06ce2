"""The driver of sound devices under the contract, over a card without a clock."""

import sys

import numpy as np
import pytest

from rig.bench import Bench
from rig.conformance import DriverContract
from rig.daq import DAQ, Capabilities
from rig.drivers.sound import stream as streams
from rig.drivers.sound.driver import SoundDAQ
from rig.drivers.sound.rates import Decimator, Interpolator, factor_of
from tests.rig.drivers.sound.card import RATE_HZ, Card
from tests.rig.drivers.sound.test_sound import bench

GAIN = 1.0
"""Of every input: what a cable reads is what was put out."""


class Harmless(SoundDAQ):
    """A card on whose output nothing can move, so that its whole range is tried."""

    @property
    def capabilities(self) -> Capabilities:
        return super().capabilities.model_copy(update={"virtual": True})


class OverACard(DriverContract):
    """Time goes on when the driver sleeps, and when the host pauses."""

    bench: Bench
    long_run_blocks = 2200
    late_blocks = 500
    message_s = 0.1

    @pytest.fixture(autouse=True)
    def _card(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.card = Card(gains=(GAIN, GAIN, GAIN))
        monkeypatch.setitem(sys.modules, "sounddevice", self.card)
        monkeypatch.setattr(streams, "time", self.card)

    def make(self) -> DAQ:
        return Harmless(self.bench)

    def bench_for_another_process(self) -> Bench:
        return self.bench

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray:
        factor = factor_of(RATE_HZ, self.bench.sample_rate_hz)
        sent = Interpolator(factor)(outputs)
        late = np.concatenate((np.zeros(self.card.delay), sent))[: sent.size]
        return np.asarray(Decimator(factor, 3)(GAIN * np.repeat(late[:, None], 3, axis=1)))

    def now_s(self, daq: DAQ) -> float:
        return self.card.now_s

    def pause(self, daq: DAQ, seconds: float) -> None:
        for _ in range(round(seconds * RATE_HZ / 128)):
            self.card.period()

    def unplug(self, daq: DAQ) -> bool:
        self.card.fault = "unplugged"
        return True

    def witness(self, daq: DAQ | None) -> float | None:
        return float(np.abs(self.card.put_out[-1]).max()) * 10.0 if self.card.put_out.size else 0.0


class TestAtTheDevicesRate(OverACard):
    blocks = (1, 10, 128)
    long_run_blocks = 600  # as many samples as of the other class
    bench = bench(queue_blocks="auto")


class TestDecimated(OverACard):
    blocks = (1, 4, 32)
    bench = bench(12000.0, 32, queue_blocks="auto")


del DriverContract, OverACard
