"""Steady vibrations of the virtual rig itself, with which predictions are compared."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rig.analysis.subject import subject_of
from simulators import VirtualRig
from simulators.analysis import (
    PeriodicResponses,
    constant_force_response,
    forced_response,
    phase_resonance_backbone,
)
from studies.reproduce.options import Options

Held = Literal["fundamental", "pure-sine", "voltage"]

_NEAR_RESONANCE = np.linspace(-170.0, -10.0, 81)
_FREQUENCIES = 81


@dataclass(frozen=True, eq=False)
class Truth:
    """Resonance of the rig at one level of the held quantity."""

    held: Held
    """Held quantity: ``pure-sine`` (force without harmonics), ``fundamental`` (of a force with the exciter's harmonics) or
    ``voltage`` (a sine)."""
    level: float
    """Peak of the held quantity, N or V."""
    force_n: float
    """Force of the campaign to which the level belongs. For a voltage, it is the rig's force at resonance at this voltage."""
    responses: PeriodicResponses
    """Responses through resonance; for a pure sine, the backbone up to this force."""
    amplitude_m: float
    """Largest amplitude of the drive point, m."""
    frequency_hz: float
    """Frequency of the largest amplitude, Hz."""

    @classmethod
    def of(cls, held: Held, level: float, force_n: float, responses: PeriodicResponses) -> "Truth":
        """Create the truth, with the largest amplitude among the responses."""
        top = int(np.argmax(responses.amplitude_m))
        peak = float(responses.amplitude_m[top]), float(responses.frequency_hz[top])
        return cls(held, level, force_n, responses, *peak)

    @property
    def text(self) -> str:
        """Level as text for tables."""
        return f"{self.level:.3g} {'V' if self.held == 'voltage' else 'N'}"


def truths(options: Options) -> tuple[Truth, ...]:
    """Return the true responses that models with this input can predict.

    For each force these are the responses to a pure sine or at a voltage, and the response at constant fundamental.
    """
    rig = subject_of(options.bench).rig
    return tuple(one for force_n in options.specimen.forces_n for one in _at(options, rig, force_n))


def _at(options: Options, rig: VirtualRig, force_n: float) -> tuple[Truth, ...]:
    held = Truth.of("fundamental", force_n, force_n, constant_force_response(rig, force_n, _NEAR_RESONANCE))
    if options.input == "force":
        # With light damping the largest amplitude is that at phase resonance.
        forces = np.linspace(0.1, 1.0, 10) * force_n
        sine = phase_resonance_backbone(rig, forces_n=forces, excitation="pure-sine")
        return Truth.of("pure-sine", force_n, force_n, sine), held
    voltage_v = float(held.responses.voltage_v[int(np.argmax(held.responses.amplitude_m))])
    low, high = options.specimen.band_hz
    under = forced_response(rig, voltage_v, np.linspace(low, high, _FREQUENCIES))
    return Truth.of("voltage", voltage_v, force_n, under), held
