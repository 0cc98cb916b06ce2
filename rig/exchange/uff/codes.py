"""Codes of the universal file format (SDRC; as documented by the University of Cincinnati, SDRL) and their units."""

from collections.abc import Sequence
from typing import cast

import numpy as np

from identification import Channel
from identification.common import Role
from vibrolock.arrays import Float

DATA_TYPE = {"m": 8, "m/s": 11, "m/s2": 12, "m/s^2": 12, "N": 13, "s": 17, "Hz": 18}
"""Specific data type of a quantity, by its SI unit; 0 means unknown."""

Degree = tuple[int, int]
"""Node and direction."""

_UP = 3  # direction +Z, of all sensors: the bench does not say where they point
_SCALAR = 0  # direction of a quantity without one
_EVEN = 1e-9
"""Relative difference of an abscissa from an even one that counts as none; chosen: rounding errors of double precision."""
WIDTH = 80
"""Number of characters of an ID line."""


def degrees_of_freedom(channels: Sequence[Channel]) -> dict[str, Degree]:
    """Return node and direction of channels by name.

    Motions are numbered from 1 in their order, and the force has the node of the drive point. All other channels follow as
    scalars. All directions are +Z.
    """
    motions = [channel for channel in channels if channel.role in ("drive", "response")]
    out = {channel.name: (number, _UP) for number, channel in enumerate(motions, 1)}
    node = next((out[channel.name][0] for channel in motions if channel.role == "drive"), 0)
    last = len(motions)
    for channel in channels:
        if channel.role == "force" and node:
            out[channel.name] = (node, _UP)
        elif channel.name not in out:
            last += 1
            out[channel.name] = (last, _UP if channel.role == "force" else _SCALAR)
    return out


def axis(prefix: str, label: str, unit: str) -> dict[str, object]:
    """Return the fields of dataset 58 that describe an axis (``abscissa``, ``ordinate``, ``orddenom`` or ``z_axis``)."""
    return {
        f"{prefix}_spec_data_type": DATA_TYPE.get(unit, 0),
        f"{prefix}_axis_lab": label[:20] or "NONE",
        f"{prefix}_axis_units_lab": unit[:20] or "NONE",
    }


def evenly(x: Float) -> bool:
    """Return whether all values follow from the first value and the step as stored in a header (six digits)."""
    if len(x) < 2:
        return bool(float(f"{x[0]:.5e}") == x[0])
    first, step = float(f"{x[0]:.5e}"), float(f"{x[1] - x[0]:.5e}")
    return bool(np.allclose(first + step * np.arange(len(x)), x, rtol=_EVEN, atol=0.0))


def channel_lines(channels: Sequence[Channel]) -> list[str]:
    """Return three ID lines that name the channels of the nodes; ``NONE`` if the names are too long."""
    text = ";".join(f"{channel.name}|{channel.role}|{channel.unit}" for channel in channels)
    if len(text) > 3 * WIDTH or not text.isascii():
        return ["NONE"] * 3
    return [text[start : start + WIDTH] or "NONE" for start in range(0, 3 * WIDTH, WIDTH)]


def channels_in(lines: Sequence[str]) -> tuple[Channel, ...] | None:
    """Parse the output of `channel_lines`; return None for other lines."""
    text = "".join(line.ljust(WIDTH) if line != "NONE" else "" for line in lines).strip()
    parts = [entry.split("|") for entry in text.split(";")]
    if not all(len(part) == 3 for part in parts):
        return None
    return tuple(Channel(name.strip(), cast(Role, role), unit) for name, role, unit in parts)
