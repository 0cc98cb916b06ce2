"""The emulated sound card behind the stand-in for PortAudio: driver, callback and card as over JACK, without a clock."""

import sys
from contextlib import contextmanager

import numpy as np

from rig.drivers.sound import stream as streams
from rig.emulator.plant import VirtualPlant
from rig.emulator.sound import NAME, PERIOD, RATE_HZ, Card, card_bench, reaching_bench
from rig.loop.worker import spawn
from tests.rig.drivers.sound.card import Card as Stand

PERIODS = 2
"""Periods between output and input in the graph of a JACK server."""


class Port:
    """A port of a JACK client."""

    def __init__(self):
        self.samples = np.zeros(PERIOD, np.float32)

    def get_array(self):
        return self.samples


class Client:
    """A JACK client whose periods are called by hand: the first port is its input."""

    samplerate, blocksize = RATE_HZ, PERIOD

    def __init__(self):
        self.ports = []
        self.inports = self.outports = self

    def register(self, _name):
        self.ports.append(Port())
        return self.ports[-1]

    def set_process_callback(self, callback):
        self.callback = callback

    def set_shutdown_callback(self, _callback):
        """It never ends."""

    def set_xrun_callback(self, _callback):
        pass

    def period(self, sent):
        """Readings [n, channels] of the card for outputs [n], both in full scales."""
        self.ports[0].samples[:] = sent
        self.callback(PERIOD)
        return np.stack([port.samples for port in self.ports[1:]], axis=1)


class Behind(Stand):
    """The stand-in for PortAudio with an emulated card as its device."""

    def __init__(self, bench, high_pass_hz=(), cables=False):
        self.plant = VirtualPlant(card_bench(bench, float(RATE_HZ)))
        super().__init__((1.0,) * len(self.plant.names), PERIODS * PERIOD, NAME, (float(RATE_HZ),), 1)
        self.client = Client()
        self.card = Card(self.client, self.plant, high_pass_hz, cables)
        self.bench = reaching_bench(
            bench,
            {
                "device": NAME,
                "output_full_scale_v": self.plant.output_range_v,
                "input_full_scale_v": self.plant.range_v.tolist(),
                "device_rate_hz": float(RATE_HZ),
                "period_frames": PERIOD,
                "queue_blocks": 4,
            },
        )

    def readings(self, sent):
        self.put_out = self.put_out[-self.delay :]
        read = self.client.period(sent)
        if self.card.failure is not None:
            raise self.card.failure
        return read

    @property
    def output(self):
        return 0


@contextmanager
def sound_card(monkeypatch, bench, high_pass_hz=(), cables=False):
    """An emulated card in this computer; gives the bench that reaches it. Its loop runs in this process."""
    with monkeypatch.context() as patch:
        card = Behind(bench, high_pass_hz, cables)
        patch.setitem(sys.modules, "sounddevice", card)
        patch.setattr(streams, "time", card)
        patch.setattr(spawn, "supported", lambda: False)
        yield card.bench
