"""Volts to the device's counts and back."""

import numpy as np

from rig.drivers.wire.facts import DeviceFacts

__all__ = ["Scaling"]


class Scaling:
    """The scales of a device, for blocks of one size."""

    def __init__(self, facts: DeviceFacts, block: int) -> None:
        self._counts_per_v = np.full(block, 1.0 / facts.output_v_per_count)
        self._v_per_count = facts.v_per_count.copy()
        beyond = 2.0 ** (facts.bits - 1)
        self._lowest, self._highest = np.full(block, -beyond), np.full(block, beyond - 1.0)
        self._dtype = np.dtype(f"<i{facts.bits // 8}")
        self._scaled = np.empty(block)

    def to_counts(self, voltages: np.ndarray) -> np.ndarray:
        """The nearest counts [n] of the output's converter."""
        scaled = self._scaled
        np.multiply(voltages, self._counts_per_v, out=scaled)
        np.rint(scaled, out=scaled)
        np.maximum(scaled, self._lowest, out=scaled)  # both in a third of the time of np.clip
        np.minimum(scaled, self._highest, out=scaled)
        return scaled.astype(self._dtype)

    def to_volts(self, counts: np.ndarray, inputs: np.ndarray) -> None:
        """Readings in volts, into ``inputs`` [n, n_channels]."""
        np.multiply(counts, self._v_per_count, out=inputs)
