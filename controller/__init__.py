"""The control law of a phase-locked vibration test: numbers in, numbers out. The names below are imported on first use."""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from controller.amplitude import AmplitudeLaw
    from controller.detector import Detector
    from controller.force import ForceLoop
    from controller.frequency import FrequencyLaw
    from controller.law import Law, OpenLoop, control_state
    from controller.lock import LockRule, LockState
    from controller.pll import PhaseLockedLoop
    from controller.presets import preset
else:
    __getattr__, __dir__ = on_use(
        __name__,
        {
            "AmplitudeLaw": "amplitude",
            "Detector": "detector",
            "ForceLoop": "force",
            "FrequencyLaw": "frequency",
            "Law": "law",
            "LockRule": "lock",
            "LockState": "lock",
            "OpenLoop": "law",
            "PhaseLockedLoop": "pll",
            "control_state": "law",
            "preset": "presets",
        },
    )

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
