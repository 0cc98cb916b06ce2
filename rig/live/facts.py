"""`RunFacts`: what does not change while a run goes on, and the types of the lines that it tells."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from math import nan

from pydantic import TypeAdapter

from rig.text.column import Column

Line = Mapping[str, object]
"""What a run tells: a point, an event or a remark, the beginning or the end of a part, as ``is`` says (``part``, ``point``,
``event``, ``end``); the other keys are those recorded."""


def text_in(line: Line, key: str) -> str:
    """Return the text under a key of a line; empty if there is none."""
    return str(line.get(key) or "")


def number_in(line: Line, key: str, default: float = nan) -> float:
    """Return the number under a key of a line; ``default`` if there is none."""
    value = line.get(key)
    return float(value) if isinstance(value, int | float) else default


@dataclass(frozen=True)
class ChannelFacts:
    """A channel of the bench; ``range`` and ``limit`` are in the channel's unit."""

    name: str
    role: str
    unit: str
    range: float
    """Largest reading of the converter."""
    limit: float | None
    """Limit of the bench for channels of this role; None if there is none."""


@dataclass(frozen=True)
class LimitFacts:
    """Limits of the bench that hold for no single channel."""

    voltage_v: float
    displacement_m: float
    frequency_hz: tuple[float, float]
    ramp_down_s: float


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """Facts of a run: plan, bench, channels with units and limits, operator."""

    version: str
    """Version of this program that drives the run, or made the recording."""
    process: int
    """Number of the run's process; 0 for a recording."""
    recording: str
    """Path of the recording."""
    started: str = ""
    """Time at which the run began (ISO 8601); empty if unknown."""
    kind: str
    """Kind of campaign."""
    purpose: str
    description: str
    bench: str
    specimen: str
    specimen_serial: str
    operator: str
    armed: str
    """How the bench was armed; empty before that."""
    sample_rate_hz: float
    level_unit: str
    points: int
    """Number of points of the plan."""
    columns: tuple[Column, ...]
    """Quantities of a point."""
    channels: tuple[ChannelFacts, ...]
    limits: LimitFacts

    def index(self, role: str) -> int:
        """Return the index of the first channel with a role."""
        return [channel.role for channel in self.channels].index(role)

    def to_json(self) -> dict[str, object]:
        """Return the facts as plain data, for `facts_from` and the page."""
        return {**asdict(self), "columns": [column._asdict() for column in self.columns]}


@cache
def _adapter() -> TypeAdapter[RunFacts]:
    return TypeAdapter(RunFacts)


def facts_from(content: bytes) -> RunFacts:
    """Return the facts that a run has published as JSON; `ValueError` for anything else."""
    return _adapter().validate_json(content)
