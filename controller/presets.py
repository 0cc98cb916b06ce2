"""The paper's controller, in both readings of its table of gains.

The paper (Scheel et al., appendix) gives a table of gains, but its text source lacks the diagram of the controller. Two
readings fit the text and its sibling papers. Both are presets, and neither is claimed to be certain:

* reading B, ``two-phase``: force and response are demodulated with the oscillator's phase and low-passed by ``a/(s+a)``;
  the arctangent gives the lag. ``Omega = omega_m + K1 e + K2 int e``; the force loop is ``U = K3 e_F + K4 int e_F``;
* reading A, ``sign``: the product of the signs of force and displacement passes ``K2/(s+a)``, then ``(s+K1)/s``.

The mean of the sign product is ``(2/pi) e``, so that reading A is a PI law on e as well, with ``kp = (2/pi) K2/a`` and
``ki = K1 kp``.
"""

import math
from typing import Literal

from controller.pll import PhaseLockedLoop

_PAPER = {
    # specimen: test -> K1, K2, K3, K4, omega_m (rad/s); a is 2 pi rad/s throughout. Table of the paper's appendix.
    ("magnet-beam", "stepped-phase"): (2.0, 2.0 * math.pi, 1.5, 1.0, 48.0 * math.pi),
    ("magnet-beam", "backbone"): (2.0, 2.0 * math.pi, 0.0, 0.0, 48.0 * math.pi),
    ("friction-beam", "stepped-phase"): (1.0, 10.0 * math.pi, 5.0, 1.0, 300.0 * math.pi),
    ("friction-beam", "backbone"): (1.0, 10.0 * math.pi, 0.0, 0.0, 290.0 * math.pi),
}


def preset(
    specimen: Literal["magnet-beam", "friction-beam"],
    test: Literal["backbone", "stepped-phase"] = "backbone",
    reading: Literal["A", "B"] = "B",
) -> PhaseLockedLoop:
    """Return the paper's controller for a specimen and a test, in reading A (sign detector) or B (two-phase).

    The paper gives no frequency window. This preset uses +-10 % around the specimen's linear frequency (24.37 or 149.0 Hz).

    Parameters
    ----------
    specimen
        ``magnet-beam`` or ``friction-beam``.
    test
        ``backbone``, or ``stepped-phase`` at constant force.
    reading
        Reading of the paper's phase detector: A (sign) or B (two-phase).
    """
    k1, k2, k3, k4, centre = _PAPER[specimen, test]
    linear_hz = {"magnet-beam": 24.37, "friction-beam": 149.0}[specimen]
    return PhaseLockedLoop(
        detector="two-phase" if reading == "B" else "sign",
        low_pass_rad_s=2.0 * math.pi,
        k1=k1,
        k2=k2,
        k3=k3,
        k4=k4,
        centre_frequency_hz=centre / (2.0 * math.pi),
        frequency_window_hz=(0.9 * linear_hz, 1.1 * linear_hz),
    )
