"""Round trips of pings, as many as are worth keeping."""

import numpy as np

__all__ = ["RoundTrips"]

KEPT = 4096


class RoundTrips:
    """The last few thousand round trips; `report` gives their median and 99th percentile in microseconds."""

    def __init__(self) -> None:
        self._kept_s = np.zeros(KEPT)
        self._count = 0

    def add(self, round_trip_s: float) -> None:
        """One more."""
        self._kept_s[self._count % KEPT] = round_trip_s
        self._count += 1

    def report(self) -> dict[str, float]:
        """Median, 99th percentile and largest; empty before the first."""
        if not self._count:
            return {}
        kept_us = 1e6 * self._kept_s[: min(self._count, KEPT)]
        p50, p99, largest = np.percentile(kept_us, (50.0, 99.0, 100.0))
        return {
            "round_trip_p50_us": round(float(p50), 1),
            "round_trip_p99_us": round(float(p99), 1),
            "round_trip_largest_us": round(float(largest), 1),
            "round_trips": float(self._count),
        }
