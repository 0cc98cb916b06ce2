"""Nonlinear modes drawn by their standard errors.

The modal frequencies and damping ratios are drawn about their values, independently at each level. An error of the
mass-normalised drive shape is common to all levels and cancels at the drive point: q, phi_d and z change so that the
predicted displacement per force remains the same.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identification.errors import IdentificationError
from identification.nonlinear.nonlinear_modes import NonlinearMode

_LEAST_SHARE = 0.05
"""Least damping ratio of a draw over its value. Chosen."""


def drawn_modes(mode: NonlinearMode, count: int, seed: int) -> Iterator[NonlinearMode]:
    """Yield ``count`` draws of the mode; raise `IdentificationError` if a level has no standard error."""
    for name in ("modal_frequency_std_hz", "damping_ratio_std"):
        if not np.all(np.isfinite(getattr(mode, name))):
            raise IdentificationError("unknown at some level, the band cannot be had without it", field=name)
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield _drawn(mode, random)


def _drawn(mode: NonlinearMode, random: np.random.Generator) -> NonlinearMode:
    """Return one draw of the mode; damping ratios stay above a twentieth of their value."""
    levels = mode.force_n.size
    moved = mode.damping_ratio_std * random.standard_normal(levels)
    return replace(
        mode,
        modal_frequency_hz=mode.modal_frequency_hz + mode.modal_frequency_std_hz * random.standard_normal(levels),
        damping_ratio=np.maximum(mode.damping_ratio + moved, _LEAST_SHARE * mode.damping_ratio),
        damping_ratio_total_power=np.maximum(
            mode.damping_ratio_total_power + moved, _LEAST_SHARE * mode.damping_ratio_total_power
        ),
    )
