"""Search for a level at which a multisine stands out of the noise, upwards from a low voltage, and down where it is too much.

The search is used by a check and by a tuning. All levels are recorded in one file: each further level is a change of the plan.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rig.arming.arming import asked_once
from rig.arming.run_options import RemarksOnce, RunOptions
from rig.bench import Bench
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.runner import resume_run, run_plan
from rig.recording.reader import Recording

FIRST = 1e-3  # of the largest voltage, RMS
TOO_HIGH = 0.55  # of a limit: peaks of a first level beyond this lower it to the safe share; chosen
LARGEST_RISE = 4.0  # factor from one level to the next; chosen: 12 dB


class MultisineSeries:
    """Plays multisines one after the other into one recording. A person arms all of them at once, and reads a remark once."""

    def __init__(self, bench: Bench, output: Path, options: RunOptions, purpose: str) -> None:
        self.bench, self.output = bench, output
        self._options = replace(
            options,
            arm=asked_once(options.arm),
            about=replace(options.about, purpose=purpose),
            progress=RemarksOnce(options.progress),
        )
        self._begun = False

    def play(self, plan: MultisinePlan, *, after_silence: bool = False) -> Recording:
        """Play a multisine and return the recording with it as the last part. The first call creates the recording.

        ``after_silence``: the last one tripped because a channel read nothing, which allows a higher level.
        """
        if self._begun:
            options = replace(self._options, seed=None)
            return resume_run(self.output, options, change=plan, retry_tripped=after_silence, trust_code=True)
        self._begun = True
        return run_plan(plan, self.bench, self.output, self._options)


@dataclass(frozen=True)
class Seen:
    """Evaluation of the responses to one level."""

    enough: bool
    """Whether the responses stand out of the noise clearly enough."""
    share_of_limits: float
    """Largest peak relative to its limit (`share_of_limits`)."""
    wanted_rise: float = LARGEST_RISE
    """Factor by which the level should be raised if the responses do not suffice."""


@dataclass(frozen=True, kw_only=True)
class LevelSearch:
    """Raises the level until the responses suffice, peaks come near the limits, or the largest number of levels was tried.

    A level whose peaks are `TOO_HIGH` is lowered, however well its responses stand out: longer records have higher peaks.
    """

    safe_share: float
    """Share of every limit that expected peaks may reach."""
    least_rise: float
    """Smallest factor by which it is worth raising the level again."""
    most_levels: int
    """Largest number of levels tried."""

    def search(self, bench: Bench, listen: Callable[[float], Seen]) -> tuple[tuple[float, ...], bool]:
        """Search from a thousandth of the largest voltage upwards; ``listen`` plays a level (V RMS) and evaluates it.

        Returns all levels that were played, of which the last one is the level to use, and whether it suffices.
        """
        tried: list[float] = []
        level: float | None = FIRST * bench.limits.voltage_v
        while level is not None:
            seen = listen(level)
            tried.append(level)
            level = self.next_level(level, seen) if len(tried) < self.most_levels else None
        return tuple(tried), seen.enough

    def next_level(self, level_rms_v: float, seen: Seen) -> float | None:
        """Return the next level to play; None if this level suffices, or if the limits allow no worthwhile rise."""
        rise = min(seen.wanted_rise, LARGEST_RISE, self.safe_share / seen.share_of_limits)
        if TOO_HIGH < seen.share_of_limits < math.inf:
            return level_rms_v * rise
        return level_rms_v * rise if not seen.enough and rise >= self.least_rise else None


def share_of_limits(bench: Bench, rows: np.ndarray, displacement_m: Callable[[str, float], float]) -> float:
    """Return the largest peak of output and channels relative to its limit; inf if a channel has no reading left.

    ``displacement_m`` estimates a channel's peak displacement from its name and its peak acceleration. Lost samples and the
    mean of a channel are left out.
    """
    limits = bench.limits
    shares = [float(np.abs(rows["output_v"]).max()) / limits.voltage_v]
    for index, channel in enumerate(bench.channels):
        if channel.role == "monitor":
            continue
        values = rows["inputs"][:, index].astype(float)
        values = values[np.isfinite(values)]
        if not values.size:
            return math.inf  # the lost readings may have been at a limit
        peak = float(np.abs(values - values.mean()).max())
        if channel.role == "force":
            shares.append(peak / limits.force_n)
        else:
            shares += [peak / limits.acceleration_m_s2, displacement_m(channel.name, peak) / limits.displacement_m]
    return max(shares)
