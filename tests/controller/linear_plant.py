"""The harmonics loop on a plant that is linear in every harmonic, sample by sample as the tick runs it."""

import math
from typing import Any

import numpy as np

from controller.adaptive_filter import MOST_HARMONICS
from controller.harmonics.law import drive_harmonics, harmonics_at, measure_harmonics, want_harmonics
from controller.harmonics.periods import end_harmonics_period
from controller.harmonics.records import HARMONICS_STATE, HarmonicStage
from controller.harmonics.settings import HarmonicsSettings, harmonic_ratios
from vibrolock.compiled import kernel

PER_PERIOD = 200
RATE_HZ = 5000.0
OMEGA = 2.0 * math.pi * RATE_HZ / PER_PERIOD
LARGEST_V = 5.0


@kernel
def run_samples(
    parameters: np.ndarray,
    states: np.ndarray,
    plant: np.ndarray,
    disturbance: np.ndarray,
    noise: np.ndarray,
    amplitudes_v: np.ndarray,
    switches: np.ndarray,
    outputs_v: np.ndarray,
    forces_n: np.ndarray,
    estimates_n: np.ndarray,
    volts: np.ndarray,
    stages: np.ndarray,
) -> None:
    """Run whole periods from phase 0 on: one row a sample. ``switches``: locked, steady, free, running, acts."""
    p, s = parameters[0], states[0]
    locked, steady, free, running, acts = switches
    for n in range(noise.size):
        theta = 2.0 * math.pi * (n % PER_PERIOD) / PER_PERIOD
        phasor = complex(math.cos(theta), math.sin(theta))
        value, turn = disturbance[0].real + noise[n], complex(1.0, 0.0)
        for order in range(1, MOST_HARMONICS + 1):
            turn *= phasor
            force = disturbance[order]
            if order > 1:
                force += plant[order] * s.share * s.volts[order]
            forces_n[n, order] = force
            value += (force * turn).real
        measure_harmonics(p, s, value, phasor, OMEGA)
        if n % PER_PERIOD == PER_PERIOD - 1:
            end_harmonics_period(p, s, amplitudes_v[n], locked == 1, steady == 1, free == 1)
        drive_harmonics(p, s, amplitudes_v[n], OMEGA, running == 1, acts == 1)
        outputs_v[n] = amplitudes_v[n] * phasor.real + harmonics_at(p, s, theta)
        for order in range(2, MOST_HARMONICS + 1):
            estimates_n[n, order] = s.filter[order]
            volts[n, order] = s.volts[order]
        estimates_n[n, 1] = s.filter[1]
        stages[n] = s.stage


class Plant:
    """A loop and its plant; `run` goes on where it left off."""

    def __init__(
        self,
        plant: complex | dict[int, complex] = 1.0,
        disturbance: dict[int, complex] | None = None,
        *,
        smallest: float = 1e-9,
        step_v: float = LARGEST_V,
        noise: float = 0.0,
        seed: int = 0,
        **settings: Any,
    ) -> None:
        self.settings = HarmonicsSettings.model_validate(settings)
        self.parameters = self.settings.build_harmonics(RATE_HZ, LARGEST_V)
        self.parameters["smallest"], self.parameters["step_v"] = smallest, step_v
        self.state = np.zeros(1, HARMONICS_STATE)
        self.state["miss"] = math.inf
        self.plant = np.ones(MOST_HARMONICS + 1, complex)
        self.plant[2:] = 0.0
        orders = range(2, MOST_HARMONICS + 1)
        for order, value in (plant if isinstance(plant, dict) else dict.fromkeys(orders, plant)).items():
            self.plant[order] = value
        self.disturbance = np.zeros(MOST_HARMONICS + 1, complex)
        self.disturbance[1] = 1.0
        for order, value in (disturbance or {}).items():
            self.disturbance[order] = value
        self.noise, self.draw = noise, np.random.default_rng(seed)
        self.want(self.settings.wanted)

    def want(self, wanted: dict[int, tuple[float, float]]) -> None:
        """Prescribe harmonics."""
        want_harmonics(self.state[0], harmonic_ratios(wanted))

    def run(
        self,
        periods: int,
        amplitude_v: float | np.ndarray = 1.0,
        *,
        locked: bool = True,
        steady: bool = True,
        free: bool = True,
        running: bool = True,
        acts: bool = True,
    ) -> "Plant":
        """Run some periods; rows of the last call are kept."""
        n = periods * PER_PERIOD
        amplitudes = np.ascontiguousarray(np.broadcast_to(amplitude_v, n), dtype=float)
        shape = (n, MOST_HARMONICS + 1)
        self.output_v, self.stages = np.zeros(n), np.zeros(n, np.int64)
        self.force_n, self.estimate_n, self.volts = (np.zeros(shape, complex) for _ in range(3))
        run_samples(
            self.parameters,
            self.state,
            self.plant,
            self.disturbance,
            self.noise * self.draw.normal(size=n),
            amplitudes,
            np.array([locked, steady, free, running, acts], np.int64),
            self.output_v,
            self.force_n,
            self.estimate_n,
            self.volts,
            self.stages,
        )
        return self

    @property
    def stage(self) -> HarmonicStage:
        """What the loop does now."""
        return HarmonicStage(int(self.state["stage"][0]))

    def controlling(self, most: int = 400) -> "Plant":
        """Run until the loop controls."""
        for _ in range(most):
            if self.stage is HarmonicStage.CONTROLLING:
                return self
            self.run(1)
        raise AssertionError(f"still {self.stage.name} after {most} periods")
