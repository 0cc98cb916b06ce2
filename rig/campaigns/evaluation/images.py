"""Images of the held output in the force of a point, where the anti-alias filter, if any, does not keep them out.

A driver that knows them says which error of the force they are, by resonance and per volt (`rig.daq.Image`). It hardly depends
on the level. The force at phase resonance goes with the damping, so that the error of the damping is that of the part of the
force that is a quarter period ahead of the displacement. It is not corrected: it counts as a systematic standard error of the
force's fundamental, and so in all that is identified from it.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rig.bench import Bench
from rig.campaigns.evaluation.point import Modal, Point, Spectrum
from rig.campaigns.evaluation.vibrations import channels_of, vibration_from
from rig.daq import IMAGES_ACCEPTED, Image

TOLD = 0.01
"""Share of the damping above which a point has a warning; chosen."""


def with_images(bench: Bench, point: Point[object], images: Sequence[Image], *, damping: bool) -> Point[object]:
    """Add the error by images of the held output to a point with modal properties.

    Standard errors of force, damping and frequency include it. Above 1 % of the damping it is a warning, above 10 % the point
    is refused; of a test that does not ask for ``damping``, it is a note. A point is returned as it is if the driver knows no
    ``images``.
    """
    if not images or point.modal is None or point.vibration is None or point.vibration.spectrum is None:
        return point
    vibration, spectrum = point.vibration, point.vibration.spectrum
    image = min(images, key=lambda one: abs(one.frequency_hz - vibration.frequency_hz))
    error_n = complex(image.in_phase_n_per_v, image.ahead_n_per_v) * vibration.voltage_v
    measured = vibration_from(point, channels_of(bench))
    force, moved = measured.force[1], measured.drive_m[1]
    ahead = force * moved.conjugate()
    if not ahead.imag > 0.0:  # no power from the exciter: no damping
        return point
    turn = 1j * abs(ahead) / ahead  # from the frame of a force at phase resonance to that of this one
    share = error_n / (abs(force) * ahead.imag / abs(ahead))
    out = replace(
        point,
        vibration=replace(vibration, spectrum=_with_error(spectrum, bench.index_of("force"), error_n * turn)),
        modal=_modal(point.modal, share),
    )
    return _judged(out, share.real, damping=damping)


def _with_error(spectrum: Spectrum, force: int, error: complex) -> Spectrum:
    """Add a systematic error, in phase with the fundamental of a channel and ahead of it, to its standard errors."""
    if spectrum.harmonics_std is None:
        return spectrum
    zeros = np.zeros(spectrum.harmonics.shape, np.complex128)
    systematic = (zeros if spectrum.rounding_std is None else spectrum.rounding_std).copy()
    before = systematic[force, 1]
    systematic[force, 1] = complex(math.hypot(before.real, error.real), math.hypot(before.imag, error.imag))
    std = spectrum.harmonics_std.copy()
    std[force, 1] = math.hypot(std[force, 1], abs(error) / math.sqrt(2.0))  # of real and imaginary part alike
    return replace(spectrum, harmonics_std=std, rounding_std=systematic)


def _modal(modal: Modal, share: complex) -> Modal:
    """Add the error to the standard errors of modal properties that have one; ``share``: error over the force that damps."""
    damping, damping_std, hz_std = modal.damping_ratio, modal.damping_ratio_std, modal.modal_frequency_std_hz
    if damping is None:
        return modal
    if damping_std is not None:
        damping_std = math.hypot(damping_std, damping * share.real)
    if hz_std is not None:
        hz_std = math.hypot(hz_std, modal.modal_frequency_hz * damping * share.imag)
    return replace(modal, damping_ratio_std=damping_std, modal_frequency_std_hz=hz_std)


def _judged(point: Point[object], share: float, *, damping: bool) -> Point[object]:
    if not abs(share) > TOLD:
        return point
    said = f"{100.0 * share:.3g} % of the damping"
    if damping and point.accepted and abs(share) > IMAGES_ACCEPTED:
        return point.refused(
            f"images of the held output are {said}, accepted up to {100.0 * IMAGES_ACCEPTED:g} %: an anti-alias filter "
            "ahead of the inputs, or a steeper or lower one, keeps them out; without one, `oversample = 4` in the bench"
        )
    text = (
        f"images of the held output ({said}): they alias onto the force where no anti-alias filter keeps them out, or not all "
        f"of them; the standard errors include it (warning above {100.0 * TOLD:g} %)"
    )
    return point.warned(text) if damping else replace(point, notes=(*point.notes, text))
