"""Searches for a level at which a multisine stands out of the noise, from a safe voltage upwards.

A check and a tuning use it. All levels go into one recording: each further one is a change of its plan.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rig.arming.arming import asked_once
from rig.arming.run_options import RunOptions
from rig.bench import Bench
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.runner import carry_out, take_up
from rig.recording.reader import Recording

__all__ = ["LARGEST_RISE", "LevelSearch", "Levels", "MultisineSeries", "Seen", "share_of_limits"]

FIRST = 1e-3  # of the largest voltage, RMS
LARGEST_RISE = 4.0


class MultisineSeries:
    """Plays multisines, one after the other, into one recording; a person is asked once to arm all of them."""

    def __init__(self, bench: Bench, output: Path, options: RunOptions, purpose: str) -> None:
        self.bench, self.output = bench, output
        self._options = replace(options, arm=asked_once(options.arm), about=replace(options.about, purpose=purpose))
        self._begun = False

    def play(self, plan: MultisinePlan) -> Recording:
        """The recording with this multisine as its last part; the first one begins the recording."""
        if self._begun:
            return take_up(self.output, replace(self._options, seed=None), change=plan, trust_code=True)
        self._begun = True
        return carry_out(plan, self.bench, self.output, self._options)


@dataclass(frozen=True)
class Seen:
    """How the responses to one level stood out of the noise."""

    enough: bool
    """Whether they suffice."""
    share_of_limits: float
    """Largest peak, as a part of its limit (`share_of_limits`)."""
    wanted_rise: float = LARGEST_RISE
    """Factor by which the level should be raised, where they do not suffice."""


@dataclass(frozen=True)
class Levels:
    """Levels of a search."""

    tried_v: tuple[float, ...]
    """All levels that were played, V RMS; the last is the one to use."""
    enough: bool
    """Whether the last one suffices."""


@dataclass(frozen=True, kw_only=True)
class LevelSearch:
    """Raises the level until the responses suffice, peaks come near the limits, or enough levels were tried."""

    safe_share: float
    """Part of every limit that peaks may be expected to reach."""
    least_rise: float
    """Factor below which a further level is not worth its time."""
    most_levels: int
    """Levels that are tried at most."""

    def search(self, bench: Bench, listen: Callable[[float], Seen]) -> Levels:
        """Search from a thousandth of the largest voltage on; ``listen`` plays a level (V RMS) and evaluates it."""
        tried: list[float] = []
        level: float | None = FIRST * bench.limits.voltage_v
        while level is not None:
            seen = listen(level)
            tried.append(level)
            level = self.next_level(level, seen) if len(tried) < self.most_levels else None
        return Levels(tuple(tried), seen.enough)

    def next_level(self, level_rms_v: float, seen: Seen) -> float | None:
        """The level to play after this one; None where it suffices, or where limits leave no room for a higher one."""
        rise = min(seen.wanted_rise, LARGEST_RISE, self.safe_share / seen.share_of_limits)
        return level_rms_v * rise if not seen.enough and rise >= self.least_rise else None


def share_of_limits(bench: Bench, rows: np.ndarray, displacement_m: Callable[[str, float], float]) -> float:
    """Largest peak of output and channels against its limit; inf where a channel has no reading left.

    ``displacement_m`` estimates a channel's peak displacement from its name and its peak acceleration. Lost samples and the
    mean of a channel do not count.
    """
    limits = bench.limits
    shares = [float(np.abs(rows["output_v"]).max()) / limits.voltage_v]
    for index, channel in enumerate(bench.channels):
        if channel.role == "monitor":
            continue
        values = rows["inputs"][:, index].astype(float)
        values = values[np.isfinite(values)]
        if not values.size:
            return math.inf  # the readings that were lost may have been at a limit
        peak = float(np.abs(values - values.mean()).max())
        if channel.role == "force":
            shares.append(peak / limits.force_n)
        else:
            shares += [peak / limits.acceleration_m_s2, displacement_m(channel.name, peak) / limits.displacement_m]
    return max(shares)
