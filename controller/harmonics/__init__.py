"""The harmonics loop: drives harmonics of the output so that those of the measured force take their wanted values.

The output is ``u = U Re[exp(i (theta + phase))] + Re[sum_h V_h exp(i h theta)]`` with a complex V_h for each harmonic 2 to H.
An adaptive filter estimates the force's harmonics F_h in the oscillator's phase. Near a steady vibration
``F_h = D_h + P_h V_h``: D_h comes from structure and exciter, P_h is the plant from output to force at that harmonic. One
complex integral law for each harmonic acts through it, with the wanted G_h:

    ``dV_h/dt = -k (F_h - G_h)/P_h``

k and the filter's corner are fractions of the oscillator's frequency, so that they suit any structure. P_h is measured once the
vibration is locked and steady, by a small step of all harmonics at once, and again where an error does not decay. A harmonic
whose plant cannot be told from noise is left alone. Not modelled: a change of one harmonic changes the others through the
structure's nonlinearity; the integral laws take that for a disturbance.

The idea to make an exciter's force a sine by feedback through adaptive filters is that of arXiv 2410.17830.
"""

from typing import TYPE_CHECKING

from vibrolock.on_use import on_use

if TYPE_CHECKING:
    from controller.adaptive_filter import MOST_HARMONICS as MOST_HARMONICS
    from controller.harmonics.law import (
        drive_harmonics as drive_harmonics,
        harmonics_at as harmonics_at,
        measure_harmonics as measure_harmonics,
        want_harmonics as want_harmonics,
    )
    from controller.harmonics.periods import end_harmonics_period as end_harmonics_period, left_alone as left_alone
    from controller.harmonics.records import ORDERS as ORDERS, HarmonicStage as HarmonicStage
    from controller.harmonics.settings import (
        HarmonicsSettings as HarmonicsSettings,
        check_wanted as check_wanted,
        harmonic_ratios as harmonic_ratios,
    )
else:
    __getattr__, __dir__, __all__ = on_use(__name__)
