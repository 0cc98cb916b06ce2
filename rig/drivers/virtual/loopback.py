"""The output itself as a channel of a virtual rig: a cable from the output to an input."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.daq import Channel

__all__ = ["Loopback", "loopback_of"]


class Loopback(NamedTuple):
    """Channels that read the output: the last columns of a row."""

    past: np.ndarray
    """float64[m]: ring of outputs on the converter, V."""
    v_per_v: np.ndarray
    """float64[k]: sensitivity of each channel; k may be 0."""
    whole: int
    """Whole samples by which they read late."""
    part: float
    """The fraction of a sample, linear between two."""


def loopback_of(channels: Sequence[Channel], delay_samples: float) -> Loopback:
    """Of those ``channels`` that are loopbacks; ``delay_samples`` is that of hold and filters."""
    whole = math.floor(delay_samples)
    v_per_v = np.array([channel.sensitivity_v_per_unit for channel in channels if channel.loopback])
    return Loopback(np.zeros(whole + 2), v_per_v, whole, delay_samples - whole)
