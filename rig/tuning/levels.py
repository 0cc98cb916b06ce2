"""Choose levels and low-pass of the proposed test, from the lowest force that noise allows to a part of the limits."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from controller.tuning import LowPassChoice, PlantModel, low_pass_from_densities
from rig.bench import Bench
from rig.campaigns.planning.levels_on_plant import voltage_for
from rig.errors import ConfigurationError
from rig.tuning.converter_bits import OutputBits, rounding

LAG_STD_DEG = 0.75  # standard deviation of the lag before the settle rule averages it over ten periods
RAISED = 3.0  # factor by which the lowest force may be raised


def low_pass(
    plant: PlantModel, densities: tuple[float, float], lowest_n: float, highest_n: float = math.inf
) -> tuple[float, float, str]:
    """Return the largest low-pass (rad/s), the lowest force (N) at which the lag can be measured with it, and the reason.

    At that force the standard deviation of the lag is `LAG_STD_DEG`. If at most `RAISED` times the wanted force is needed, and
    less than ``highest_n`` (N) by `MIN_SPAN`, the force is raised and the low-pass is kept, because a slow low-pass costs
    time at every level.
    """
    omega = plant.lock_frequency_rad_s()
    accelerance = abs(complex(plant.accelerance(1j * omega)))

    def fluctuation(force_n: float) -> LowPassChoice:
        amplitudes = (densities[0], force_n, densities[1], force_n * accelerance)
        return low_pass_from_densities(omega, *amplitudes, lag_std_deg=LAG_STD_DEG)

    quickest = fluctuation(1e6 * lowest_n)  # limited by the frequency alone
    needed_n = 1e6 * lowest_n * quickest.lag_std_deg / LAG_STD_DEG
    if needed_n <= lowest_n:
        choice = fluctuation(lowest_n)
        return (
            choice.low_pass_rad_s,
            lowest_n,
            f"the lag then fluctuates by {choice.lag_std_deg:.2g} deg at {lowest_n:.3g} N",
        )
    why = f"the lag then fluctuates by {LAG_STD_DEG:g} deg at"
    if needed_n <= min(RAISED * lowest_n, highest_n / MIN_SPAN):
        return quickest.low_pass_rad_s, needed_n, f"{why} {needed_n:.3g} N, the lowest level, raised for this"
    choice = fluctuation(lowest_n)
    force_n = lowest_n * max(1.0, choice.lag_std_deg / LAG_STD_DEG)
    return choice.low_pass_rad_s, force_n, f"{why} {force_n:.3g} N, the lowest level"


LIMIT_FRACTION = 1.0 / 3.0  # of the limits, on the linear plant; the rest is room for the nonlinearity
LARGER_FRACTION = 2.0 / 3.0  # the same where levels span less than `NARROWEST_SPAN` and rounding disturbs some; chosen
SPAN = 30.0  # highest level over lowest, where noise allows
MIN_SPAN = 1.5  # highest level over lowest that rounding may reduce it to; the lowest points may then be refused
SHAPED_SPAN = 4.0  # the same where rounding of the output is fed back: what it adds is bounded, not known; chosen
MIN_FORCE_BITS = 2.0  # amplitude of the force at the lowest level, in least significant bits of the converter
MAX_NONHARMONIC = 0.05
"""Of the force's RMS: what rounding may add at the lowest level. Plans accept 0.1 by default: lines of a rounded sine may lie
where the force per volt is large, and add twice as much as if they were spread evenly."""
OUTPUT = "output"  # the converter whose rounding may be fed back
NARROWEST_SPAN = 2.0  # span below which larger levels are tried where rounding disturbs; chosen
NARROW_SPAN = 10.0  # span below which rounding may add more, and the plan accepts more
ACCEPTED_QUIET = 0.15  # of the force's RMS: what a plan accepts where `MAX_NONHARMONIC` bounds its lowest level; chosen
SHORT_SPAN = 4.0  # span below which the lowest level is no longer raised for a lower rounding; chosen
RELAXED_NONHARMONIC, ACCEPTED_NONHARMONIC = (0.1, 0.15), 0.4
"""Of the force's RMS, below `NARROW_SPAN`: what rounding may add down to `SHORT_SPAN` and below it, and what the plan accepts;
chosen: of 351 points of random rigs those with 0.25 to 0.9 erred by 1.6 % of the damping at most, others by 5.4 %."""


@dataclass(frozen=True)
class LevelChoice:
    """Levels of the drive point's displacement, and the reason for them."""

    levels_m: tuple[float, ...]
    """Levels, m peak."""
    needed_v: tuple[float, ...]
    """Voltage of each level on the linear plant, V peak."""
    forces_n: tuple[float, ...]
    """Force of each level on the linear plant, N peak."""
    why: str
    """What bounds the levels."""
    accepted_nonharmonic: float | None = None
    """Part of the force away from its harmonics that the plan must accept, because rounding causes it; None: the usual one."""
    noise_shaping: bool = False
    """Whether the plan feeds the rounding of the output back, because it would bound the lowest level."""

    @property
    def span(self) -> float:
        """Highest level over lowest."""
        return self.levels_m[-1] / self.levels_m[0]

    def within(self, lowest_m: float, highest_m: float, why: str, points: int | None = None) -> "LevelChoice":
        """Return as many levels, or ``points``, in equal ratios between two displacements (m peak)."""
        levels = _spread(lowest_m, highest_m, points or len(self.levels_m))
        volts, newtons = self.needed_v[-1] / self.levels_m[-1], self.forces_n[-1] / self.levels_m[-1]
        return replace(
            self,
            levels_m=levels,
            needed_v=tuple(volts * level for level in levels),
            forces_n=tuple(newtons * level for level in levels),
            why=why,
        )


