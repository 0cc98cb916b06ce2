"""Check levels on a known linear plant: voltage, force, and motion of every channel, against the bench's limits."""

import math
from collections.abc import Mapping, Sequence

from controller.tuning import PlantModel
from rig.bench import Bench
from rig.campaigns.planning.levels import Levels
from rig.errors import ConfigurationError

MORE_DAMPING = (1.5, 2.0, 3.0, 4.0, 6.0, 8.0)  # times the known damping: that of a joint rises with the level


def check_voltage(levels: Levels, plant: PlantModel, lags_deg: Sequence[float], bench: Bench) -> None:
    """Refuse levels that need more than the bench's voltage."""
    limit = bench.limits.voltage_v
    # Everything is linear in the level. Compute the need of a unit level once, because there may be many levels and lags.
    of_unit, lag = max((voltage_for(plant, 1.0, levels.level_unit, lag), lag) for lag in lags_deg)
    for index, level in enumerate(levels.levels):
        volts = level * of_unit
        if volts > limit:
            raise ConfigurationError(
                f"needs {volts:.3g} V{lags_text([lag])} on the known plant ([plant], {100.0 * plant.damping_ratio:.3g} % "
                f"damping), the bench {bench.name} allows {limit:g} V",
                field=f"{levels.levels_key}[{index}]",
                value=level,
                unit=levels.level_unit,
            )


def check_motion(
    levels: Levels, plant: PlantModel, lags_deg: Sequence[float], bench: Bench, ratios: Mapping[str, float]
) -> None:
    """Refuse levels beyond the limits of force or of any channel's motion, even if a joint adds damping.

    ``ratios`` are the motions of the channels per metre at the drive point. With more damping the structure moves less under a
    given force or voltage, but it needs more force for a given displacement, and under a given voltage the force drop-out is
    smaller.
    """
    unit, most = levels.level_unit, MORE_DAMPING[-1]
    part = 1.0 if unit == "m" else most
    farthest = max(ratios, key=lambda name: ratios[name])
    where = f" at channel {farthest!r}"
    found = []
    for name, its_unit, ratio, at, times in (
        ("force_n", "N", 1.0, "", 1.0),
        ("displacement_m", "m", ratios[farthest], where, part),
        ("acceleration_m_s2", "m/s^2", ratios[farthest], where, part),
    ):
        damped = plant.at(damping_ratio=min(times * plant.damping_ratio, 0.99))
        of_unit, lag = max((ratio * motion_for(damped, 1.0, unit, lag)[name], lag) for lag in lags_deg)
        found.append((name, its_unit, ratio, at, times, of_unit, lag))
    for index, level in enumerate(levels.levels):
        for name, its_unit, ratio, at, times, of_unit, lag in found:
            least, limit = level * of_unit, getattr(bench.limits, name)
            if least <= limit:
                continue
            known = ratio * motion_for(plant, level, unit, lag)[name]
            more = f", and still {least:.3g} {its_unit} with {times:g} times the damping" if times > 1.0 else " or more"
            raise ConfigurationError(
                f"means {known:.3g} {its_unit}{at}{lags_text([lag])} on the known plant ([plant], "
                f"{100.0 * plant.damping_ratio:.3g} % damping){more}; the bench {bench.name} allows "
                f"limits.{name} = {limit:g}",
                field=f"{levels.levels_key}[{index}]",
                value=level,
                unit=unit,
            )


def lags_text(lags_deg: Sequence[float]) -> str:
    """Return the lags as text; empty if the only lag is that of resonance."""
    if list(lags_deg) == [-90.0]:
        return ""
    if len(lags_deg) > 3:
        return f" at {len(lags_deg)} lags from {lags_deg[0]:g} to {lags_deg[-1]:g} deg"
    return f" at a lag of {', '.join(f'{lag:g}' for lag in lags_deg)} deg"


def voltage_for(plant: PlantModel, level: float, unit: str, lag_deg: float) -> float:
    """Voltage (V peak) that a linear plant needs for a level (V, N, N RMS, m)."""
    if unit == "V":
        return level
    omega = plant.lock_frequency_rad_s(lag_deg)
    if unit == "m":
        return float(level * omega**2 / abs(complex(plant.acceleration_per_v(1j * omega))))
    return float(level * (math.sqrt(2.0) if unit == "N RMS" else 1.0) * plant.volts_per_newton(lag_deg))


def motion_for(plant: PlantModel, level: float, unit: str, lag_deg: float) -> dict[str, float]:
    """Return peak force, displacement and acceleration of the drive point at a level on a linear plant.

    The keys are the names of the limits. The level is in V, N, N RMS or m.
    """
    omega = plant.lock_frequency_rad_s(lag_deg)
    accelerance = abs(complex(plant.accelerance(1j * omega)))
    if unit == "V":
        force = level * abs(complex(plant.force_per_v(1j * omega)))
    elif unit == "m":
        force = level * omega**2 / accelerance
    else:
        force = level * (math.sqrt(2.0) if unit == "N RMS" else 1.0)
    acceleration = force * accelerance
    return {"force_n": force, "displacement_m": acceleration / omega**2, "acceleration_m_s2": acceleration}
