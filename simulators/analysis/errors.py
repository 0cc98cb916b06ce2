"""What can go wrong with a harmonic balance."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from simulators.analysis.responses import PeriodicResponses

__all__ = ["NotConvergedError"]


class NotConvergedError(ArithmeticError):
    """No periodic vibration was found where one was asked for: the level is out of reach, or the path ends.

    The message says where. ``found`` holds the points that were found before, in the order asked for; it is None where
    there are none.
    """

    def __init__(self, message: str, found: "PeriodicResponses | None" = None) -> None:
        super().__init__(message)
        self.found = found
