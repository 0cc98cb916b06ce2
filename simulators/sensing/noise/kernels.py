"""Compiled counter-based normal random numbers: each number depends only on key and sample index.

A run therefore gives the same samples however it is cut into blocks, and channels are independent of each other. The method is
a ziggurat of 256 layers (Marsaglia & Tsang 2000). The 53 bits of the number are separate from the bits of the layer index, as
recommended by Doornik (2005). The distribution is exact, and 99 % of the numbers cost one hash, one table look-up and one
comparison.
"""

import math

import numpy as np
from numpy.typing import NDArray

from vibrolock.compiled import inner_kernel, kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # increment of SplitMix64 (Steele, Lea & Flood 2014)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)  # first multiplier of its output function
_MIX_2 = np.uint64(0x94D049BB133111EB)  # second multiplier
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)  # its shifts, bits; the last leaves 53
_LAYER = np.uint64(255)  # mask of the bits that choose one of the layers

LAYERS = 256  # of the ziggurat, as in Marsaglia & Tsang (2000)
TAIL = 3.6541528853610088
"""Start of the tail, chosen so that all layers have the same area and the last layer ends at the maximum of the density."""


def _edges() -> NDArray[np.float64]:
    """Return the right edges of the ziggurat's layers [LAYERS + 1], the base first, for the density ``exp(-x^2 / 2)``."""
    area = TAIL * math.exp(-0.5 * TAIL**2) + math.sqrt(0.5 * math.pi) * math.erfc(TAIL / math.sqrt(2.0))
    edges = np.zeros(LAYERS + 1)
    edges[0] = area * math.exp(0.5 * TAIL**2)  # a rectangle with the area of the base and its tail
    edges[1] = TAIL
    for layer in range(1, LAYERS - 1):
        edges[layer + 1] = math.sqrt(-2.0 * math.log(area / edges[layer] + math.exp(-0.5 * edges[layer] ** 2)))
    return edges


EDGES = _edges()
HEIGHTS = np.exp(-0.5 * EDGES**2)
"""Density at the edges; a layer lies between two neighbouring heights."""


@kernel
def mix(value: np.uint64) -> np.uint64:
    """Return a 64-bit hash by the output function of SplitMix64 (Steele, Lea & Flood 2014)."""
    value = (value ^ (value >> _30)) * _MIX_1
    value = (value ^ (value >> _27)) * _MIX_2
    return value ^ (value >> _31)


@kernel
def unit(bits: np.uint64) -> float:
    """Return a number within (0, 1) from the upper 53 bits."""
    return float((float(bits >> _11) + 0.5) * 2.0**-53)


@kernel
def rejected(bits: np.uint64, layer: np.int64, x: float) -> tuple[float, np.uint64, bool]:
    """Accept or reject a number outside the part of its layer that lies wholly under the density.

    In the base layer, draw a number from the tail by Marsaglia's exponential method. In other layers, accept the number if a
    height drawn within the layer is under the density. Return the number, the last bits used, and whether to accept it.
    """
    bits = mix(bits + _GOLDEN)
    if layer > 0:
        height = HEIGHTS[layer] + unit(bits) * (HEIGHTS[layer + 1] - HEIGHTS[layer])
        return x, bits, height < math.exp(-0.5 * x * x)
    while True:
        beyond = -math.log(unit(bits)) / TAIL
        bits = mix(bits + _GOLDEN)
        if -2.0 * math.log(unit(bits)) > beyond * beyond:
            return (TAIL + beyond if x > 0.0 else -TAIL - beyond), bits, True
        bits = mix(bits + _GOLDEN)


@kernel
def normal_beyond(bits: np.uint64, layer: np.int64, x: float) -> float:
    """Return a normal number, starting from a first candidate that `rejected` has to judge."""
    while True:
        x, bits, taken = rejected(bits, layer, x)
        if taken:
            return float(x)
        bits = mix(bits + _GOLDEN)
        layer = np.int64(bits & _LAYER)
        x = float(np.int64(bits) >> 11) * 2.0**-52 * EDGES[layer]
        if abs(x) < EDGES[layer + 1]:
            return float(x)


@inner_kernel
def normal(key: np.uint64, sample: int) -> float:
    """Return the standard normal number of a key and a sample index."""
    bits = mix(key + np.uint64(sample) * _GOLDEN)
    layer = np.int64(bits & _LAYER)
    x = float(np.int64(bits) >> 11) * 2.0**-52 * EDGES[layer]
    if abs(x) < EDGES[layer + 1]:
        return float(x)
    return normal_beyond(bits, layer, x)
