"""How the vibration goes on, in plain integers and as the protocol's page says it: an outside judge of the firmware."""

from collections.abc import Sequence
from fractions import Fraction

STEP = 65536
"""Steps of a period in a sample."""


class Vibration:
    """Outputs of a host, and what a device puts out where one is missing.

    Everything that was handed over since ARM is kept; no ring, no reuse of a result.
    """

    def __init__(self, longest: int) -> None:
        self.longest = longest
        self.outputs: dict[int, int] = {}
        self.arm(0)

    def arm(self, instant: int) -> None:
        self.armed = instant
        self._forget()

    def _forget(self) -> None:
        self.run: tuple[int, int] | None = None
        self.source: tuple[int, int, int] | None = None

    def keep(self, first: int, counts: Sequence[int], period: int, ramp: int) -> None:
        end = first + len(counts)
        self.outputs.update(zip(range(first, end), counts, strict=True))
        if not 4 * STEP <= period <= self.longest * STEP:
            self._forget()
            return
        if self.run is not None and first < self.run[1]:
            return
        if self.source is not None and end > self.source[0] + self.longest:
            self.source = None
        if self.run is None or first > self.run[1]:
            self.run = max(first, self.armed), end
        self.run = self.run[0], end
        if end - self.run[0] >= period // STEP + 4:
            self.source = end, period, ramp

    def place(self, instant: int) -> tuple[int, int]:
        """Where in the source an instant is: an index, and steps behind it."""
        assert self.source is not None
        end, period, _ = self.source
        return divmod((end - 2) * STEP - period + (instant - end + 2) * STEP % period, STEP)

    def exact(self, instant: int) -> Fraction:
        """The cubic of Lagrange at an instant, before rounding, bounds and ramp."""
        at, part = self.place(instant)
        x, out = Fraction(part, STEP), Fraction(0)
        for one in (-1, 0, 1, 2):
            weight = Fraction(1)
            for other in {-1, 0, 1, 2} - {one}:
                weight *= (x - other) / (one - other)
            out += weight * self.outputs[at + one]
        return out

    def count(self, instant: int) -> int | None:
        """What is put out at an instant whose output is missing; None: the one before, held."""
        if self.source is None:
            return None
        end, period, ramp = self.source
        b, f = self.place(instant)
        p, q, r, s = (self.outputs[index] for index in range(b - 1, b + 3))
        c0, c1, c2, c3 = 6 * q, -2 * p - 3 * q + 6 * r - s, 3 * p - 6 * q + 3 * r, -p + 3 * q - 3 * r + s
        v = 256 * c3
        for c in (c2, c1, c0):
            v = (v * f >> 16) + 256 * c
        whole = [self.outputs[index] for index in range(end - (period >> 16) - 4, end)]
        y = min(max((v + 768) // 1536, min(whole)), max(whole))
        if ramp == 0:
            return y
        left = ramp - (instant - end)
        if left <= 0:
            return 0
        g = min(1 << 30, (left << 30) // (ramp + end - b))
        size = ((abs(y) * g >> 30) * g) >> 30
        return size if y > 0 else -size
