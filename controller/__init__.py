"""The control law of a phase-locked vibration test: numbers in, numbers out."""

from controller.law import Law, OpenLoop
from controller.layout import AmplitudeLaw, Detector, ForceLoop, FrequencyLaw, LockState
from controller.lock.rule import LockRule
from controller.pll import PhaseLockedLoop
from controller.presets import preset

__all__ = [
    "AmplitudeLaw",
    "Detector",
    "ForceLoop",
    "FrequencyLaw",
    "Law",
    "LockRule",
    "LockState",
    "OpenLoop",
    "PhaseLockedLoop",
    "preset",
]
