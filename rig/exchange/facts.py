"""What a file says of its channels, given to a mapping: the one place where it is used, or refused with a word.

The rule, for every format: what the file says of units, scales, offsets, signs, rates, start times and the unit of its instants
counts. A mapping that says otherwise is refused, and wins by ``against_file = true`` alone: in a channel for what the file says
of that channel, whose numbers are then taken as stored; at the top for rates, start times and the unit of the instants. A
``scale`` other than 1 makes another quantity of the file's numbers, so that the units need not agree. What the file does not
say, the mapping says.
"""

import re
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.exchange.child_reading import ImportFailed
from rig.exchange.clocks import other_clocks, rates_beside
from rig.exchange.file_data import ChannelFacts, FileData, Value, unit_in_name
from rig.exchange.spellings import time_unit_in
from rig.exchange.uses import Use, instants_of, uses_of
from vibrolock.quantities import quantity, says_a_unit, seconds_in

if TYPE_CHECKING:
    from identification.mapping import MeasurementMapping


def for_mapping(
    data: FileData, mapping: "MeasurementMapping", files: Mapping[str, FileData] | None = None
) -> tuple[dict[str, object], dict[str, dict[str, object]]]:
    """Return the values of a file, and of further ones by name, as `identification` maps them.

    They are as the file means them: offset, scaled, with the signs that it says. Facts on the sampling are beside them. Raises
    `ImportFailed` where the mapping says otherwise than the file, or the file says what cannot be followed.
    """
    every = {"": data, **(files or {})}
    uses = list(uses_of(mapping))
    for use in uses:
        if not use.stored:
            _check(use, every[use.file])
    later = {} if mapping.against_file else _later_s(every)
    found = {
        name: _with_sampling(one, [use for use in uses if use.file == name], mapping, later.get(name, 0.0))
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


def _with_sampling(data: FileData, uses: list[Use], mapping: "MeasurementMapping", later_s: float) -> dict[str, object]:
    stored = {use.path for use in uses if use.stored}
    out: dict[str, object] = dict(meant(data, stored))
    if any(channel.in_si for channel in data.channels.values()):
        out["units"] = {name: channel.unit for name, channel in data.channels.items()}
    if data.notes:
        out["__notes__"] = data.notes
    if units := {use.path: unit for use in uses if not use.stored and (unit := _unit(use, data))}:
        out["__units__"] = units
    if mapping.against_file:
        out.pop("sample_rate_hz", None)
        return out
    if data.sample_rate_hz is not None:
        out["sample_rate_hz"] = data.sample_rate_hz
    time, time_unit, within = instants_of(mapping)
    facts = {use.path: facts for use in uses if not use.stored for facts in _facts(use, data)[:1]}
    rates = {path: one.sample_rate_hz for path, one in facts.items() if one.sample_rate_hz is not None}
    starts = {path: (one.start_s or 0.0) + later_s for path, one in facts.items() if later_s or one.start_s is not None}
    unit = _time_unit(data, _full(within, time)) if time else ""
    of_clocks = other_clocks(data, [use.path for use in uses], time, seconds_in(time_unit or unit) or 1.0)
    for path, clock in of_clocks.items():
        rates[path], starts[path] = clock.rate_hz, starts.get(path, 0.0) + clock.start_s
    beside = rates_beside(data, [_full(use.within, use.path) for use in uses])
    told = {"__rates_hz__": rates, "__starts_s__": starts, "__time_unit__": unit, "__rates_beside_hz__": beside}
    return out | {name: value for name, value in told.items() if value}


def _full(within: str, path: str) -> str:
    return f"{within}[0].{path}" if within else path


def _facts(use: Use, data: FileData) -> list[ChannelFacts]:
    """Return what the file says of a value: of that in each structure, where a mapping takes it from a list of them."""
    if not use.within:
        return [data.facts(use.path)]
    entry = re.compile(rf"{re.escape(use.within)}(\[\d+\])?\.{re.escape(use.path)}")
    return [facts for name, facts in data.channels.items() if entry.fullmatch(name)] or [data.facts(use.path)]


def _unit(use: Use, data: FileData) -> str:
    """Return the unit that the file gives for a value that a mapping takes; raise `ImportFailed` if it gives several."""
    facts = _facts(use, data)
    units = [*dict.fromkeys(unit for one in facts for unit in ([one.unit] if one.unit else _columns(use, one)))]
    if len(units) > 1:
        raise ImportFailed(
            f"'{use.path}' has several units ({', '.join(units)})",
            field=use.where.removesuffix(".unit"),
            hint="name the dimension `channel` in `axes` and give `index`, or `against_file = true` takes it as stored",
        )
    return units[0] if units else _time_unit(data, use.path) if use.where == "time" else unit_in_name(use.path)


def _columns(use: Use, facts: ChannelFacts) -> list[str]:
    if 0 < use.column <= len(facts.columns):
        return [facts.columns[use.column - 1]]
    return [*facts.columns]


def _time_unit(data: FileData, path: str) -> str:
    return data.unit(path) or time_unit_in(path)


def _later_s(files: Mapping[str, FileData]) -> dict[str, float]:
    """Return how much later than the earliest file each begins, s, where files say their instant."""
    told = {name: one.begins_s for name, one in files.items() if one.begins_s is not None}
    return {name: begins - min(told.values()) for name, begins in told.items()}


def _check(use: Use, data: FileData) -> None:
    """Raise `ImportFailed` if a mapping takes what cannot be followed, or says another unit than the file."""
    for facts in _facts(use, data):
        if facts.unread:
            raise ImportFailed(
                f"'{use.path}' {facts.unread}",
                field=use.where.removesuffix(".unit"),
                hint="with `against_file = true` it is taken as stored",
            )
    given = _unit(use, data)
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
