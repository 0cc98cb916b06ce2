"""Text of a proposed mapping: TOML with comments on what is in the file and what is a guess."""

import json
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification import IdentificationError
from identification.mapping import UNITS, CsvLayout, si_of
from rig.exchange.proposal.contents import FileContents, Leaf

_MAX_LISTED = 60  # values that are listed; chosen
_UNITS = tuple(unit for unit in UNITS if "^" not in unit)
_MEAN = 0.02
"""A mean above this share of the RMS is remarked."""


@dataclass(frozen=True, eq=False)
class ProposedChannel:
    """A channel that a mapping proposes."""

    leaf: Leaf
    name: str
    role: str
    unit: str
    axes: tuple[str, ...]
    index: int

    def played(self, role: str) -> "ProposedChannel":
        """Return it with another role; a unit that does not suit the role becomes 1."""
        suited = {"force": ("N", "V", "1"), "monitor": None}.get(role, ("m", "m/s", "m/s2", "V", "1"))
        try:
            known = si_of(self.unit, self.name)[0]
        except IdentificationError:
            known = ""
        return replace(self, role=role, unit=self.unit if suited is None or known in suited else "1")


@dataclass(frozen=True, eq=False, kw_only=True)
class Proposal:
    """What a mapping proposes."""

    channels: tuple[ProposedChannel, ...]
    left_out: int
    records: str
    rate_hz: float | None
    rate_from: str
    time: Leaf | None
    period_samples: int
    transient_periods: int
    band_hz: tuple[float, float] | None
    at_rest: bool
    layout: CsvLayout | None
    missing: tuple[str, ...]


def text_of(
    proposal: Proposal, found: Sequence[FileContents], files: Sequence[str], relative: Collection[str] = ()
) -> str:
    """Return the mapping; ``relative`` names further files (the first is empty) with numbers relative to a full scale."""
    lines = [
        f"# Time data in {', '.join(files)}, proposed by `rig new mapping`. Where the file does not tell roles and units,",
        "# they are guesses: check every line, then",
        f"#   rig import {files[0]} --mapping THIS_FILE -o data.h5",
        "#",
        "# In the file:",
        *_listed(found),
        "",
        'kind = "time-data"',
        'specimen = ""                    # name of what was tested',
        f"source = {_quoted(files[0])}",
        "",
        *_sampling(proposal),
        *_layout(proposal),
        *_periods(proposal),
    ]
    # The axes of the channel with the fewest dimensions that has more than one, or of a vector.
    axes = min((one.axes for one in proposal.channels if len(one.axes) > 1), key=len, default=("sample",))
    lines += [f"# Units: {', '.join(_UNITS)}; monitors may have any other."]
    if axes != ("sample",):
        lines += [
            f"axes = {_quoted(list(axes))}    # dimensions of the arrays: sample, channel, period, realisation, level"
        ]
    if proposal.records:
        lines += [f"records = {_quoted(proposal.records)}    # list of structures, one for each record"]
    for channel in proposal.channels:
        lines += ["", *_channel(channel, axes, full_scale=channel.leaf.file in relative)]
    if proposal.left_out:
        lines += ["", f"# {proposal.left_out} further channels are not listed here"]
    return "\n".join(lines) + "\n"


def _listed(found: Sequence[FileContents]) -> Iterator[str]:
    listed: list[tuple[str, str]] = []
    for contents in [*found, *(one.beside for one in found if one.beside is not None)]:
        before = f"{contents.records}[...]." if contents.records else ""
        for leaf in contents.arrays:
            shape = " x ".join(map(str, leaf.values.shape))
            unit = f", {leaf.unit}" if leaf.unit else ""
            where = f" (in {leaf.file})" if leaf.file else ""
            listed.append((f"{before}{leaf.path}", f"{shape}{unit}{where}"))
        listed += [(f"{before}{path}", f"{value:.10g}") for path, value in contents.single.items()]
        listed += [(f"{before}{path}", what) for path, what in contents.others.items()]
    width = min(max((len(name) for name, _ in listed), default=0), 40)
    for name, what in listed[:_MAX_LISTED]:
        yield f"#   {_one_line(name):<{width}}  {_one_line(what)}"
    if len(listed) > _MAX_LISTED:
        yield f"#   and {len(listed) - _MAX_LISTED} more"


