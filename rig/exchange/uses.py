"""Values of a file that a mapping takes, and what the mapping says of each."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import identification as i
    from identification.mapping import MeasurementMapping


@dataclass(frozen=True)
class Use:
    """A value of a file that a mapping takes, and the unit that it says."""

    where: str
    """Key of the mapping, for messages."""
    path: str
    unit: str
    """Unit that the mapping says; empty if it says none."""
    file: str = ""
    """Name of the further file that holds it; empty for the one that is imported."""
    within: str = ""
    """Path of the list of structures in which the path begins; empty for the whole file."""
    column: int = 0
    """Number of its column in an array of several channels, from 1; 0 if the mapping takes all columns as one channel."""
    rescaled: bool = False
    """Whether the mapping makes another quantity of it."""
    stored: bool = False
    """Whether the mapping holds against what the file says of it."""
    amplitude: bool = False
    """Whether it is an amplitude, which may be in decibels of its unit."""
    or_unit: str = ""
    """Another unit that says the same: that of the output of a frequency response."""


def instants_of(mapping: "MeasurementMapping") -> tuple[str, str, str]:
    """Return path and unit of the instants that a mapping takes, and the path of the list that holds them; empty for none."""
    import identification as i

    if isinstance(mapping, i.MultisineMapping):
        return mapping.time or "", mapping.time_unit, mapping.realisations or ""
    if isinstance(mapping, i.TimeDataMapping | i.HammerTestMapping):
        return mapping.time or "", mapping.time_unit, mapping.records or ""
    return "", "", ""


def uses_of(mapping: "MeasurementMapping") -> Iterator[Use]:
    """Yield the values that a mapping takes."""
    import identification as i

    against = mapping.against_file
    time, time_unit, within = instants_of(mapping)
    if time:
        yield Use("time", time, time_unit, within=within, stored=against)
    if isinstance(mapping, i.BackboneMapping | i.NonlinearModeMapping | i.ResponseMatrixMapping):
        unit = getattr(mapping, "frequency_unit", None) or ""
        yield Use("frequency_unit", mapping.frequency, unit, stored=against)
    if isinstance(mapping, i.TimeDataMapping):
        for sampled in mapping.channels:
            column = sampled.index if "channel" in mapping.axes_of(sampled) else 0
            for use in _of_channel(sampled, sampled.value, within):
                yield replace(use, column=column, file=sampled.file, rescaled=sampled.scale != 1.0)
    elif isinstance(mapping, i.MultisineMapping | i.HammerTestMapping | i.BackboneMapping):
        for channel in mapping.channels:
            rescaled = isinstance(mapping, i.HammerTestMapping) and getattr(channel, "scale", 1.0) != 1.0
            yield from (replace(use, rescaled=rescaled) for use in _of_channel(channel, channel.value, within))
    elif isinstance(mapping, i.ResponseMatrixMapping):
        yield from _of_responses(mapping)
    elif isinstance(mapping, i.FrequencyResponseMapping):
        yield from _of_levels(mapping)
    elif isinstance(mapping, i.NonlinearModeMapping):
        yield from _of_mode(mapping)


def _of_channel(channel: Any, value: Any, within: str) -> Iterator[Use]:
    use = Use(f"channels.{channel.name}.unit", "", channel.unit, within=within, stored=channel.against_file)
    yield from [replace(use, path=value)] if isinstance(value, str) else _of_parts(use, value)


def _of_parts(use: Use, value: Any) -> Iterator[Use]:
    """Yield the parts of complex numbers, each as ``use`` would be."""
    for part in ("real", "imaginary", "amplitude"):
        if (path := getattr(value, part)) is not None:
            yield replace(use, path=path, amplitude=part == "amplitude")
    if value.phase is not None:
        where = f"{use.where.removesuffix('.unit')}.phase_unit"
        yield replace(use, path=value.phase, where=where, unit=value.phase_unit or "", or_unit="", rescaled=False)


def _of_responses(mapping: "i.ResponseMatrixMapping") -> Iterator[Use]:
    """Yield the frequency responses of a mapping, each in the unit of its output over that of its input."""
    units = {channel.name: channel.unit for channel in (*mapping.outputs, *mapping.inputs)}
    for number, one in enumerate(mapping.paths):
        above, below = units.get(one.output, ""), units.get(one.input, "")
        use = Use(f"paths[{number}].value", "", f"({above})/({below})", or_unit=above)
        yield from [replace(use, path=one.value)] if isinstance(one.value, str) else _of_parts(use, one.value)
    if mapping.matrix is not None:
        above_all, below_all = {one.unit for one in mapping.outputs}, {one.unit for one in mapping.inputs}
        alike = len(above_all) == len(below_all) == 1
        above = next(iter(above_all)) if alike else ""
        unit = f"({above})/({next(iter(below_all))})" if alike else ""
        yield Use("matrix", mapping.matrix, unit, or_unit=above, stored=mapping.against_file)


def _of_levels(mapping: "i.FrequencyResponseMapping") -> Iterator[Use]:
    units, phase = mapping.units, mapping.phase
    for group in mapping.sets:
        about = Use("", "", "", within=group.levels or "", stored=mapping.against_file)
        for key, path, unit in (
            ("frequency", group.frequency, units.frequency),
            ("force", group.force, units.force),
            ("response", group.response, units.response),
        ):
            yield replace(about, where=f"units.{key}", path=path, unit=unit, amplitude=key == "response")
        if group.phase is not None:
            yield replace(about, where="phase.unit", path=group.phase, unit=phase.unit if phase else "")


def _of_mode(mapping: "i.NonlinearModeMapping") -> Iterator[Use]:
    for key, path, unit in (
        ("damping_unit", mapping.damping, mapping.damping_unit),
        ("amplitude_unit", mapping.amplitude, mapping.amplitude_unit),
        ("force_unit", mapping.force, mapping.force_unit),
    ):
        if path is not None:
            yield Use(key, path, unit, stored=mapping.against_file)