def _spread(lowest_m: float, highest_m: float, points: int) -> tuple[float, ...]:
    if points == 1:
        return (highest_m,)
    return tuple(float(f"{level:.4g}") for level in np.geomspace(lowest_m, highest_m, points))


def needed_v(plant: PlantModel, level_m: float) -> float:
    """Voltage (V peak) for a displacement (m peak) at resonance of the linear plant."""
    return voltage_for(plant, level_m, "m", -90.0)


def needed_n(plant: PlantModel, level_m: float) -> float:
    """Force (N peak) for a displacement (m peak) at resonance of the linear plant."""
    omega = plant.lock_frequency_rad_s()
    return float(level_m * omega**2 / abs(complex(plant.accelerance(1j * omega))))


def reach_m(bench: Bench, plant: PlantModel, ratios: Mapping[str, float]) -> tuple[float, str]:
    """Return the drive point's largest displacement on the linear plant within the bench's limits, and the first limit met.

    The displacement is in m peak. ``ratios`` are displacements of channels per displacement of the drive point, by name.
    """
    limits, omega = bench.limits, plant.lock_frequency_rad_s()
    name, ratio = max(ratios.items(), key=lambda entry: entry[1], default=("", 1.0))
    ratio, where = (ratio, f" at channel {name!r}") if ratio > 1.0 else (1.0, "")
    ends = {
        f"limits.displacement_m = {limits.displacement_m:g}{where}": limits.displacement_m / ratio,
        f"limits.acceleration_m_s2 = {limits.acceleration_m_s2:g}{where}": limits.acceleration_m_s2 / omega**2 / ratio,
        f"limits.voltage_v = {limits.voltage_v:g}": limits.voltage_v / needed_v(plant, 1.0),
        f"limits.force_n = {limits.force_n:g}": limits.force_n / needed_n(plant, 1.0),
    }
    end = min(ends, key=lambda key: ends[key])
    return ends[end], end


@dataclass(frozen=True)
class LowestForce:
    """Lowest useful force."""

    force_n: float
    """The force, N peak."""
    bound: str = ""
    """What keeps it from being lower; empty if it is a part of the highest force."""
    accepted_nonharmonic: float | None = None
    """As in `LevelChoice`."""
    noise_shaping: bool = False
    """As in `LevelChoice`."""


