"""Convert a backbone to a table with one row per point, and back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification import Backbone, Channel, PeriodicVibration
from rig.text.contents import Contents


def backbone_parts(backbone: Backbone) -> Contents:
    """Return the arrays over the points, including derived quantities (force, amplitude, lag) for the reader."""
    points, channels = backbone.points, backbone.channels
    arrays: dict[str, Any] = {
        "frequency_hz": backbone.frequency_hz,
        "force_n": backbone.force_n,
        "amplitude_m": backbone.amplitude_m,
        "phase_lag_deg": np.array([point.phase_lag_deg for point in points]),
        "phase_lag_target_deg": np.array([point.phase_lag_target_deg for point in points]),
        "periods": np.array([point.periods for point in points]),
        "settled": np.array([int(point.settled) for point in points]),
        "harmonics": np.array([point.harmonics for point in points]),
        "residual_rms": np.array([point.residual_rms for point in points]),
    }
    for name in ("harmonics_std", "drift", "rounding_std"):
        values = [getattr(point, name) for point in points]
        if any(value is not None for value in values):
            like = np.full_like(next(value for value in values if value is not None), np.nan)
            arrays[name] = np.array([like if value is None else value for value in values])
    attributes = {
        "channels": [vars(channel) for channel in channels],
        "specimen": backbone.specimen,
        "drive_mode_shape": backbone.drive_mode_shape,
        "drive_mode_shape_std": backbone.drive_mode_shape_std,
        "drive_mode_shape_source": backbone.drive_mode_shape_source,
        "directions": list(backbone.directions),
        "repeats": list(backbone.repeats),
        "warnings": [list(point.warnings) for point in points],
    }
    names = tuple(channel.name for channel in channels)
    units = np.array([channel.unit for channel in channels])
    orders = tuple(str(order) for order in range(points[0].harmonics.shape[1]))
    harmonic, single = ("harmonics", "harmonics_std", "rounding_std"), ("residual_rms", "drift")
    return Contents(
        kind="backbone",
        title=backbone.specimen,
        arrays=arrays,
        attributes=attributes,
        rows=dict.fromkeys(arrays, 0),
        units={**dict.fromkeys(harmonic, units[:, None]), "residual_rms": units, "drift": "1"},
        labels={**dict.fromkeys(harmonic, (names, orders)), **dict.fromkeys(single, (names,))},
    )


def backbone_from(arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> Backbone:
    """Convert the output of `backbone_parts` back; raise `IdentificationError`, KeyError or TypeError if it does not fit."""
    channels = tuple(Channel(**channel) for channel in attributes["channels"])
    count = len(arrays["frequency_hz"])
    warnings = attributes.get("warnings") or [()] * count
    points = tuple(
        PeriodicVibration(
            channels,
            float(arrays["frequency_hz"][row]),
            arrays["harmonics"][row],
            int(arrays["periods"][row]),
            arrays["residual_rms"][row],
            _known(arrays.get("harmonics_std"), row),
            _known(arrays.get("drift"), row),
            phase_lag_target_deg=float(arrays["phase_lag_target_deg"][row]),
            settled=bool(arrays["settled"][row]),
            warnings=tuple(warnings[row]),
            rounding_std=_known(arrays.get("rounding_std"), row),
        )
        for row in range(count)
    )
    shape = attributes.get("drive_mode_shape")
    directions, repeats = attributes.get("directions", ()), attributes.get("repeats", ())
    return Backbone(
        points,
        attributes["specimen"],
        shape,
        tuple(directions),
        tuple(repeats),
        attributes.get("drive_mode_shape_std"),
        attributes.get("drive_mode_shape_source", ""),
    )


def _known(values: Any, row: int) -> Any:
    """Return a row of values; None if there are no values or the row is NaN."""
    return None if values is None or np.all(np.isnan(values[row])) else values[row]
