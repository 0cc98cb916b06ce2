"""Choose the shapes of a linear modal analysis with which the motion of a backbone is converted to a modal amplitude.

With the tested mode alone, ``q`` is the least-squares projection of the measured shape on its shape. Every further mode
removes its own contribution, but amplifies the errors of channels and shapes as far as its shape resembles the tested one. On
the shipped rigs, with three channels each, the tested mode alone gives errors of 0.003 % (one-sided magnet beam) and 0.014 %
(friction beam) at the highest level. With the next mode in frequency the errors grow 1.8 and 1.1 times, with two further
modes 11 and 9 times, without benefit. Only modes near in frequency are therefore added: they respond to the same force nearly
as strongly as the tested mode.
"""

from collections.abc import Sequence

import numpy as np

from identification.backbones import Backbone
from identification.errors import IdentificationError
from identification.linear.mode_shapes import ModeShapes, mac
from identification.linear.modes import LinearModes
from vibrolock.arrays import Float

_NEAR = 0.25  # relative distance in frequency up to which other modes are included in the shapes
_FURTHEST = 0.1  # largest relative distance in frequency of the tested mode from the lowest level of the backbone
_CLEARLY = 3.0  # the next mode must be this many times farther away
_SAME = 0.005  # modes closer than this, relative, cannot be distinguished by frequency
_LARGEST_GAIN = 5.0  # largest amplification of errors by modes with similar shapes
_UNLIKE = 0.9  # MAC at the lowest level below which the channels are suspect


def shapes_for(
    modes: LinearModes, backbone: Backbone, mode: int | None = None
) -> tuple[ModeShapes, int, tuple[str, ...]]:
    """Return the shapes at the common channels of backbone and modal model, the index of the tested mode, and notes.

    ``mode`` is the index of the tested mode; if None, the mode nearest to the frequency of the lowest level.

    Raises `IdentificationError` if no mode or more than one fits, the drive point is missing or a different channel,
    or the channels cannot distinguish the modes.
    """
    tested = _tested(modes, backbone, mode)
    channels, notes = _common(modes, backbone)
    rows = [[c.name for c in modes.channels].index(name) for name in channels]
    near = np.abs(modes.frequency_hz / modes.frequency_hz[tested] - 1.0) <= _NEAR
    columns = [tested, *(int(k) for k in np.flatnonzero(near) if k != tested)]
    listed = ", ".join(f"{modes.frequency_hz[k]:.4g}" for k in columns)
    if len(columns) > len(channels):
        raise IdentificationError(
            f"{len(columns)} closely spaced ones ({listed} Hz), {len(channels)} common channels "
            f"({', '.join(channels)}) cannot tell them apart; measure at more points",
            field="modes",
        )
    shapes = modes.shapes[np.ix_(rows, columns)]
    if (gain := _error_gain(shapes)) > _LARGEST_GAIN:
        reason = f"{listed} Hz look alike at {', '.join(channels)} (errors grow {gain:.0f} times"
        allowed = f"{_LARGEST_GAIN:g})"
        raise IdentificationError(reason, field="modes", allowed=allowed, hint="measure where their shapes differ")
    found = ModeShapes(
        channels, shapes, 0, modes.shapes_std[np.ix_(rows, columns)], _shape_covariance(modes, rows, columns)
    )
    return found, tested, (*notes, *_unlike(found, backbone))


def _tested(modes: LinearModes, backbone: Backbone, mode: int | None) -> int:
    count = modes.frequency_hz.size
    if mode is not None:
        IdentificationError.unless_between("mode", mode, 0, count - 1)
        return mode
    start_hz = float(backbone.frequency_hz[int(np.argmin(backbone.amplitude_m))])
    away = np.abs(modes.frequency_hz / start_hz - 1.0)
    nearest, *others = np.argsort(away).tolist()
    listed = ", ".join(f"{f:.5g}" for f in modes.frequency_hz)
    if away[nearest] > _FURTHEST:
        raise IdentificationError(
            f"none lies within {100 * _FURTHEST:g} % of {start_hz:.5g} Hz, where the backbone begins "
            f"({listed} Hz are there); give mode= if one of them is the tested one",
            field="modes",
        )
    if others and away[others[0]] < max(_CLEARLY * away[nearest], _SAME):
        raise IdentificationError(
            f"the backbone begins at {start_hz:.5g} Hz, near to {modes.frequency_hz[nearest]:.5g} and "
            f"{modes.frequency_hz[others[0]]:.5g} Hz alike; say by mode= which of them is tested",
            field="modes",
        )
    return int(nearest)


def _common(modes: LinearModes, backbone: Backbone) -> tuple[tuple[str, ...], list[str]]:
    """Return the names of the motions that both have, in the backbone's order, and notes on the other channels."""
    known = {channel.name: channel.role for channel in modes.channels}
    motions = [channel for channel in backbone.channels if channel.role in ("drive", "response")]
    drive = next(channel.name for channel in motions if channel.role == "drive")
    if known.get(drive) != "drive":
        have = modes.channels[modes.drive_row].name
        raise IdentificationError(
            f"the backbone's drive point is '{drive}', the modal model's is '{have}'; both must be the same "
            "channel of the same name",
            field="modes",
        )
    names = tuple(channel.name for channel in motions if channel.name in known)
    notes = [
        f"channel '{name}' is not in the modal model: left out of modal amplitude and MAC; repeat the modal test with it, "
        "or give it the same name in both"
        for name in (channel.name for channel in motions)
        if name not in known
    ]
    return names, notes


def _shape_covariance(modes: LinearModes, rows: Sequence[int], columns: Sequence[int]) -> Float | None:
    """Covariance of the chosen shape values, row by row; None where it is not known."""
    if modes.covariance is None:
        return None
    count = modes.frequency_hz.size
    at = (2 * count + count * np.asarray(rows)[:, None] + np.asarray(columns)).ravel()
    chosen = modes.covariance[np.ix_(at, at)]
    return np.asarray(chosen) if np.isfinite(chosen).all() else None


def _error_gain(shapes: Float) -> float:
    norms = np.linalg.norm(shapes, axis=0)
    if np.linalg.matrix_rank(shapes / norms) < shapes.shape[1]:
        return float(np.inf)
    return float(np.linalg.norm(np.linalg.pinv(shapes)[0]) * norms[0])


def _unlike(shapes: ModeShapes, backbone: Backbone) -> Sequence[str]:
    """Return a note if the lowest level does not match the linear shape: units mixed, channels swapped or reversed."""
    point = backbone.points[int(np.argmin(backbone.amplitude_m))]
    measured = shapes.fundamental_m(point)
    likeness = mac(shapes.tested, measured)
    if likeness >= _UNLIKE or len(shapes.channels) < 2:
        return ()
    drive = shapes.channels.index(next(c.name for c in backbone.channels if c.role == "drive"))
    factors = np.real(measured / measured[drive]) / (shapes.tested / shapes.tested[drive])
    off = np.abs(np.log(np.abs(factors) + 1e-300)) + (factors < 0.0)
    worst = int(np.argmax(off))
    return (
        f"the lowest level does not look like the linear mode (MAC {likeness:.3f}); channel '{shapes.channels[worst]}' "
        f"moves {factors[worst]:.3g} times what its shape says: check its unit, sensitivity, polarity, and that no "
        "channels are swapped",
    )
