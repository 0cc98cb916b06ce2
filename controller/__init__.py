"""The control law of a phase-locked vibration test: numbers in, numbers out."""

from controller.amplitude import AmplitudeLaw
from controller.detector import Detector
from controller.force import ForceLoop
from controller.frequency import FrequencyLaw
from controller.law import Law, OpenLoop, control_state
from controller.lock import LockRule, LockState
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
    "control_state",
    "preset",
]
