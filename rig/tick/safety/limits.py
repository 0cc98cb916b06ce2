"""Conversion of a bench's limits to the records that the kernels read, and of a trip to a sentence."""

import math

import numpy as np

from rig.bench import Bench
from rig.bench.channels import Role
from rig.errors import DaqEmergencyStop, DaqError
from rig.tick.safety.layout import GUARD, INPUT, INPUT_WATCH, LIMITS, POLARITY_HINT, EndReason, GuardMode

INTEGRATOR_CORNER = 0.2  # of the lowest frequency allowed: there a displacement reads 4 % low, at five times that 0.2 %


def limits_record(bench: Bench, near: float = 1.0) -> np.ndarray:
    """Return the limits in samples and SI units (one record of `LIMITS`); ``near``: part of a limit that is near it."""
    limits, rate = bench.limits, bench.sample_rate_hz
    out = np.zeros(1, LIMITS)
    out["voltage_v"] = limits.voltage_v
    out["displacement_m"], out["near_m"] = limits.displacement_m, near * limits.displacement_m
    out["lowest_rad_s"], out["highest_rad_s"] = (2.0 * math.pi * f for f in limits.frequency_hz)
    out["slew_v_per_sample"] = limits.slew_v_per_s / rate
    out["overload_samples"] = max(1, round(limits.overload_s * rate))
    out["stuck_samples"] = max(2, round(limits.stuck_s * rate))
    out["lost_samples"] = max(1, round(limits.lost_s * rate))
    out["ramp_down_samples"] = max(1, round(limits.ramp_down_s * rate))
    out["integrator_gain"] = 1.0 / rate
    out["resonance_rad_s"] = 2.0 * math.pi * bench.specimen.linear_frequency_hz
    out["integrator_leak"] = -math.expm1(-2.0 * math.pi * INTEGRATOR_CORNER * limits.frequency_hz[0] / rate)
    return out


def input_records(bench: Bench, near: float = 1.0) -> np.ndarray:
    """Return one record of `INPUT` for each channel: scaling, range, limit, skew; ``near``: part of a limit that is near it."""
    out = np.zeros(len(bench.channels), INPUT)
    for record, channel in zip(out, bench.channels, strict=True):
        accelerates = channel.role in ("drive", "response")
        record["unit_per_volt"] = 1.0 / channel.sensitivity_v_per_unit
        record["overload_v"] = bench.limits.overload_fraction * channel.range_v
        limits = {"force": bench.limits.force_n, "monitor": math.inf}
        record["limit"] = limits.get(channel.role, bench.limits.acceleration_m_s2)
        record["near"] = near * record["limit"]
        record["alarm_v"] = min(record["overload_v"], record["near"] * abs(channel.sensitivity_v_per_unit))
        record["role"] = Role[channel.role.upper()]
        record["skew_samples"] = channel.skew_samples
        record["watch_displacement"] = accelerates
        stop = bench.emergency_stop
        if stop is not None and stop.channel == channel.name:
            record["emergency_stop"] = 1
            record["stop_below_v"] = -math.inf if stop.below_v is None else stop.below_v
            record["stop_above_v"] = math.inf if stop.above_v is None else stop.above_v
            record["alarm_v"] = 0.0  # examine every reading
    return out


def watch_records(n_channels: int) -> np.ndarray:
    """Return the initial running state of the inputs."""
    out = np.zeros(n_channels, INPUT_WATCH)
    out["last_v"] = np.nan
    return out


def guard_record(armed: bool) -> np.ndarray:
    """Return the initial record of a guard, armed or disarmed."""
    out = np.zeros(1, GUARD)
    out["mode"] = GuardMode.ARMED if armed else GuardMode.DISARMED
    out["channel"] = -1
    return out


def end_reason_of(error: DaqError) -> EndReason:
    """Return the reason with which a run ends if its driver raises this error."""
    return EndReason.EMERGENCY_STOP if isinstance(error, DaqEmergencyStop) else EndReason.DRIVER_FAILED


def describe_end(guard: np.ndarray, bench: Bench) -> str:
    """Return one sentence on why the output was brought down: reason, channel, value, sample.

    A hint on the cause is given only if no lock was gained at the start. The likely cause of a trip must be judged from the
    measurement before the trip (`rig.campaigns.running.trip_advice`).
    """
    reason = EndReason(int(guard["reason"][0]))
    text = reason.text
    if not reason.is_trip:
        unlocked = reason in (EndReason.NO_LOCK_IN_WINDOW, EndReason.NO_LOCK)
        return f"{text}; {POLARITY_HINT}" if unlocked else text
    channel = int(guard["channel"][0])
    sample = int(guard["sample"][0])
    where = ""
    if reason is EndReason.GAIN_CHANGED:
        where = f" on channel {bench.channels[channel].name} (by a factor of {float(guard['value'][0]):.3g})"
    elif channel >= 0:
        unit = "m" if reason in (EndReason.DISPLACEMENT_LIMIT, EndReason.OVERTRAVEL) else bench.channels[channel].unit
        where = f" on channel {bench.channels[channel].name} ({float(guard['value'][0]):.4g} {unit})"
    elif reason is EndReason.FREQUENCY_LIMIT:
        where = f" ({float(guard['value'][0]):.4g} Hz)"
    elif reason is EndReason.SAMPLES_LOST:
        where = f" ({float(guard['value'][0]):.4g} s, limits.lost_s = {bench.limits.lost_s:g})"
    return f"{text}{where} at sample {sample} ({sample / bench.sample_rate_hz:.3f} s)"