def _sampling(proposal: Proposal) -> Iterator[str]:
    if proposal.rate_hz is None:
        yield "# The file has no sample rate. Fill it in:"
        yield "#sample_rate_hz ="
    elif proposal.time is not None:
        unit = _one_line(proposal.time.unit) or "s"
        yield f"time = {_quoted(proposal.time.path)}    # instants, {unit}: {proposal.rate_hz:.8g} Hz"
    elif proposal.rate_from:
        yield f"sample_rate_hz = {proposal.rate_hz!r}    # by {_one_line(proposal.rate_from)} in the file"
    else:
        yield f"#sample_rate_hz = {proposal.rate_hz!r}    # the file states it"
    yield "#new_rate_hz =                   # lower sample rate, to which the data is filtered and decimated"


def _layout(proposal: Proposal) -> Iterator[str]:
    if proposal.layout is None:
        return
    given = proposal.layout.model_dump(exclude_none=True)
    inside = ", ".join(f"{key} = {_quoted(list(v) if isinstance(v, tuple) else v)}" for key, v in given.items())
    yield f"csv = {{ {inside} }}"


def _periods(proposal: Proposal) -> Iterator[str]:
    in_axes = any("period" in channel.axes for channel in proposal.channels)
    if proposal.period_samples:
        yield f"period_samples = {proposal.period_samples}    # the force repeats after these; left out: not periodic"
    elif not in_axes:
        yield "#period_samples =                # for data that repeats; none was found"
        yield f"at_rest = {_quoted(proposal.at_rest)}    # whether the records begin at rest"
    if proposal.period_samples or in_axes:
        yield f"transient_periods = {proposal.transient_periods}    # discarded at the beginning of each record"
    if proposal.band_hz is not None:
        low, high = proposal.band_hz
        yield f"lowest_hz = {float(f'{low:.6g}')!r}    # excited band, by the lines of the force"
        yield f"highest_hz = {float(f'{high:.6g}')!r}"
    else:
        yield "#lowest_hz =                     # excited band, if known: lowest_hz and highest_hz"
    yield "#stretches = [{ start_samples = 0, samples = 8192, repeat = 10, step_samples = 8692 }]    # parts of long records"


def _channel(channel: ProposedChannel, axes: tuple[str, ...], *, full_scale: bool) -> Iterator[str]:
    leaf = channel.leaf
    known = bool(leaf.unit) and channel.unit == leaf.unit
    origin = "as the file tells" if known else "not known"
    yield "[[channels]]"
    yield f"name = {_quoted(channel.name)}"
    yield f"role = {_quoted(channel.role)}    # force, drive (motion where the force acts), response, monitor"
    yield f"unit = {_quoted(channel.unit)}    # {origin}"
    yield f"value = {_quoted(leaf.path)}"
    if leaf.file:
        yield f"file = {_quoted(leaf.file)}"
    if len(channel.axes) > 1 and channel.axes != axes:
        yield f"axes = {_quoted(list(channel.axes))}"
    if "channel" in channel.axes:
        yield f"index = {channel.index}"
    if full_scale:
        yield "scale = 1.0    # units at full scale of the converter"
    elif leaf.unit and not known:
        yield f"#scale = 1.0    # factor from {_one_line(leaf.unit)}, the unit in the file"
    values = leaf.values.astype(np.float64)
    rms = float(np.sqrt(np.mean(values**2)))
    if rms > 0.0 and abs(values.mean()) > _MEAN * rms:
        yield f'#offset = "mean"    # the mean is {100 * values.mean() / rms:.2g} % of the RMS; this takes it out'


def _quoted(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def _one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)
