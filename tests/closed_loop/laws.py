"""Controllers of the second generation for both specimens, plans and runs with them, and a knock on the specimen."""

import math
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from controller import AmplitudeLaw, PhaseLockedLoop
from rig.bench import Bench
from rig.campaigns.backbone.plan import BackbonePlan
from rig.drivers import make_daq
from rig.drivers.virtual.driver import VirtualDAQ
from rig.loop.loop import Loop
from rig.tick.sequencer.segments import Segment, SettleRule
from rig.tick.tick import Tick, TickSettings

FREQUENCY_HZ = {"magnet-beam": 24.37, "friction-beam": 149.0}
POLE_RAD_S = {"magnet-beam": (-11.5, 3.9), "friction-beam": (-5.8, -24.2)}
SHARE = {"magnet-beam": 8.0, "friction-beam": 12.0}


def table_of(specimen: str, **changes: Any) -> dict[str, Any]:
    """`[controller]`: frequency error and complex response control with the gains of the documents."""
    frequency_hz = FREQUENCY_HZ[specimen]
    low_pass = 2 * math.pi * frequency_hz / 5
    return {
        "detector": "adaptive",
        "low_pass_rad_s": low_pass,
        "frequency_law": "frequency-error",
        "frequency_integral_per_s": low_pass / SHARE[specimen],
        "centre_frequency_hz": frequency_hz,
        "frequency_window_hz": (0.9 * frequency_hz, 1.1 * frequency_hz),
        "force_loop": "through-response",
        "response_integral_per_s": low_pass / 4,
        "plant_pole_rad_s": POLE_RAD_S[specimen],
        "reference_integral_per_s": low_pass / 12,
    } | changes


def law_of(specimen: str, **changes: Any) -> PhaseLockedLoop:
    """The same as a law."""
    return PhaseLockedLoop.model_validate(table_of(specimen, **changes))


def plan_of(specimen: str, controller: dict[str, Any] | None = None, **changes: Any) -> BackbonePlan:
    """A short backbone with it."""
    table = {"bench": specimen, "controller": table_of(specimen, **(controller or {})), "record_periods": 20}
    return BackbonePlan.model_validate(table | {"ramp_periods": 10} | changes)


def carried_out(
    bench: Bench, law: PhaseLockedLoop, segments: list[Segment], settle: SettleRule | None = None, seed: int = 0
) -> tuple[np.ndarray, Tick]:
    """All rows of a run, and its tick at the end."""
    with make_daq(bench, seed) as daq:
        daq.start(bench.block)
        lead = bench.block + daq.latency_samples
        tick = Tick(TickSettings(bench, law, AmplitudeLaw.VOLTAGE, settle or SettleRule(), segments), lead)
        return np.concatenate(list(Loop(daq, tick).run())), tick


def knock(monkeypatch: Any, mode: int, at_s: float, change: float, length_s: float = 0.02) -> None:
    """From now on every run gets a knock: the modal velocity of a mode (kg^1/2 m/s) is changed over a short time."""
    exchange = VirtualDAQ._exchange
    samples = WeakKeyDictionary[Any, int]()

    def knocked(self: Any, voltages: np.ndarray, inputs: np.ndarray) -> None:
        now = samples.get(self, 0) / self.sample_rate_hz
        samples[self] = samples.get(self, 0) + len(inputs)
        if at_s <= now < at_s + length_s:
            self._state.inputs[self.rig.plant.n_mode + mode] += change * len(inputs) / self.sample_rate_hz / length_s
        exchange(self, voltages, inputs)

    monkeypatch.setattr("rig.loop.session.Loop", partial(Loop, fused=False))
    monkeypatch.setattr(VirtualDAQ, "_exchange", knocked)
