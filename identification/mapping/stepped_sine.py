"""Import measured frequency responses in other formats as `FrequencyResponse`.

A mapping states where values are in a nested structure (as ``scipy.io.loadmat(..., simplify_cells=True)`` returns it) and
what they mean: units, peak or RMS, which motion the phases belong to, and their sign. It is a small pydantic model that the
user writes as TOML.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from identification.channels import MOTION_ORDER, MOTION_UNIT, Motion
from identification.errors import IdentificationError
from identification.frequency_responses import Controlled, FrequencyResponse
from identification.mapping.base import (
    MappingTable,
    MeasurementMapping,
    Path,
    Positive,
    as_levels,
    numbers,
    one_of,
    said_of,
    value_at,
)
from identification.mapping.units import si_of
from vibrolock.arrays import Complex

_FREQUENCY: dict[str, float] = {"Hz": 1.0, "rad/s": 1.0 / (2.0 * np.pi)}
_MOTION: dict[str, Motion] = {unit: motion for motion, unit in MOTION_UNIT.items()}


class Units(MappingTable):
    """Units of the stored numbers."""

    frequency: Literal["Hz", "rad/s"]
    """Unit of the frequencies."""
    force: Literal["N", "mN", "kN", "lbf", "kgf"]
    """Unit of the forces."""
    response: Literal["m", "mm", "um", "in", "m/s", "mm/s", "in/s", "m/s2", "m/s^2", "mm/s2", "in/s2", "g"]
    """Unit of the response amplitudes; it also says whether they are displacement, velocity or acceleration."""
    amplitude_unit: Literal["linear", "dB"] | None = None
    """``dB`` for responses in decibels, ``20 log10`` of the amplitude in ``response``; if left out, as the file says of the
    values, also by the end of the name of the column (``X [dB]``), else linear."""
    values: Literal["peak", "rms"]
    """Whether forces, responses and level values are stored as peak or as RMS."""


class PhaseConvention(MappingTable):
    """Meaning of the stored phases."""

    unit: Literal["deg", "rad"]
    """Unit of the phases."""
    of: Motion
    """The motion whose phase against the force is stored; need not be the quantity whose amplitude is stored."""
    sense: Literal["response-minus-force", "force-minus-response"]
    """Sign of the phase: ``response-minus-force`` falls from 0 to -180 degrees through a displacement resonance."""


class LevelSet(MappingTable):
    """Levels that were measured the same way.

    Each field is the path of an array in the file: names joined by dots, with ``[3]`` for the fourth entry of a list. If
    ``levels`` names a list with one entry a level, the other paths start at each entry of that list. Otherwise they start at
    the root of the file, and each column of a two-dimensional array is one level.
    """

    levels: Path | None = None
    """Path of the list of levels."""
    frequency: Path
    """Path of the frequencies."""
    force: Path
    """Path of the force amplitudes, or complex forces."""
    response: Path
    """Path of the response amplitudes; of complex responses if ``phase`` is left out."""
    phase: Path | None = None
    """Path of the phases between force and response."""
    controlled: Controlled
    """Quantity that the controller held constant."""
    level_values: tuple[Positive, ...] = ()
    """Nominal value of each level, in the unit of the controlled quantity; if left out, the median of the measured values."""
    label: str = "{value:g} {unit}"
    """Name of each level; ``{value}``, ``{unit}`` (SI, peak) and ``{number}`` (from 1) are filled in."""


class FrequencyResponseMapping(MeasurementMapping):
    """The whole mapping: where values are in the file and what they mean."""

    kind: Literal["frequency-responses"] = "frequency-responses"
    units: Units
    """Units of the stored numbers."""
    phase: PhaseConvention | None = None
    """Meaning of the stored phases; needed if a set names a path of phases."""
    sets: Annotated[tuple[LevelSet, ...], Field(min_length=1)]
    """The levels, in groups."""


def map_frequency_responses(data: Any, mapping: FrequencyResponseMapping) -> tuple[FrequencyResponse, ...]:
    """Return the frequency responses in ``data``, in the order of the mapping.

    The result is in SI units and peak values; the phase of the force is zero unless complex forces are stored.

    Raises `IdentificationError` if a path does not exist, or a shape or number does not fit; the message names set,
    level and path.

    Parameters
    ----------
    data
        Nested dictionaries, lists and arrays.
    mapping
        Where the values are in ``data`` and what they mean.
    """
    found: list[FrequencyResponse] = []
    for number, group in enumerate(mapping.sets):
        where = f"sets[{number}]"
        if group.phase is not None and mapping.phase is None:
            raise IdentificationError("the mapping has no [phase] table", field=f"{where}.phase", value=group.phase)
        levels = _levels(data, group, where)
        if group.level_values and len(group.level_values) != len(levels):
            reason = f"{len(group.level_values)} given, the data has {len(levels)} levels"
            raise IdentificationError(reason, field=f"{where}.level_values")
        said = "dB" if said_of(data, group.response).lower().startswith("db") else ""
        unit = one_of(mapping.units.amplitude_unit, said, "linear", "units.amplitude_unit", group.response)
        for index, level in enumerate(levels):
            if unit == "dB" and not np.iscomplexobj(level["response"]):
                level["response"] = 10.0 ** (level["response"] / 20.0)
            found.append(_response(level, index, group, mapping, where))
    return tuple(found)


def _levels(data: Any, group: LevelSet, where: str) -> Sequence[dict[str, NDArray[Any]]]:
    paths = {name: getattr(group, name) for name in ("frequency", "force", "response", "phase")}
    paths = {name: path for name, path in paths.items() if path is not None}

    def arrays(entry: Any, ndim: int, level: str) -> dict[str, NDArray[Any]]:
        told = {name: f"{where}.{name}{level}" for name in paths}
        return {
            name: numbers(value_at(entry, path, told[name]), ndim, f"{told[name]} '{path}'")
            for name, path in paths.items()
        }

    if group.levels is not None:
        entries = as_levels(value_at(data, group.levels, f"{where}.levels"), f"{where}.levels '{group.levels}'")
        return [arrays(entry, 1, f", level {k}") for k, entry in enumerate(entries, 1)]
    stored = arrays(data, 2, "")
    columns = {array.shape[1] for array in stored.values()} - {1}
    if len(columns) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in stored.items())
        raise IdentificationError(f"{where}: arrays have different numbers of columns ({shapes})")
    count = columns.pop() if columns else 1
    return [{name: array[:, min(k, array.shape[1] - 1)] for name, array in stored.items()} for k in range(count)]


def _response(
    stored: dict[str, NDArray[Any]], index: int, group: LevelSet, mapping: FrequencyResponseMapping, where: str
) -> FrequencyResponse:
    """Return one level in SI units and peak values, with the phase in the convention of `FrequencyResponse`."""
    units = mapping.units
    peak = np.sqrt(2.0) if units.values == "rms" else 1.0
    unit, response_scale = si_of(units.response, "units.response")
    kind, force_scale = _MOTION[unit], si_of(units.force, "units.force")[1]
    sizes = {name: array.size for name, array in stored.items()}
    if len(set(sizes.values())) > 1:
        raise IdentificationError(f"{where}, level {index + 1}: unequal lengths ({sizes})")
    if (group.phase is None) != np.iscomplexobj(stored["response"]):
        state = "left out, but '{}' holds real" if group.phase is None else "given, but '{}' holds complex"
        raise IdentificationError(f"is {state.format(group.response)} numbers", field=f"{where}.phase")
    for name in ("force", "response"):
        if not np.iscomplexobj(stored[name]) and np.any(stored[name] < 0.0):
            raise IdentificationError(
                f"{where}.{name}, level {index + 1}: an amplitude is below zero; check the path; amplitudes in "
                'decibels need units.amplitude_unit = "dB"'
            )
    force = np.asarray(stored["force"] * (force_scale * peak), dtype=np.complex128)
    response = np.asarray(stored["response"] * (response_scale * peak), dtype=np.complex128)
    if group.phase is not None and mapping.phase is not None:
        force, response = np.abs(force) + 0j, np.abs(response) * _turn(stored["phase"], mapping.phase, kind)
    scales: dict[Controlled, tuple[float, float, str]] = {
        "force": (force_scale * peak, float(np.median(np.abs(force))), "N"),
        "response": (response_scale * peak, float(np.median(np.abs(response))), unit),
        "voltage": (1.0, float(index + 1), "V"),
        "none": (1.0, float(index + 1), ""),
    }
    scale, measured, level_unit = scales[group.controlled]
    level = group.level_values[index] * scale if group.level_values else measured
    try:
        label = group.label.format(value=level, unit=level_unit, number=index + 1).strip()
        frequency_hz = stored["frequency"] * _FREQUENCY[units.frequency]
        return FrequencyResponse(
            frequency_hz, force, response, kind, group.controlled, level, label, specimen=mapping.specimen
        )
    except (AttributeError, KeyError, IndexError, ValueError) as error:
        raise IdentificationError.of(error, where=f"{where}, level {index + 1}") from None


def _turn(phase: NDArray[Any], convention: PhaseConvention, kind: Motion) -> Complex:
    """``exp(i (arg Y - arg F))`` of the motion ``kind`` from stored phases."""
    angle = np.radians(phase) if convention.unit == "deg" else phase
    if convention.sense == "force-minus-response":
        angle = -angle
    quarter_turns = MOTION_ORDER[kind] - MOTION_ORDER[convention.of]
    return np.asarray(np.exp(1j * angle) * 1j**quarter_turns, dtype=np.complex128)
