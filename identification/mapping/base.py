"""Common parts of all mappings: tables of settings, channels, values by path in nested data, units."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from identification.channels import Channel, Role
from identification.errors import IdentificationError
from identification.mapping.units import UNITS, si_of
from vibrolock.arrays import Complex
from vibrolock.described import Described

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")
_PATH = re.compile(r"([^.\[\]]+|\[\d+\])(\.[^.\[\]]+|\[\d+\])*")
Path = Annotated[str, Field(min_length=1)]
PhaseUnit = Literal["deg", "rad"]


def value_at(data: Any, path: str, where: str) -> Any:
    """Return the value at ``path`` (``a.b[2].c``) in ``data``.

    If the path does not exist, raises `IdentificationError` with ``where`` and the names that exist.
    """
    if isinstance(data, Mapping) and path in data:
        return data[path]  # a name that itself contains dots or brackets
    if not _PATH.fullmatch(path):
        raise IdentificationError(
            f"{where}: '{path}' is no path; write names joined by dots, with [0] for list entries"
        )
    value = data
    walked = ""
    for match in _STEP.finditer(path):
        name, index = match.groups()
        if name is not None:
            value = _member(value, name, walked, path, where)
            walked += f"{walked and '.'}{name}"
        else:
            value = _entry(value, int(index), walked, path, where)
            walked += f"[{index}]"
    return value


def _member(value: Any, name: str, walked: str, path: str, where: str) -> Any:
    here = f"'{walked}'" if walked else "the top"
    if not isinstance(value, Mapping):
        raise IdentificationError(f"{where}: path '{path}': {here} is {_kind(value)}, has no '{name}'")
    if name not in value:
        there = ", ".join(str(key) for key in value if not str(key).startswith("__")) or "nothing"
        raise IdentificationError(f"{where}: path '{path}': no '{name}' at {here}, which has {there}")
    return value[name]


def _entry(value: Any, index: int, walked: str, path: str, where: str) -> Any:
    here = f"'{walked}'" if walked else "the top"
    if not _is_list(value):
        raise IdentificationError(f"{where}: path '{path}': {here} is {_kind(value)}, has no [{index}]")
    if index >= len(value):
        raise IdentificationError(f"{where}: path '{path}': no [{index}] at {here}, which has {len(value)} entries")
    return value[index]


def as_levels(value: Any, where: str) -> Sequence[Any]:
    """Return ``value`` as a list of structures; a single structure becomes a list of one (MATLAB does not distinguish)."""
    if isinstance(value, Mapping):
        return [value]
    if not _is_list(value):
        raise IdentificationError(f"is {_kind(value)}", where=where, allowed="a list of structures")
    IdentificationError.raise_if(not len(value), "is empty", where=where, allowed="at least one level")
    return list(value)


def numbers(value: Any, ndim: int, where: str) -> NDArray[Any]:
    """Return a numeric array with ``ndim`` dimensions (1: a vector, row or column; 2: one column per level)."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise IdentificationError("is a list of unequal lengths", where=where, allowed="numbers") from None
    if array.dtype.kind not in "iufc":
        raise IdentificationError(f"is {_kind(value)}", where=where, allowed="numbers")
    if ndim == 1 and array.ndim <= 2 and array.size == max(array.shape, default=1):
        return array.reshape(-1)
    if ndim == 2 and array.ndim <= 1:
        return array.reshape(-1, 1)
    if ndim == 2 and array.ndim == 2:
        return array.T if array.shape[0] == 1 else array
    raise IdentificationError(f"has shape {array.shape}", where=where, allowed="a vector" if ndim == 1 else "a matrix")


def _is_list(value: Any) -> bool:
    return value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, list | tuple)


def _kind(value: Any) -> str:
    if isinstance(value, Mapping):
        return "a structure"
    if isinstance(value, str | bytes):
        return "text"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}" if value.dtype.kind in "iufc" else "a list"
    return f"a {type(value).__name__}"


class MappingTable(Described):
    """Base of every part of a mapping: frozen, unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class ChannelMapping(MappingTable):
    """A channel of the measurement and the unit of its stored numbers."""

    name: Annotated[str, Field(min_length=1)]
    """Name of the channel after import."""
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
    """Paths of complex numbers: real and imaginary part, or amplitude and phase."""

    real: Path | None = None
    """Path of the real parts."""
    imaginary: Path | None = None
    """Path of the imaginary parts."""
    amplitude: Path | None = None
    """Path of the amplitudes."""
    phase: Path | None = None
    """Path of the phases, positive if leading; zero if left out."""
    phase_unit: PhaseUnit = "deg"
    """Unit of the phases."""

    @model_validator(mode="after")
    def _one_way(self) -> "ComplexPaths":
        parts = self.real is not None and self.imaginary is not None
        if parts == (self.amplitude is not None) or (parts and self.phase is not None):
            raise ValueError("give real and imaginary, or amplitude with or without phase")
        return self


def in_si(channels: Sequence[ChannelMapping]) -> tuple[tuple[Channel, ...], NDArray[np.float64]]:
    """Return the channels in SI units and the factors that convert to them; monitors in unknown units keep their units."""
    found, factors = [], []
    for channel in channels:
        monitor = channel.role == "monitor" and channel.unit not in UNITS
        unit, factor = (channel.unit, 1.0) if monitor else si_of(channel.unit, f"unit of channel '{channel.name}'")
        found.append(Channel(channel.name, channel.role, unit))
        factors.append(factor)
    return tuple(found), np.array(factors)


def complex_at(data: Any, paths: str | ComplexPaths, ndim: int, where: str) -> Complex:
    """Return the complex numbers at a path or pair of paths, as a vector (``ndim`` 1) or a matrix (2)."""

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
