"""Common parts of all mappings: tables of settings, channels, values by path in nested data, units."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from identification.channels import Channel, Role
from identification.errors import IdentificationError
from identification.mapping.units import UNITS, is_signal_unit, si_of
from vibrolock.arrays import Complex, Float
from vibrolock.data_sheet import volts_per_unit
from vibrolock.described import Described
from vibrolock.errors import InputError
from vibrolock.quantities import quantity

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")
_IN_BRACKETS = re.compile(r"\S\s*[\[(]([^\[\]()]+)[\])]\s*$")
_PATH = re.compile(r"([^.\[\]]+|\[\d+\])(\.[^.\[\]]+|\[\d+\])*")
Path = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


def value_at(data: Any, path: str, where: str) -> Any:
    """Return the value at ``path`` (``a.b[2].c``) in ``data``; ``.`` is ``data`` itself, an entry of a list of arrays.

    If the path does not exist, raises `IdentificationError` with ``where`` and the names that exist.
    """
    if isinstance(data, Mapping) and path in data:
        return data[path]  # a name that itself contains dots or brackets
    if path == ".":
        return data
    if not _PATH.fullmatch(path):
        reason = f"{where}: '{path}' is not a path; write names joined by dots, with [0] for list entries"
        raise IdentificationError(reason)
    value = data
    walked = ""
    for match in _STEP.finditer(path):
        name, index = match.groups()
        here = f"'{walked}'" if walked else "the top"
        if name is None:
            fits, said = _is_list(value), f"[{index}]"
            missing = fits and int(index) >= len(value)
            there = f"{len(value)} entries" if fits else ""
        else:
            fits, said = isinstance(value, Mapping), f"'{name}'"
            missing = fits and name not in value
            there = ", ".join(str(key) for key in value if not str(key).startswith("__")) if fits else ""
        if not fits:
            raise IdentificationError(f"{where}: path '{path}': {here} is {_kind(value)}, has no {said}")
        if missing:
            raise IdentificationError(f"{where}: path '{path}': no {said} at {here}, which has {there or 'nothing'}")
        value = value[int(index) if name is None else name]
        walked += f"[{index}]" if name is None else f"{walked and '.'}{name}"
    return value


def entries_at(data: Any, path: str | None, key: str) -> Sequence[Any]:
    """Return the structures in a list at ``path``, the value of ``key`` in the mapping; ``data`` itself without a path."""
    return [data] if path is None else as_levels(value_at(data, path, key), f"{key} '{path}'")


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


class MeasurementMapping(MappingTable):
    """Base of the mappings: the kind, and what was tested."""

    kind: str
    specimen: str = ""
    """Name of what was tested."""
    source: str = ""
    """Where the data comes from; for information only."""
    against_file: bool = False
    """Whether the mapping holds where the file says otherwise of its sampling: rates, start times, unit of the instants."""


class ChannelMapping(MappingTable):
    """A channel of the measurement and the unit of its stored numbers."""

    name: Annotated[str, Field(min_length=1)]
    """Name of the channel after import."""
    role: Role
    """``force``, ``drive`` (motion where the force acts), ``response`` or ``monitor`` (such as a voltage)."""
    unit: str
    """Unit of the stored numbers."""
    sensitivity: str = ""
    """Sensitivity of the sensor as on its data sheet, such as ``10 mV/g``, where the stored numbers are volts (``unit`` is V or
    mV)."""
    against_file: bool = False
    """Whether the mapping holds where the file says otherwise of this channel: unit, scale, offset, rate, start time."""

    @model_validator(mode="after")
    def _known(self) -> "ChannelMapping":
        if self.sensitivity:
            volts_per_unit(self.sensitivity)
            if not is_signal_unit(self.unit) or si_of(self.unit, "unit")[0] != "V":
                raise InputError("sensitivity makes volts a quantity", field="unit", value=self.unit, allowed="V or mV")
        if self.role != "monitor" and not is_signal_unit(self.unit):
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
    amplitude_unit: Literal["linear", "dB"] | None = None
    """``dB`` for decibels, ``20 log10`` of the amplitude in the unit of the channels; if left out, as the name of the column
    ends (``H [dB]``), else linear."""
    phase: Path | None = None
    """Path of the phases, positive if leading; zero if left out."""
    phase_unit: Literal["deg", "rad"] | None = None
    """Unit of the phases; if left out, as the name of the column ends (``phase [rad]``), else deg."""

    @model_validator(mode="after")
    def _one_way(self) -> "ComplexPaths":
        parts = self.real is not None and self.imaginary is not None
        if parts == (self.amplitude is not None) or (parts and self.phase is not None):
            raise ValueError("give real and imaginary, or amplitude with or without phase")
        return self


class SpectrumMapping(MeasurementMapping):
    """Base of the mappings of complex numbers over the frequency."""

    frequency: Path
    """Path of the frequencies."""
    frequency_unit: Literal["Hz", "rad/s"] | None = None
    """Unit of the frequencies; if left out, as the name of the column ends (``f [kHz]``), else Hz."""
    sense: Literal["exp(+iwt)", "exp(-iwt)"] = "exp(+iwt)"
    """Convention of the stored complex numbers: with ``exp(+iwt)`` a lagging signal has the smaller phase."""

    def frequency_hz(self, data: Any) -> Float:
        """float[n]: the frequencies in ``data``."""
        stored = np.asarray(numbers(value_at(data, self.frequency, "frequency"), 1, "frequency"), dtype=np.float64)
        found = quantity(said_of(data, self.frequency))
        said = found.si if found is not None and found.si in ("Hz", "rad/s") else ""
        unit = one_of(self.frequency_unit, said, "Hz", "frequency_unit", self.frequency)
        factor = float(found.factor) if said and found is not None else 1.0
        return np.asarray(stored * (factor / (1.0 if unit == "Hz" else 2.0 * np.pi)))


def check_names(channels: Sequence[ChannelMapping]) -> None:
    """Raise `InputError` if two channels have the same name."""
    names = [channel.name for channel in channels]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(f"'{twice}' is the name of two", field="channels", hint="names must differ")


def in_si(channels: Sequence[ChannelMapping]) -> tuple[tuple[Channel, ...], NDArray[np.float64]]:
    """Return the channels in SI units and the factors that convert to them; monitors in unknown units keep their units."""
    found, factors = [], []
    for channel in channels:
        monitor = channel.role == "monitor" and not is_signal_unit(channel.unit)
        unit, factor = (channel.unit, 1.0) if monitor else si_of(channel.unit, f"unit of channel '{channel.name}'")
        if channel.sensitivity:
            volts, measured = volts_per_unit(channel.sensitivity)
            unit, factor = si_of(measured, "sensitivity")[0], factor / volts
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
    return np.asarray(_linear(parts[0], paths, data, where) * np.exp(1j * _radians(parts[1], paths, data, where)))


def _linear(amplitude: NDArray[Any], paths: ComplexPaths, data: Any, where: str) -> NDArray[Any]:
    """Return amplitudes that are stored as such or in decibels; raise `IdentificationError` for negative ones."""
    path = str(paths.amplitude)
    said = "dB" if said_of(data, path).lower().startswith("db") else ""
    unit = one_of(paths.amplitude_unit, said, "linear", f"{where}.amplitude_unit", path)
    if unit == "dB":
        return np.asarray(10.0 ** (amplitude / 20.0))
    if np.any(amplitude < 0.0):
        at = int(np.argmax(amplitude.ravel() < 0.0))
        raise IdentificationError(
            f"amplitude [{at}] of '{path}' is {amplitude.ravel()[at]:g}, below 0",
            field=where,
            hint='amplitudes in decibels need amplitude_unit = "dB"',
        )
    return amplitude


def _radians(phase: NDArray[Any], paths: ComplexPaths, data: Any, where: str) -> NDArray[Any]:
    path = str(paths.phase or "")
    found = quantity(said_of(data, path)) if paths.phase else None
    said = {quantity("deg"): "deg", quantity("rad"): "rad"}.get(found, "") if found is not None else ""
    unit = one_of(paths.phase_unit, said, "deg", f"{where}.phase_unit", path)
    return np.radians(phase) if unit == "deg" else phase


def one_of(given: str | None, said: str, default: str, field: str, path: str) -> str:
    """Return the unit that a mapping gives or else the file says; raise `IdentificationError` if these differ."""
    if given is not None and said and given != said:
        raise IdentificationError(f"the file says {said} of '{path}'", field=field, value=given)
    return given or said or default


def said_of(data: Any, path: str) -> str:
    """Return the unit that a file says of a value, also in brackets at the end of its name; empty if it says none."""
    units = data.get("__units__") if isinstance(data, Mapping) else None
    found = _IN_BRACKETS.search(path)
    return str((units or {}).get(path, "")) or (found[1].strip() if found else "")


def notes_of(data: Any) -> tuple[str, ...]:
    """Return the remarks of the reader of a file on what it read and what it left out."""
    notes = data.get("__notes__", ()) if isinstance(data, Mapping) else ()
    return tuple(map(str, notes))
