"""What a file says of its channels, given to a mapping: the one place where it is used, or refused with a word.

The rule, for every format: what the file says of units, scales, offsets, signs, rates, start times and the unit of its instants
counts. A mapping that says otherwise is refused, and wins by ``against_file = true`` alone: in a channel for what the file says
of that channel, whose numbers are then taken as stored; at the top for rates, start times and the unit of the instants. A
``scale`` other than 1 makes another quantity of the file's numbers, so that the units need not agree. What the file does not
say, the mapping says.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.exchange.child_reading import ImportFailed
from rig.exchange.file_data import ChannelFacts, FileData, Value
from vibrolock.quantities import quantity, says_a_unit, seconds_in

if TYPE_CHECKING:
    from pydantic import BaseModel


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
    rescaled: bool = False
    """Whether the mapping makes another quantity of it."""
    stored: bool = False
    """Whether the mapping holds against what the file says of it."""
    amplitude: bool = False
    """Whether it is an amplitude, which may be in decibels of its unit."""
    or_unit: str = ""
    """Another unit that says the same: that of the output of a frequency response."""


def for_mapping(
    data: FileData, mapping: "BaseModel", files: Mapping[str, FileData] | None = None
) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Return the values of a file, and of further ones by name, as `identification` maps them.

    They are as the file means them: offset, scaled, with the signs that it says. Facts on the sampling are beside them. Raises
    `ImportFailed` where the mapping says otherwise than the file, or the file says what cannot be followed.
    """
    every = {"": data, **(files or {})}
    uses = list(_uses(mapping))
    for use in uses:
        if not use.stored:
            _check(use, every[use.file])
    against = bool(getattr(mapping, "against_file", False))
    later = {} if against else _later_s(every)
    found = {
        name: _with_sampling(one, [use for use in uses if use.file == name], mapping, later.get(name, 0.0), against)
        for name, one in every.items()
    }
    return found.pop(""), found


def meant(data: FileData, stored: Collection[str] = ()) -> dict[str, Value]:
    """Return the values of a file as it means them; those named in ``stored`` as they are stored."""
    done: dict[int, Value] = {}

    def walked(group: Mapping[str, Value], above: str) -> dict[str, Value]:
        out: dict[str, Value] = {}
        for name, value in group.items():
            full = f"{above}/{name}" if above else name
            if isinstance(value, dict):
                out[name] = walked(value, full)
                continue
            facts = data.channels.get(full)
            if facts is None or full in stored or full.replace("/", ".") in stored or not _changes(facts):
                out[name] = value
            else:
                out[name] = done.setdefault(id(value), _applied(value, facts))
        return out

    return walked(data.values, "") if any(map(_changes, data.channels.values())) else dict(data.values)


def _changes(facts: ChannelFacts) -> bool:
    return facts.reversed or facts.scale is not None or facts.offset is not None


def _applied(value: Value, facts: ChannelFacts) -> Value:
    array: NDArray[Any] = np.asarray(value)
    if array.dtype.kind not in "biuf":
        return value
    scaled = array.astype(np.float64) * (1.0 if facts.scale is None else facts.scale)
    return np.asarray((scaled + (facts.offset or 0.0)) * (-1.0 if facts.reversed else 1.0))


def _with_sampling(
    data: FileData, uses: list[Use], mapping: "BaseModel", later_s: float, against: bool
) -> dict[str, object]:
    stored = {use.path for use in uses if use.stored}
    out: dict[str, object] = dict(meant(data, stored))
    if any(channel.in_si for channel in data.channels.values()):
        out["units"] = {name: channel.unit for name, channel in data.channels.items()}
    if data.notes:
        out["__notes__"] = data.notes
    if units := {use.path: data.unit(use.path) for use in uses if not use.stored and data.unit(use.path)}:
        out["__units__"] = units
    if against:
        out.pop("sample_rate_hz", None)
        return out
    if data.sample_rate_hz is not None:
        out["sample_rate_hz"] = data.sample_rate_hz
    facts = {use.path: data.facts(use.path) for use in uses if not use.stored}
    rates = {path: one.sample_rate_hz for path, one in facts.items() if one.sample_rate_hz is not None}
    starts = {path: (one.start_s or 0.0) + later_s for path, one in facts.items() if later_s or one.start_s is not None}
    time = getattr(mapping, "time", None)
    unit = data.unit(time) if isinstance(time, str) else ""
    told = {"__rates_hz__": rates, "__starts_s__": starts, "__time_unit__": unit}
    return out | {name: value for name, value in told.items() if value}


