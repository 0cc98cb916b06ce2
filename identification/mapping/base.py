"""What all mappings share."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from identification.channels import Channel, Role
from identification.errors import IdentificationError
from identification.mapping.nested import numbers, value_at
from identification.mapping.units import UNITS, si_of

__all__ = ["ChannelMapping", "ComplexPaths", "MappingTable", "Path", "PhaseUnit", "complex_at", "in_si"]

Path = Annotated[str, Field(min_length=1)]
PhaseUnit = Literal["deg", "rad"]
Complex = NDArray[np.complex128]


class MappingTable(BaseModel):
    """Base of every part of a mapping: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class ChannelMapping(MappingTable):
    """A channel of the measurement and the unit that its numbers are stored in."""

    name: Annotated[str, Field(min_length=1)]
    """Name of the channel from now on."""
    role: Role
    """``force``, ``drive`` (motion where the force acts), ``response`` or ``monitor`` (such as a voltage)."""
    unit: str
    """Unit of the stored numbers."""

    @model_validator(mode="after")
    def _known(self) -> "ChannelMapping":
        if self.role != "monitor" and self.unit not in UNITS:
            raise ValueError(f"unit = '{self.unit}' of channel '{self.name}': allowed is one of {', '.join(UNITS)}")
        return self


class ComplexPaths(MappingTable):
    """Where complex numbers are: real and imaginary part, or amplitude and phase."""

    real: Path | None = None
    """Path of the real parts."""
    imaginary: Path | None = None
    """Path of the imaginary parts."""
    amplitude: Path | None = None
    """Path of the amplitudes."""
    phase: Path | None = None
    """Path of the phases, positive ahead; left out: zero."""
    phase_unit: PhaseUnit = "deg"
    """Unit of the phases."""

    @model_validator(mode="after")
    def _one_way(self) -> "ComplexPaths":
        parts = self.real is not None and self.imaginary is not None
        if parts == (self.amplitude is not None) or (parts and self.phase is not None):
            raise ValueError("give real and imaginary, or amplitude with or without phase")
        return self


def in_si(channels: Sequence[ChannelMapping]) -> tuple[tuple[Channel, ...], NDArray[np.float64]]:
    """Channels in SI, and the factor of each to it; monitors in unknown units keep them."""
    found, factors = [], []
    for channel in channels:
        monitor = channel.role == "monitor" and channel.unit not in UNITS
        unit, factor = (channel.unit, 1.0) if monitor else si_of(channel.unit, f"unit of channel '{channel.name}'")
        found.append(Channel(channel.name, channel.role, unit))
        factors.append(factor)
    return tuple(found), np.array(factors)


def complex_at(data: Any, paths: str | ComplexPaths, ndim: int, where: str) -> Complex:
    """Complex numbers by their path or paths, as a vector (``ndim`` 1) or a matrix (2)."""

    def at(path: str) -> NDArray[Any]:
        return numbers(value_at(data, path, where), ndim, f"{where} '{path}'")

    if isinstance(paths, str):
        return np.asarray(at(paths), dtype=np.complex128)
    if paths.real is not None and paths.imaginary is not None:
        parts = at(paths.real), at(paths.imaginary)
    else:
        assert paths.amplitude is not None
        amplitude = at(paths.amplitude)
        parts = amplitude, np.zeros_like(amplitude) if paths.phase is None else at(paths.phase)
    if parts[0].shape != parts[1].shape:
        raise IdentificationError(f"{where}: unequal lengths ({parts[0].shape} and {parts[1].shape})")
    if paths.real is not None:
        return np.asarray(parts[0] + 1j * parts[1])
    turn = np.radians(parts[1]) if paths.phase_unit == "deg" else parts[1]
    return np.asarray(parts[0] * np.exp(1j * turn))
