"""JSON objects of a recording as typed dictionaries, in journals and HDF5 files (``docs/reference/file-format.md``).

Files of earlier versions lack some keys, files of later versions may have more. What is used of them is checked where a file is
opened (`rig.recording.stored_value_checks`) and where points are read (`rig.campaigns.evaluation.stored_point`).
"""

from typing import Any, TypedDict

StoredTable = dict[str, Any]
"""JSON object with the keys of what wrote it: `rig.bench.Bench` and its channels, `rig.campaigns.planning.plan.Plan`,
`rig.campaigns.evaluation.point.Point`, `rig.arming.rehearsed.Rehearsed`, `rig.loop.loop.LoopStatistics`."""


class Configuration(TypedDict):
    """Bench and plan of a recording."""

    bench: StoredTable
    plan: StoredTable


class About(TypedDict, total=False):
    """Facts on a part: people, specimen, device, and what was known before it."""

    operator: str
    specimen_serial: str
    notes: list[str]
    purpose: str
    checked: StoredTable
    rehearsal: StoredTable
    armed: StoredTable
    device: dict[str, str]
    remarks: list[str]
    code: list[dict[str, str]]
    queue: StoredTable
    lead_samples: float
    images: list[list[float]]


class Information(TypedDict, total=False):
    """What a part says of itself when it begins."""

    first_sample: int
    seed: int
    about: About
    plan: StoredTable
    numbers: list[int]
    points_done: int
    device_flags: list[str]


class Event(TypedDict, total=False):
    """An event: a change of state, a remark, a refused attempt, or a change of the stride of the stored rows."""

    sample: int
    what: str
    state: str
    text: str
    row: int
    stride: int


class End(TypedDict, total=False):
    """How a part ended."""

    completed: bool
    reason: str
    text: str
    tripped: bool
    tripped_at: StoredTable | None
    likely_cause: str
    what_to_do: str
    skipped: str
    loop: StoredTable
    counters: dict[str, int]
