"""Tuning a rig by itself: a low-level multisine, the plant, gains with their margins, and a plan that uses them."""

from rig.tuning.plant import TuningError
from rig.tuning.tuning import Tuning, TuningRequest, tune

__all__ = ["Tuning", "TuningError", "TuningRequest", "tune"]
