"""The control law of a phase-locked vibration test: numbers in, numbers out."""

from controller.law import Law, OpenLoop
from controller.layout import AmplitudeLaw, Detector, LockState
from controller.pll import LockRule, PhaseLockedLoop, preset

__all__ = ["AmplitudeLaw", "Detector", "Law", "LockRule", "LockState", "OpenLoop", "PhaseLockedLoop", "preset"]
