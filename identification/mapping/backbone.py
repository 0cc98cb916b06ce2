"""Import backbones from elsewhere, given as a table of fundamentals, as `Backbone`."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from identification.backbones import Backbone
from identification.errors import IdentificationError
from identification.mapping.base import ChannelMapping, ComplexPaths, Path, SpectrumMapping, complex_at, in_si
from identification.measurements import PeriodicVibration


class FundamentalMapping(ChannelMapping):
    """A channel and its fundamental at every point."""

    value: Path | ComplexPaths
    """Path of complex numbers, or paths of their parts; columns of a matrix are the harmonics 1, 2, ..."""


class BackboneMapping(SpectrumMapping):
    """Where a backbone is in the data and what its values mean."""

    kind: Literal["backbone"]
    values: Literal["peak", "rms"]
    """Whether amplitudes are stored as peak or as RMS."""
    periods: Annotated[int, Field(ge=1)] = 1
    """Number of periods from which every point was computed."""
    drive_mode_shape: float | None = None
    """Mass-normalised shape of the tested mode at the drive point, kg^-1/2."""
    channels: Annotated[tuple[FundamentalMapping, ...], Field(min_length=2)]
    """The channels: one of role ``force``, one ``drive``."""


def map_backbone(data: Any, mapping: BackboneMapping) -> Backbone:
    """Return the backbone in ``data`` in SI units and peak values, without static parts, standard errors and residuals.

    Raises `IdentificationError` if a path does not exist, lengths differ, values are NaN, or roles are missing.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the quantities lie, in which units.
    """
    frequency = mapping.frequency_hz(data)
    channels, factors = in_si(mapping.channels)
    stored = [complex_at(data, c.value, 2, f"channels.{c.name}") for c in mapping.channels]
    for channel, values in zip(channels, stored, strict=True):
        if len(values) != frequency.size:
            reason = f"{len(values)} points for {frequency.size} frequencies"
            raise IdentificationError(reason, field=f"channels.{channel.name}")
    width = max(values.shape[1] for values in stored)
    harmonics = np.zeros((frequency.size, len(channels), width + 1), dtype=np.complex128)
    scale = np.sqrt(2.0) if mapping.values == "rms" else 1.0
    for row, values in enumerate(stored):
        harmonics[:, row, 1 : values.shape[1] + 1] = values * (factors[row] * scale)
    if mapping.sense == "exp(-iwt)":
        harmonics = np.conj(harmonics)
    points = []
    for number, (hz, values) in enumerate(zip(frequency, harmonics, strict=True)):
        try:
            points.append(PeriodicVibration(channels, float(hz), values, mapping.periods, np.zeros(len(channels))))
        except IdentificationError as error:
            raise IdentificationError.of(error, where=f"point {number + 1}") from None
    return Backbone(tuple(points), mapping.specimen, mapping.drive_mode_shape)
