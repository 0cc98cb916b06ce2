"""Ratios between the channels of a point, of fundamentals and of RMS values, and their standard errors."""

import math
from collections.abc import Sequence

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.point import Point, spectrum_of, vibration_of
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan

DETUNED = 20.0  # growth of the allowance per relative deviation of the squared frequency


def ratios_of(point: Point[object], drive: int) -> np.ndarray:
    """Fundamentals over the fundamental of channel ``drive``: complex[n_channels], in the ratio of the channels' units."""
    return over_drive(spectrum_of(point).harmonics[:, 1], drive)


def over_drive(values: Sequence[float] | np.ndarray, drive: int) -> np.ndarray:
    """Values of all channels, such as their RMS, over that of channel ``drive``: [n_channels], in the ratio of their units."""
    sizes = np.asarray(values)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(sizes / sizes[drive])


def ratio_std(bench: Bench, point: Point[object], drive: int) -> np.ndarray | None:
    """Standard errors of the ratios due to noise and the converter's quantisation; None if the drive amplitude is 0."""
    size = np.abs(spectrum_of(point).harmonics[:, 1])
    known = spectrum_of(point).harmonics_std
    std = np.zeros(size.size) if known is None else known[:, 1]
    steps = np.array([channel.resolution_in_unit for channel in bench.channels])
    return None if not size[drive] > 0.0 else np.hypot(std, steps / math.sqrt(12.0)) / size[drive]


def shapes_of(bench: Bench, plan: Plan) -> np.ndarray | None:
    """Mode shapes over that of the drive point, complex[n_channels]: NaN for channels without one, None if that has none.

    The signs are those of the bench; sizes and turns are those that the plan's ``[plant]`` has as measured, else the bench's
    sizes and none.
    """
    at_drive = bench.specimen.drive_mode_shape
    if at_drive is None:
        return None
    drive = bench.index_of("drive")
    known = [at_drive if i == drive else channel.mode_shape for i, channel in enumerate(bench.channels)]
    ratios = np.array([math.nan if shape is None else shape for shape in known]) / at_drive
    plant = plan.plant if isinstance(plan, LockedPlan) else None
    measured: dict[str, float] = {} if plant is None else plant.response_ratios
    sizes = [measured.get(channel.name, size) for channel, size in zip(bench.channels, np.abs(ratios), strict=True)]
    turns: dict[str, float] = {} if plant is None else plant.response_turns_deg
    turned = np.exp(1j * np.radians([turns.get(channel.name, 0.0) for channel in bench.channels]))
    return np.asarray(np.copysign(sizes, ratios) * turned)


def motions_of(bench: Bench) -> list[int]:
    """Indices of the drive channel and of all response channels."""
    return [index for index, channel in enumerate(bench.channels) if channel.role in ("drive", "response")]


def allowance_growth(bench: Bench, point: Point[object], drive: int) -> float:
    """Factor by which the allowance grows away from resonance, 1 or more."""
    fundamentals = spectrum_of(point).harmonics[:, 1]
    force, velocity = fundamentals[bench.index_of("force")], -1j * fundamentals[drive]
    active = abs((force * velocity.conjugate()).real)
    by_phase = math.inf if active == 0.0 else abs(force) * abs(velocity) / active - 1.0
    detuned = abs((vibration_of(point).frequency_hz / bench.specimen.linear_frequency_hz) ** 2 - 1.0)
    return 1.0 + min(by_phase, DETUNED * detuned)


def resistance_of(bench: Bench, point: Point[object]) -> float:
    """Force in phase with the drive point's velocity, divided by that velocity, N s/m."""
    fundamentals = spectrum_of(point).harmonics[:, 1]
    velocity = fundamentals[bench.index_of("drive")] / (2j * math.pi * vibration_of(point).frequency_hz)
    force = fundamentals[bench.index_of("force")]
    return float((force * velocity.conjugate()).real / abs(velocity) ** 2) if velocity else math.nan