def _later_s(files: Mapping[str, FileData]) -> dict[str, float]:
    """Return how much later than the earliest file each begins, s, where files say their instant."""
    told = {name: one.begins_s for name, one in files.items() if one.begins_s is not None}
    return {name: begins - min(told.values()) for name, begins in told.items()}


def _check(use: Use, data: FileData) -> None:
    """Raise `ImportFailed` if a mapping takes what cannot be followed, or says another unit than the file."""
    facts = data.facts(use.path)
    if facts.unread:
        raise ImportFailed(
            f"'{use.path}' {facts.unread}",
            field=use.where.removesuffix(".unit"),
            hint="with `against_file = true` it is taken as stored",
        )
    given = data.unit(use.path)
    if not says_a_unit(given) or use.rescaled or (use.amplitude and given.strip().lower().startswith("db")):
        return
    if use.where == "time":
        _check_time(use, given)
        return
    of_file, of_mapping = quantity(given), quantity(use.unit)
    if not use.unit or given in (use.unit, use.or_unit) or (of_file is not None and of_file == of_mapping):
        return
    if of_file is not None and use.or_unit and of_file == quantity(use.or_unit):
        return
    reason, hint = (
        f"the file's own units make it {given}",
        "or `against_file = true` in the channel if the file is wrong",
    )
    if of_file is not None and of_mapping is not None and of_file.exponents == of_mapping.exponents:
        reason += "; write that"
    else:
        hint = f"give the factor from {given} by `scale`, {hint}"
    raise ImportFailed(reason, field=use.where, value=use.unit, hint=hint)


def _check_time(use: Use, given: str) -> None:
    seconds = seconds_in(given)
    if seconds is None or (use.unit and seconds_in(use.unit) != seconds):
        raise ImportFailed(
            f"the file's own unit of the instants is '{given}'",
            field="time_unit",
            value=use.unit or "s",
            hint="write that, or `against_file = true` with the right `time_unit` if the file is wrong",
        )


def _uses(mapping: "BaseModel") -> Iterator[Use]:
    """Yield the values that a mapping takes."""
    import identification as i

    against = bool(getattr(mapping, "against_file", False))
    if isinstance(time := getattr(mapping, "time", None), str):
        yield Use("time", time, getattr(mapping, "time_unit", ""), stored=against)
    if isinstance(frequency := getattr(mapping, "frequency", None), str):
        yield Use("frequency_unit", frequency, getattr(mapping, "frequency_unit", "Hz") or "", stored=against)
    for channel in getattr(mapping, "channels", ()):
        yield from _of_channel(channel)
    if isinstance(mapping, i.ResponseMatrixMapping):
        yield from _of_responses(mapping)
    if isinstance(mapping, i.FrequencyResponseMapping):
        units, phase = mapping.units, mapping.phase
        for group in mapping.sets:
            for key, unit in (("frequency", units.frequency), ("force", units.force), ("response", units.response)):
                yield Use(f"units.{key}", getattr(group, key), unit, stored=against)
            if group.phase is not None:
                yield Use("phase.unit", group.phase, phase.unit if phase else "", stored=against)


def _of_channel(channel: Any) -> Iterator[Use]:
    where, value = f"channels.{channel.name}", channel.value
    unit, stored = channel.unit, channel.against_file
    about = {"file": getattr(channel, "file", ""), "stored": stored}
    rescaled = getattr(channel, "scale", 1.0) != 1.0
    if isinstance(value, str):
        yield Use(f"{where}.unit", value, unit, rescaled=rescaled, **about)
        return
    yield from _of_parts(Use(f"{where}.unit", "", unit, rescaled=rescaled, **about), value)


def _of_parts(use: Use, value: Any) -> Iterator[Use]:
    """Yield the parts of complex numbers, each as ``use`` would be."""
    for part in ("real", "imaginary", "amplitude"):
        if (path := getattr(value, part)) is not None:
            yield replace(use, path=path, amplitude=part == "amplitude")
    if value.phase is not None:
        where = f"{use.where.removesuffix('.unit')}.phase_unit"
        yield replace(use, path=value.phase, where=where, unit=value.phase_unit or "", or_unit="", rescaled=False)


def _of_responses(mapping: Any) -> Iterator[Use]:
    """Yield the frequency responses of a mapping, each in the unit of its output over that of its input."""
    units = {channel.name: channel.unit for channel in (*mapping.outputs, *mapping.inputs)}
    for number, one in enumerate(mapping.paths):
        above, below = units.get(one.output, ""), units.get(one.input, "")
        use = Use(f"paths[{number}].value", "", f"({above})/({below})", or_unit=above)
        if isinstance(one.value, str):
            yield replace(use, path=one.value)
        else:
            yield from _of_parts(use, one.value)
