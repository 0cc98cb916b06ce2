"""What a rig that cannot be tuned is refused with."""

from rig.errors import RigError

__all__ = ["TuningError"]


class TuningError(RigError):
    """A rig cannot be tuned: its test says nothing, or no gains suit it; the message has the numbers."""
