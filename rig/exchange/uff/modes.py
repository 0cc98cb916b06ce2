"""Normal modes in the datasets of a universal file."""

from collections.abc import Sequence

import numpy as np

from identification import Channel, LinearModes
from rig.exchange.child_reading import ImportFailed
from rig.exchange.uff.codes import channels_in
from rig.exchange.uff.units import file_units
from rig.exchange.universal_file import UniversalFile
from vibrolock.arrays import Float


def modes_in(file: UniversalFile, assumed: str = "", drive: str = "") -> LinearModes:
    """Return the normal modes (dataset 55, analysis type 2), mass-normalised by their modal mass.

    ``drive`` is the driven degree of freedom (``1+Z``), required if the file was not written by this package. Raises
    `ImportFailed` if there are no modes or no drive point, for modal masses that are not above zero, and for complex shapes.
    """
    modes = sorted(file.modes, key=lambda mode: mode.frequency_hz)
    if not modes:
        raise ImportFailed(
            "no normal mode (dataset 55 of analysis type 2) in the file; complex modes are not understood"
        )
    first = modes[0]
    to_kg = file_units(file, assumed).mass_factor(first.where)
    for mode in modes:
        if mode.nodes != first.nodes:
            raise ImportFailed(f"{mode.where}: its nodes are not those of the first mode")
        if np.iscomplexobj(mode.shape) or mode.modal_mass <= 0.0:
            raise ImportFailed(
                f"{mode.where}: modal mass {mode.modal_mass:g}, expected a real shape and a modal mass above zero; "
                "export the modes with their modal masses"
            )
    columns = np.array([np.real(mode.shape) for mode in modes])  # mode, direction, node
    named = channels_in(first.lines[2:])
    if named is not None and len(named) == columns.shape[2]:
        channels, shapes = named, columns[:, 2].T
    else:
        channels, shapes = _degrees(first.nodes, columns, drive)
    shapes = shapes / np.sqrt([mode.modal_mass * to_kg for mode in modes])
    row = next(index for index, channel in enumerate(channels) if channel.role == "drive")
    shapes = shapes * np.where(shapes[row] < 0.0, -1.0, 1.0)
    others = file.shapes - len(modes)
    left_out = (f"left out of the universal file: shapes that are no normal modes ({others})",) if others else ()
    unknown, nothing = np.full(len(modes), np.nan), np.zeros(len(channels), dtype=np.complex128)
    frequency_hz = np.array([mode.frequency_hz for mode in modes])
    return LinearModes(
        channels=channels,
        frequency_hz=frequency_hz,
        frequency_std_hz=unknown,
        damping_ratio=np.array([mode.damping_ratio for mode in modes]),
        damping_ratio_std=unknown,
        shapes=shapes,
        shapes_std=np.full_like(shapes, np.nan),
        phase_collinearity=unknown,
        lower=nothing,
        upper=nothing,
        lowest_hz=float(frequency_hz[0]),
        highest_hz=float(frequency_hz[-1]),
        specimen="" if first.lines[1] == "NONE" else first.lines[1],
        notes=(*left_out, "from a universal file: six digits, without residual terms and standard errors"),
    )


def _degrees(nodes: Sequence[int], columns: Float, drive: str) -> tuple[tuple[Channel, ...], Float]:
    """Return channels and shapes of all degrees of freedom that move in any mode."""
    moving = [(k, j) for j in range(columns.shape[2]) for k in range(3) if np.any(columns[:, k, j])]
    names = [f"{nodes[j]}+{'XYZ'[k]}" for k, j in moving]
    if drive not in names:
        raise ImportFailed("which says where the force acts", field="drive", value=drive, allowed=names)
    channels = tuple(Channel(name, "drive" if name == drive else "response", "m") for name in names)
    return channels, np.array([columns[:, k, j] for k, j in moving])
