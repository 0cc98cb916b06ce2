"""Excited lines and detection lines of a multisine; detection lines show nonlinear distortion.

Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., section 4.3: under odd excitation an
even nonlinearity appears only at even lines, an odd one only at odd lines. A random few odd lines are therefore not excited.
"""

from typing import Literal, get_args

import numpy as np

from identification.errors import IdentificationError
from vibrolock.arrays import Int

Grid = Literal["full", "odd", "odd-random"]

_APART = 2**32 - 1  # a key that no realisation has


def check_grid(grid: str, detection_group: int, grid_seed: int) -> None:
    """Raise `IdentificationError` if the grid is unknown, or if the group or the seed is out of its range."""
    IdentificationError.unless_one_of("grid", grid, get_args(Grid))
    if detection_group < 2:
        raise IdentificationError(field="detection_group", value=detection_group, allowed="at least 2 odd lines")
    IdentificationError.raise_if(grid_seed < 0, field="grid_seed", value=grid_seed, allowed="zero or more")


def excited_lines(band: Int, grid: Grid, detection_group: int, grid_seed: int) -> Int:
    """int[n]: the excited lines of ``band``; empty if there is none, or if ``odd-random`` finds no complete group.

    ``odd-random`` leaves out one of every ``detection_group`` odd lines in turn; an incomplete last group is fully excited.
    """
    if grid == "full":
        return band
    odd: Int = band[band % 2 == 1]
    if grid == "odd":
        return odd
    groups = odd.size // detection_group
    if not groups:
        return odd[:0]
    random = np.random.default_rng(np.random.SeedSequence(grid_seed, spawn_key=(_APART,)))
    silent = np.arange(groups) * detection_group + random.integers(0, detection_group, groups)
    return np.asarray(np.delete(odd, silent))
