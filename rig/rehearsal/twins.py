"""Virtual twins of a bench: the linear rig is drawn from its posterior, everything else from hypotheses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.bench import Bench
from rig.bench.bench import DriverChoice
from rig.campaigns.planning.plan import Plan
from rig.drivers.oversampled import decimation_delay
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError, RigError
from rig.rehearsal.forces import Element, damping_for, hardening_for, softening_for
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.knowledge import Knowledge
from rig.rehearsal.linear.model import LinearRig
from rig.rehearsal.measured_mode import INSIDE, elements_of

MAX_TRIES = 50
"""Samples that are tried for one twin; chosen: even where one in ten can be computed, 1 in 200 twins fails."""
SUBSTEPS_HZ = 20_000.0  # least internal rate of a twin, Hz; chosen: ten steps in a period of the fastest mode of a twin
DEFAULT_LEVEL = 0.3  # highest level over the displacement limit, of a plan whose levels give no displacement; chosen


@dataclass(frozen=True, eq=False)
class Twin:
    """One virtual twin."""

    number: int
    """Number of the draw, from 0; also the seed of its noise and faults."""
    bench: Bench
    """The bench, with the twin behind its driver."""
    unknowns: Mapping[str, float]
    """What was drawn, by name; 0 for a property that it does not have."""


def draw_twin(bench: Bench, plan: Plan, knowledge: Knowledge, hypotheses: Hypotheses, seed: int, number: int) -> Twin:
    """Draw the twin of a number. The same seed and number give the same twin, whatever the others are.

    A rig that cannot be computed (a joint stiffer than its structure, a step that grows) is drawn again. Raises
    `ConfigurationError` if fifty in a row cannot.
    """
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(number,))))
    problem = ""
    for _ in range(MAX_TRIES):
        try:
            sample = _Sample(bench, plan, knowledge, hypotheses, generator)
            twin = Twin(number, sample.twin_bench(number), sample.unknowns)
            VirtualDAQ(twin.bench, number)
        except RigError as error:
            problem = str(error)
            continue
        return twin
    raise ConfigurationError(f"draw {number + 1}: no rig that can be computed in {MAX_TRIES} tries ({problem})")


class _Sample:
    """One rig that is drawn from posterior and hypotheses."""

    def __init__(
        self, bench: Bench, plan: Plan, knowledge: Knowledge, hypotheses: Hypotheses, generator: np.random.Generator
    ) -> None:
        self.bench, self.plan, self.knowledge, self.hypotheses = bench, plan, knowledge, hypotheses
        self.generator = generator
        self.unknowns: dict[str, float] = {}
        rig = knowledge.linear.draw(generator)
        values = dict(rig.values)
        self._drift(values)
        self.linear = LinearRig(values, rig.channels)
        for name in ("frequency_hz", "damping_ratio", "drive_shape", "moving_mass_kg"):
            self.unknowns[name] = values[name]
        self.omega = 2.0 * math.pi * values["frequency_hz"]
        self.highest_m = highest_displacement_m(bench, plan, self.linear)
        self.elements: list[Element] = []
        self.friction: list[Element] = []
        self.extra_mode: tuple[float, float] | None = None
        self._nonlinearities()

    def _happens(self, probability: float) -> bool:
        return bool(self.generator.random() < probability)

    def _log_uniform(self, bounds: tuple[float, float]) -> float:
        low, high = bounds
        return float(low * (high / low) ** self.generator.random())

    def _property(
        self, probability: float, first: tuple[float, float], second: tuple[float, float]
    ) -> tuple[bool, float, float]:
        """Draw whether the twin has a property, and its two sizes."""
        return self._happens(probability), self._log_uniform(first), self._log_uniform(second)

    def _drift(self, values: dict[str, float]) -> None:
        hypotheses, normal = self.hypotheses, self.generator.standard_normal
        values["frequency_hz"] *= math.exp(hypotheses.frequency_drift * normal())
        values["damping_ratio"] *= math.exp(hypotheses.damping_drift * normal())
        if not self.knowledge.shape_measured:
            values["drive_shape"] *= math.exp(0.5 * math.log(hypotheses.mode_shape) * normal())
        wrong = self._happens(hypotheses.gain)
        factor = self._log_uniform(hypotheses.gain_factor)
        self.unknowns["gain_factor"] = factor if wrong else 1.0
        values["force_per_volt_n_v"] *= self.unknowns["gain_factor"]

    def _nonlinearities(self) -> None:
        """Draw every property, also those that this twin does not have, so that each keeps its random numbers."""
        hypotheses = self.hypotheses
        kind, place = self.generator.random(), self.generator.random()
        shift = self._log_uniform(hypotheses.shift)
        growth = self._log_uniform(hypotheses.damping_growth)
        joint, joint_shift, slip = self._property(hypotheses.joint, hypotheses.joint_shift, hypotheses.joint_slip)
        stop, gap, stiffness = self._property(hypotheses.stop, hypotheses.stop_gap, hypotheses.stop_stiffness)
        second, at, shape = self._property(
            hypotheses.second_mode, hypotheses.second_mode_at, hypotheses.second_mode_shape
        )
        power = hypotheses.hardening_powers[int(self.generator.random() * len(hypotheses.hardening_powers))]
        points = ["drive", *self.linear.channels]
        self.at = points[int(place * len(points))]
        self.ratio = abs(1.0 if self.at == "drive" else self.linear.of(f"ratio {self.at}")) or 1.0
        mode = self.knowledge.mode
        if mode is None:
            if kind >= hypotheses.hardening + hypotheses.softening:
                shift = 0.0
            self._spring(shift if kind < hypotheses.hardening else -shift, power)
            self._velocity_damping(growth)
            self._joint(joint_shift if joint else 0.0, slip)
        else:
            self.elements.extend(elements_of(mode, self.linear, self.generator))
            measured_m = float(mode.amplitude_m.max())  # up to which no stop was met, or the mode has it
            stop = stop and gap * self.highest_m > measured_m
            self.unknowns |= {
                "shift": 0.0,
                "hardening_power": 0.0,
                "damping_growth": 1.0,
                "joint_shift": 0.0,
                "joint_slip": 0.0,
            }
        self._stop(gap if stop else 0.0, stiffness)
        self.unknowns["second_mode"] = at if second and abs(at - 1.0) > 0.05 else 0.0
        if self.unknowns["second_mode"]:
            self.extra_mode = (at * self.linear.of("frequency_hz"), shape * self.linear.of("drive_shape"))

    def _modal_stiffness(self, at_ratio: float) -> float:
        return self.omega**2 / (at_ratio * self.linear.of("drive_shape")) ** 2

    def _spring(self, shift: float, power: int) -> None:
        self.unknowns["shift"] = shift
        self.unknowns["hardening_power"] = float(power) if shift > 0.0 else 0.0
        stiffness = self._modal_stiffness(1.0) * ((1.0 + shift) ** 2 - 1.0)
        if shift > 0.0:
            self.elements.append(hardening_for(INSIDE, stiffness, self.highest_m, power))
        elif shift < 0.0:
            self.elements.append(softening_for(INSIDE, stiffness, self.highest_m))

    def _velocity_damping(self, growth: float) -> None:
        self.unknowns["damping_growth"] = growth
        if growth > 1.0:
            shape = self.linear.of("drive_shape")
            damping = 2.0 * (growth - 1.0) * self.linear.of("damping_ratio") * self.omega / shape**2
            self.elements.append(damping_for(INSIDE, damping, self.omega * self.highest_m))

    def _joint(self, shift: float, slip: float) -> None:
        self.unknowns["joint_shift"] = shift
        self.unknowns["joint_slip"] = slip if shift else 0.0
        if shift:
            share = 1.0 - (1.0 - shift) ** 2
            self.friction.append(
                {
                    "kind": "iwan",
                    "at": INSIDE,
                    "stiffness_n_m": share * self._modal_stiffness(1.0),
                    "phi_max_m": slip * self.highest_m,
                    "chi": -0.5,
                    "beta": 1.0,
                }
            )

    def _stop(self, gap: float, stiffness: float) -> None:
        self.unknowns["stop_gap"] = gap
        self.unknowns["stop_stiffness"] = stiffness if gap else 0.0
        if gap:
            self.elements.append(
                {
                    "kind": "clearance",
                    "at": self.at,
                    "gap_m": gap * self.ratio * self.highest_m,
                    "contact_stiffness_n_m": stiffness * self._modal_stiffness(self.ratio),
                }
            )

    def twin_bench(self, number: int) -> Bench:
        """Return the bench with this rig behind its driver."""
        options: Element = {
            "structure": self._structure(),
            "elements": self.elements,
            "friction": self.friction,
            "exciter": self._exciter(),
            "stinger": self._stinger(),
            "sensors": self._sensors(),
            **self._device(),
        }
        channels = tuple(c for c in self.bench.channels if c.role != "monitor" and not c.loopback)
        return self.bench.model_copy(
            update={
                "name": f"{self.bench.name}-twin-{number + 1}",
                "description": f"twin {number + 1} of the bench {self.bench.name}",
                "driver": DriverChoice(name="virtual", options=options),
                "channels": channels,
                "emergency_stop": None,
            }
        )

    def _structure(self) -> Element:
        rig = self.linear
        modes = [
            (
                rig.of("frequency_hz", mode),
                rig.of("damping_ratio", mode),
                rig.of("drive_shape", mode),
                [rig.of(f"ratio {name}", mode) for name in rig.channels],
                mode == "low",
            )
            for mode in rig.modes
        ]
        if self.extra_mode is not None:
            hertz, shape = self.extra_mode
            modes.append((hertz, rig.of("damping_ratio"), shape, [1.0] * len(rig.channels), False))
        modes.sort()
        shapes = {"drive": [m[2] for m in modes], INSIDE: [0.0 if m[4] else m[2] for m in modes]}
        shapes |= {name: [m[2] * m[3][i] for m in modes] for i, name in enumerate(rig.channels)}
        return {
            "kind": "modal",
            "frequency_hz": [m[0] for m in modes],
            "damping_ratio": [min(m[1], 0.99) for m in modes],
            "shapes": shapes,
        }

    def _exciter(self) -> Element:
        """Return a voltage-driven shaker with the drawn force per volt g and back-EMF b: ``G = b / g``, ``R = b / g^2``."""
        v = self.linear.values
        half, per_volt = 0.5 * v["exciter_damping_n_s_m"], v["force_per_volt_n_v"]
        resistance = half / per_volt**2
        return {
            "armature_mass_kg": v["moving_mass_kg"],
            "suspension_stiffness_n_m": v["suspension_stiffness_n_m"],
            "suspension_damping_n_s_m": half,
            "force_factor_n_a": half / per_volt,
            "resistance_ohm": resistance,
            "inductance_h": v["coil_time_constant_s"] * resistance,
        }

    def _stinger(self) -> Element:
        """Return the stinger, damped such that armature and drive point do not ring on it (5 % of critical)."""
        v = self.linear.values
        stiffness = v["stinger_stiffness_n_m"]
        return {
            "at": "drive",
            "stiffness_n_m": stiffness,
            "damping_n_s_m": 0.1 * math.sqrt(stiffness * v["moving_mass_kg"]),
        }

    def _sensors(self) -> list[Element]:
        out = []
        for channel in self.bench.channels:
            if channel.role == "monitor" or channel.loopback:
                continue
            noise = self.knowledge.noise_rms.get(channel.name, channel.noise_rms)
            table: Element = {
                "name": channel.name,
                "kind": "force" if channel.role == "force" else "acceleration",
                "sensitivity_v_per_unit": channel.sensitivity_v_per_unit,
                "range_v": channel.range_v,
                "noise_rms": noise,
                "high_pass_hz": self.linear.values["coupling_hz"],
            }
            if channel.role != "force":
                table["at"] = "drive" if channel.role == "drive" else channel.name
            out.append(table)
        return out

    def _device(self) -> Element:
        """Return converter, latency and faults: a virtual bench's own, else as the measurement saw them."""
        bench, hypotheses = self.bench, self.hypotheses
        faults = {name: getattr(hypotheses, name) for name in ("late_per_s", "held_per_s", "lost_per_s")}
        if bench.driver.name == "virtual":
            kept = {k: v for k, v in bench.driver.options.items() if k in ("queue_blocks", "delay_samples")}
            return {"converter": VirtualDAQ(bench).rig.converter.model_dump(), **kept, "faults": faults}
        times = bench.oversample
        rate = times * bench.sample_rate_hz
        bits = round(math.log2(2.0 * bench.output_range_v / min(c.resolution_v for c in bench.channels)))
        converter = {
            "adc_bits": bits,
            "adc_range_v": bench.output_range_v,
            "dac_bits": bits,
            "substeps": max(1, math.ceil(SUBSTEPS_HZ / rate)),
            "oversampling": 1,
        }
        delay = self.knowledge.loop_delay_samples
        own = 0.5 + decimation_delay(times)  # of hold and low-pass
        late = 0 if delay is None else max(0, round(times * (delay - bench.block) - own))
        return {"converter": converter, "delay_samples": late, "faults": faults}


def highest_displacement_m(bench: Bench, plan: Plan, rig: LinearRig) -> float:
    """Largest displacement of the drive point that the plan asks for at resonance of the linear rig, m, within the limits."""
    limit = bench.limits.displacement_m
    highest = max((target.level for target in plan.targets()), default=0.0)
    s = np.array([2j * np.pi * rig.of("frequency_hz")])
    receptance = complex(rig.receptances(s)[0, 0])
    per_unit = {
        "m": 1.0,
        "N": abs(receptance),
        "N RMS": math.sqrt(2.0) * abs(receptance),
        "V": abs(receptance * complex(rig.force_per_v(s, np.array([receptance]))[0])),
    }.get(plan.level_unit)
    reached = DEFAULT_LEVEL * limit if per_unit is None else highest * per_unit
    return float(min(max(reached, 1e-4 * limit), limit))