def lowest_force(bench: Bench, plant: PlantModel, highest_m: float, bits: OutputBits) -> LowestForce:
    """Return the lowest useful force for a highest level.

    It is a part of the highest force, but at least a few bits of the input converter, and so large that rounding in both
    converters adds no more than `MAX_NONHARMONIC` to it. Where that leaves less than a span of `NARROW_SPAN`, rounding may add
    more (`RELAXED_NONHARMONIC`). Where rounding of the output bounds the force, the plan feeds it back, if the bits are known:
    those of a device must be given in the bench.
    """
    found = _lowest_force(bench, plant, highest_m, bits.plain_n)
    known = bench.output_resolution_v is not None or bench.driver.name == "virtual"
    if OUTPUT not in found.bound or not known:
        return found
    return replace(_lowest_force(bench, plant, highest_m, bits.shaped_n, SHAPED_SPAN), noise_shaping=True)


def _lowest_force(
    bench: Bench, plant: PlantModel, highest_m: float, bits_force_n: float, least_span: float = MIN_SPAN
) -> LowestForce:
    force, highest_n = bench.channels[bench.index_of("force")], needed_n(plant, highest_m)
    read_n, sent_n = rounding(force.resolution_in_unit, force.noise_rms), bits_force_n
    rounded_n = math.hypot(read_n, sent_n)
    few_n = max(highest_n / SPAN, MIN_FORCE_BITS * force.resolution_in_unit)
    quiet_n = math.sqrt(2.0) * rounded_n / MAX_NONHARMONIC
    if max(few_n, quiet_n) == highest_n / SPAN:
        return LowestForce(few_n)
    if quiet_n <= few_n:
        return LowestForce(min(few_n, highest_n / least_span), "two bits of the force's converter")
    which = OUTPUT if sent_n > read_n else "force"
    bound = f"the last bits of the {which} converter, which add {rounded_n:.2g} N RMS at other frequencies"
    if quiet_n <= highest_n / NARROW_SPAN:
        return LowestForce(quiet_n, bound, ACCEPTED_QUIET)
    quieter_n, noisier_n = (math.sqrt(2.0) * rounded_n / part for part in RELAXED_NONHARMONIC)
    more_n = max(few_n, noisier_n, min(quieter_n, highest_n / SHORT_SPAN))
    return LowestForce(min(max(more_n, highest_n / NARROW_SPAN), highest_n / least_span), bound, ACCEPTED_NONHARMONIC)


def choose_levels(
    bench: Bench,
    plant: PlantModel,
    ratios: Mapping[str, float],
    *,
    lowest: LowestForce,
    highest_m: float,
    from_m: float | None = None,
    points: int = 8,
) -> LevelChoice:
    """Choose levels in equal ratios, from the lowest force above noise, or ``from_m``, to the highest level.

    ``ratios`` are as for `reach_m`. Raises `ConfigurationError` for a level that the bench cannot reach.
    """
    reach, limit = reach_m(bench, plant, ratios)
    told = lowest.force_n / needed_n(plant, 1.0)
    first, highest = told if from_m is None else from_m, highest_m
    if highest > reach:
        raise ConfigurationError(
            field="to_m",
            value=highest,
            allowed=f"up to {reach:.3g} m, where {limit} of the bench {bench.name} ends the linear plant (it would "
            f"need {needed_v(plant, highest):.3g} V)",
        )
    if not 0.0 < first < highest:
        quiet = f"the force is above noise and rounding from {told:.3g} m on, the highest level is {highest:.3g} m"
        if from_m is None:
            raise ConfigurationError(
                f"{quiet}: no level can be measured; a more sensitive force channel would lower the noise"
            )
        raise ConfigurationError(quiet, field="from_m", value=first, allowed="above 0 and below the highest level")
    levels = _spread(first, highest, points)
    why = f"the highest is {highest / reach:.2f} of what {limit} allows on the linear plant"
    why += f", the lowest has {needed_n(plant, levels[0]):.3g} N of force"
    return LevelChoice(
        levels,
        tuple(needed_v(plant, level) for level in levels),
        tuple(needed_n(plant, level) for level in levels),
        why,
        lowest.accepted_nonharmonic,
        lowest.noise_shaping,
    )


def significant(value: float, digits: int = 5) -> float:
    """Round a number to some significant digits."""
    return value if value == 0.0 or not math.isfinite(value) else float(f"{value:.{digits}g}")
