"""Points made by hand."""

import numpy as np

from rig.campaigns.evaluation.point import Modal, Point, Purity, Quality, Spectrum, Vibration


def made_point(level=1.0, level_unit="V", *, quality=Quality.GOOD, **fields):
    """A point at a level; what is not given is as in a point of which nothing is known yet."""
    reason = "" if quality.accepted else "for a test"
    place = {"number": 0, "direction": "up", "repeat": 1, "settled": True, "reason": reason}
    return Point(level=level, level_unit=level_unit, quality=quality, **(place | fields))


def made_vibration(harmonics=None, frequency_hz=24.37, *, std=None, force_n=1.0, amplitude_m=1e-3):
    """A vibration with complex harmonics [channel, h]."""
    spectrum = None
    if harmonics is not None:
        residual = np.zeros(len(harmonics))
        spectrum = Spectrum(harmonics=np.asarray(harmonics), harmonics_std=std, residual_rms=residual, drift=None)
    return Vibration(
        frequency_hz=frequency_hz,
        force_n=force_n,
        amplitude_m=amplitude_m,
        voltage_v=1.0,
        purity=Purity(force_purity=1.0, response_purity=1.0, power_indicator=1.0, harmonic_power=0.0),
        periods=20,
        spectrum=spectrum,
    )


def made_modal(modal_frequency_hz=24.37, damping_ratio=0.004):
    return Modal(modal_frequency_hz=modal_frequency_hz, damping_ratio=damping_ratio)
