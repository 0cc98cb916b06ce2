"""Normal modes in the datasets of a universal file."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import Channel, LinearModes
from rig.exchange.child_reading import ImportFailed
from rig.exchange.uff.codes import channels_in
from rig.exchange.uff.reading import Dataset
from rig.exchange.uff.units import file_units


def modes_in(datasets: Sequence[Dataset], assumed: str = "", drive: str = "") -> LinearModes:
    """Return the normal modes (dataset 55, analysis type 2), mass-normalised by their modal mass.

    ``drive`` is the driven degree of freedom (``1+Z``), required if the file was not written by this package. Raises
    `ImportFailed` if there are no modes or no drive point, for modal masses that are not above zero, and for complex shapes.
    """
    modes = sorted((d for d in datasets if d["type"] == 55 and d["analysis_type"] == 2), key=lambda d: d["freq"])
    if not modes:
        raise ImportFailed(
            "no normal mode (dataset 55 of analysis type 2) in the file; complex modes are not understood"
        )
    first = modes[0]
    to_kg = file_units(datasets, assumed).mass_factor(first["where"])
    for mode in modes:
        if list(mode["node_nums"]) != list(first["node_nums"]):
            raise ImportFailed(f"{mode['where']}: its nodes are not those of the first mode")
        if np.iscomplexobj(mode["r1"]) or mode["modal_m"] <= 0.0:
            raise ImportFailed(
                f"{mode['where']}: modal mass {mode['modal_m']:g}, wanted is a real shape and a modal mass above zero; "
                "export the modes with their modal masses"
            )
    columns = np.array([[mode[axis] for axis in ("r1", "r2", "r3")] for mode in modes])  # mode, direction, node
    told = channels_in([first[f"id{line}"] for line in (3, 4, 5)])
    if told is not None and len(told) == columns.shape[2]:
        channels, shapes = told, columns[:, 2].T
    else:
        channels, shapes = _degrees(first["node_nums"], columns, drive)
    shapes = shapes / np.sqrt([mode["modal_m"] * to_kg for mode in modes])
    row = next(index for index, channel in enumerate(channels) if channel.role == "drive")
    shapes = shapes * np.where(shapes[row] < 0.0, -1.0, 1.0)
    return _linear_modes(modes, channels, shapes, first)


def _degrees(nodes: Any, columns: Any, drive: str) -> tuple[tuple[Channel, ...], Any]:
    """Return channels and shapes of all degrees of freedom that move in any mode."""
    moving = [(k, j) for j in range(columns.shape[2]) for k in range(3) if np.any(columns[:, k, j])]
    names = [f"{int(nodes[j])}+{'XYZ'[k]}" for k, j in moving]
    if drive not in names:
        raise ImportFailed(f"`drive`: is '{drive}', which says where the force acts; allowed are {', '.join(names)}")
    channels = tuple(Channel(name, "drive" if name == drive else "response", "m") for name in names)
    return channels, np.array([columns[:, k, j] for k, j in moving])


def _linear_modes(modes: Sequence[Dataset], channels: tuple[Channel, ...], shapes: Any, first: Dataset) -> LinearModes:
    unknown, nothing = np.full(len(modes), np.nan), np.zeros(len(channels), dtype=np.complex128)
    frequency_hz = np.array([mode["freq"] for mode in modes])
    return LinearModes(
        channels=channels,
        frequency_hz=frequency_hz,
        frequency_std_hz=unknown,
        damping_ratio=np.array([mode["modal_damp_vis"] for mode in modes]),
        damping_ratio_std=unknown,
        shapes=shapes,
        shapes_std=np.full_like(shapes, np.nan),
        phase_collinearity=unknown,
        lower=nothing,
        upper=nothing,
        lowest_hz=float(frequency_hz[0]),
        highest_hz=float(frequency_hz[-1]),
        specimen="" if first["id2"] == "NONE" else first["id2"],
        notes=("from a universal file: six digits, without residual terms and standard errors",),
    )
