"""Times counted in logarithmic bins, in memory that another process may read."""

import math

PER_OCTAVE = 16  # bins: 4.4 % wide; chosen
OCTAVES = 24  # 1 us to 16.8 s
BINS = PER_OCTAVE * OCTAVES + 2  # one bin below the range, one above
LARGEST = BINS
WORDS = BINS + 1
"""Size of a histogram in words of eight bytes."""

_log2 = math.log2


def upper_edge_us(index: int) -> float:
    """Upper edge of a bin, us; infinite for the last."""
    return math.inf if index >= BINS - 1 else 2.0 ** (index / PER_OCTAVE)


class Histogram:
    """Counts in 16 bins per octave (4.4 %) from 1 us on, and the largest time exactly.

    ``words`` holds `WORDS` signed integers of eight bytes, zeros at first. One process counts, any may read.
    """

    def __init__(self, words: "list[int] | memoryview[int] | None" = None) -> None:
        self._words = words if words is not None else [0] * WORDS

    def add(self, nanoseconds: int) -> None:
        """Count one time."""
        words = self._words
        index = 0 if nanoseconds <= 1000 else min(1 + int(PER_OCTAVE * _log2(1e-3 * nanoseconds)), BINS - 1)
        words[index] += 1
        if nanoseconds > words[LARGEST]:
            words[LARGEST] = nanoseconds

    @property
    def count(self) -> int:
        """Number of times counted."""
        return sum(self._words[:BINS])

    @property
    def largest_us(self) -> float:
        """Largest time counted, us."""
        return 1e-3 * self._words[LARGEST]

    def quantile_us(self, share: float) -> float:
        """Return the time (us) that a ``share`` (0 to 1) of all times does not exceed, as upper edge of its bin; 0 if empty."""
        wanted = share * self.count
        seen = 0
        for index in range(BINS):
            seen += self._words[index]
            if self._words[index] and seen >= wanted:
                return min(upper_edge_us(index), self.largest_us)
        return 0.0

    def report(self) -> dict[str, float]:
        """Return the quantiles p50, p99 and p99.9, and the largest time, us."""
        shares = {"p50": 0.5, "p99": 0.99, "p99_9": 0.999}
        out = {name: round(self.quantile_us(share), 2) for name, share in shares.items()}
        return out | {"largest": round(self.largest_us, 2)}

    def bins(self) -> dict[str, list[float]]:
        """Return upper edge (us) and count of every bin that is not empty."""
        held = [index for index in range(BINS) if self._words[index]]
        edges = [round(min(upper_edge_us(index), max(self.largest_us, 1.0)), 3) for index in held]
        return {"upper_edge_us": edges, "count": [self._words[index] for index in held]}
