"""Largest value of every limited quantity over a run, over its limit."""

import math

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from vibrolock.arrays import Float, Int
from vibrolock.compiled import kernel

Rows = NDArray[np.void]
"""Rows of a structured array."""


class Peaks:
    """Largest value of every limited quantity over a run. ``limits``: the record of the tick's limits."""

    def __init__(self, bench: Bench, limits: Rows) -> None:
        self._bench = bench
        self._moving = np.array([i for i, one in enumerate(bench.channels) if one.role in ("drive", "response")])
        self._gain, self._keep = float(limits["integrator_gain"][0]), 1.0 - float(limits["integrator_leak"][0])
        self._state = np.zeros((2, self._moving.size))
        self._inputs = np.zeros(len(bench.channels))
        self._moved_m = np.zeros(self._moving.size)
        self._output_v = np.zeros(1)

    def update(self, rows: Rows) -> None:
        """Update the peaks by a chunk of rows, lost samples as zeros. The displacement is integrated as the tick does."""
        largest(rows["inputs"], rows["output_v"], self._inputs, self._output_v)
        moved(rows["inputs"], self._moving, self._gain, self._keep, self._state, self._moved_m)

    def shares(self) -> dict[str, float]:
        """Return every peak over its limit."""
        limits, channels = self._bench.limits, self._bench.channels
        out = {"voltage": float(self._output_v[0]) / limits.voltage_v}
        for i, channel in enumerate(channels):
            if channel.role == "monitor":
                continue
            limit = limits.force_n if channel.role == "force" else limits.acceleration_m_s2
            quantity = "force" if channel.role == "force" else "acceleration"
            out[f"{quantity} {channel.name}"] = float(self._inputs[i]) / limit
            out[f"range {channel.name}"] = float(self._inputs[i]) / channel.range_in_unit
        for i, most_m in zip(self._moving, self._moved_m, strict=True):
            out[f"displacement {channels[i].name}"] = float(most_m) / limits.displacement_m
        return out


@kernel
def largest(inputs: Float, output_v: Float, most: Float, most_v: Float) -> None:
    """Raise ``most`` [n_channels] and ``most_v`` [1] to the sizes in ``inputs`` [n, n_channels] and ``output_v`` [n]."""
    for k in range(inputs.shape[0]):
        most_v[0] = max(most_v[0], abs(output_v[k]))
        for c in range(inputs.shape[1]):
            size = abs(inputs[k, c])
            if size > most[c]:  # false for a lost one
                most[c] = size


@kernel
def moved(inputs: Float, moving: Int, gain: float, keep: float, state: Float, most: Float) -> None:
    """Integrate the accelerations twice, each time with a leak, and raise ``most`` [k] to the size of the displacement.

    ``inputs`` [n, n_channels]; ``moving`` [k] are the channels; ``state`` [2, k] is that of the filter
    ``gain^2 / (1 - keep / z)^2`` in transposed direct form II, as `rig.tick.safety.kernels` computes it.
    """
    for j in range(moving.size):
        first, second, channel = state[0, j], state[1, j], moving[j]
        peak = most[j]
        for k in range(inputs.shape[0]):
            value = float(inputs[k, channel])
            if math.isnan(value):
                value = 0.0
            y = gain * gain * value + first
            first = 2.0 * keep * y + second
            second = -keep * keep * y
            peak = max(peak, abs(y))
        state[0, j], state[1, j], most[j] = first, second, peak
