"""The loops that hold a force by setting the voltage: linear as in the paper, or on logarithms."""

import math
from enum import IntEnum
from typing import Literal

import numpy as np
from pydantic import Field

from controller.primitives import log_proportional_integral, log_ratio, proportional_integral
from controller.settings import Settings
from vibrolock.arrays import record
from vibrolock.compiled import Record, kernel


class ForceLoop(IntEnum):
    """How a force is held."""

    LINEAR = 0
    """PI law from the force error to the voltage: K3, K4 of the paper."""
    LOGARITHMIC = 1
    """PI law from the logarithm of the force ratio to the logarithm of the voltage: it acts alike at every level."""
    THROUGH_RESPONSE = 2
    """The active force sets the level of the response, which is held by its own loop (`controller.through_response`)."""


LINEAR, LOGARITHMIC, THROUGH_RESPONSE = (int(loop) for loop in ForceLoop)
LOOPS = {
    "linear": ForceLoop.LINEAR,
    "logarithmic": ForceLoop.LOGARITHMIC,
    "through-response": ForceLoop.THROUGH_RESPONSE,
}

FORCE_LOOP = record(i8="loop", f8="k3 k4 kp ki smallest_v largest_v dt_s")
"""Parameters of the force loops (one record): K3 and K4 of the linear loop, kp and ki of the logarithmic loop."""

FORCE_LOOP_STATE = record(f8="integral", c16="log_integral")
"""State of the force loops (one record): integral of the linear loop (V) and of the logarithmic loop."""


class ForceSettings(Settings):
    """How a force is held."""

    force_loop: Literal["linear", "logarithmic", "through-response"] = "linear"
    """How a force is held: ``linear`` (K3, K4 of the paper), ``logarithmic`` (the same on logarithms: alike at every level),
    or ``through-response``: the active force sets the level of the response, which its own loop holds."""
    k3: float = Field(0.0, ge=0, le=1e4)
    """K3 of the paper: proportional gain of the linear force loop, V/N."""
    k4: float = Field(0.0, ge=0, le=1e4)
    """K4 of the paper: integral gain of the linear force loop, V/(N s); above 0 where the loop holds a level."""
    force_proportional: float = Field(0.3, ge=0, le=100)
    """Proportional gain of the logarithmic force loop, ln V per ln N."""
    force_integral_per_s: float = Field(2.0, gt=0, le=1e4)
    """Integral gain of the logarithmic force loop, 1/s."""

    def build_force(self, smallest_v: float, largest_v: float, dt_s: float) -> np.ndarray:
        """Return one record of `FORCE_LOOP` for an output from ``smallest_v`` to ``largest_v``."""
        out = np.zeros(1, FORCE_LOOP)
        out["loop"] = LOOPS[self.force_loop]
        out["k3"], out["k4"] = self.k3, self.k4
        out["kp"], out["ki"] = self.force_proportional, self.force_integral_per_s
        out["smallest_v"], out["largest_v"], out["dt_s"] = smallest_v, largest_v, dt_s
        return out


@kernel
def begin_force(parameters: Record, state: Record, amplitude_v: float) -> None:
    """Start the integrals of both loops at the present output amplitude ``amplitude_v``."""
    state.integral = amplitude_v
    state.log_integral = complex(math.log(min(max(amplitude_v, parameters.smallest_v), parameters.largest_v)), 0.0)


@kernel
def hold_force(parameters: Record, state: Record, wanted_n: float, held_n: float, saturation_sign: int) -> float:
    """Evaluate the linear or the logarithmic loop for one sample: return the output amplitude (V) for the force ``wanted_n``.

    ``saturation_sign``: 1 while the output cannot rise as fast as demanded, -1 while it cannot fall as fast; the integral then
    does not move further in that direction.
    """
    if parameters.loop == LINEAR:
        demanded_v, integral = proportional_integral(
            wanted_n - held_n,
            state.integral,
            parameters.k3,
            parameters.k4,
            parameters.dt_s,
            0.0,
            0.0,
            parameters.largest_v,
        )
        if (integral - state.integral) * saturation_sign <= 0.0:
            state.integral = integral
        return float(demanded_v)
    demanded_v, _, state.log_integral = log_proportional_integral(
        complex(log_ratio(wanted_n, held_n), 0.0),
        state.log_integral,
        complex(parameters.kp, 0.0),
        parameters.ki,
        parameters.dt_s,
        parameters.smallest_v,
        parameters.largest_v,
        saturation_sign,
    )
    return float(demanded_v)
