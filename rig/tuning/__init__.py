"""Automatic tuning of a rig: a low-level multisine, the plant, gains with their margins, and a plan that uses them."""

from rig.tuning.plant import TuningError
from rig.tuning.trials import try_plan
from rig.tuning.tuning import Tuning, TuningRequest, tune

__all__ = ["Tuning", "TuningError", "TuningRequest", "try_plan", "tune"]
