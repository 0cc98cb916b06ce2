"""JSON objects of a recording as typed dictionaries, in journals and HDF5 files (``docs/reference/file-format.md``).

Files of earlier versions lack some keys, files of later versions may have more. What is used of them is checked where a file is
opened (`rig.recording.stored_value_checks`) and where points are read (`rig.campaigns.evaluation.stored_point`).
"""

from collections.abc import Mapping
from typing import Literal, TypedDict

from rig.text.json_values import JsonObject, JsonValue

Role = Literal["force", "drive", "response", "monitor"]


class ChannelTable(TypedDict, total=False):
    """A channel of a bench, as in `rig.bench.channels.ChannelConfig`; the keys that readers use."""

    name: str
    role: Role
    unit: str
    sensor: str
    serial_number: str
    sensitivity: str
    sensitivity_v_per_unit: float
    amplifier_gain: float
    inverted: bool
    range_v: float
    calibrated: str
    calibration_due: str
    certificate: str
    loopback: bool
    mode_shape: float | None


class SpecimenTable(TypedDict, total=False):
    """Facts on the specimen of a bench."""

    name: str
    linear_frequency_hz: float
    drive_mode_shape: float | None


class DriverTable(TypedDict, total=False):
    """The driver of a bench."""

    name: str
    options: JsonObject


class BenchTable(TypedDict, total=False):
    """A bench, as in `rig.bench.Bench`; the keys that readers use."""

    name: str
    description: str
    sample_rate_hz: float
    output_range_v: float
    driver: DriverTable
    channels: list[ChannelTable]
    limits: JsonObject
    specimen: SpecimenTable


class PlanTable(TypedDict, total=False):
    """A plan, as in `rig.campaigns.planning.plan.Plan` and its kinds; the keys that readers use."""

    kind: str
    description: str
    plant: Mapping[str, JsonValue] | None
    start_hz: float
    stop_hz: float
    highest_hz: float
    resolution_hz: float
    off_resonance_hz: list[tuple[float, float]] | None
    silent_s: float
    levels_m: list[float] | None
    accepted_detuning: float
    alarm: dict[str, float | None]
    abort: dict[str, float | None]


class Configuration(TypedDict):
    """Bench and plan of a recording."""

    bench: BenchTable
    plan: PlanTable


class ArmingTable(TypedDict, total=False):
    """Who let a bench move."""

    how: str
    by: str
    at: str
    cautions: list[str]


class RehearsalTable(TypedDict, total=False):
    """A rehearsal, as in `rig.arming.rehearsed.Rehearsed`."""

    file: str
    digest: str
    tests: str
    finished: str
    draws: int
    ends_well: float
    trips: float
    trips_at_most: float
    foreseen: JsonObject
    overridden: dict[str, str]


class About(TypedDict, total=False):
    """Facts on a part: people, specimen, device, and what was known before it."""

    operator: str
    specimen_serial: str
    notes: list[str]
    purpose: str
    checked: dict[str, JsonValue]
    rehearsal: RehearsalTable
    armed: ArmingTable
    device: dict[str, str]
    remarks: list[str]
    code: list[dict[str, str]]
    queue: dict[str, JsonValue]
    lead_samples: float


class Information(TypedDict, total=False):
    """What a part says of itself when it begins."""

    first_sample: int
    seed: int
    about: About
    plan: PlanTable
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


class TrippedAtTable(TypedDict):
    """Where in a plan a part tripped."""

    level: float
    level_unit: str
    start: bool


class HistogramTable(TypedDict):
    """A histogram of times: the bins that are not empty."""

    upper_edge_us: list[float]
    count: list[int]


class LoopTable(TypedDict, total=False):
    """Statistics of a loop; the numbers of the driver beside them have names of its own."""

    sample_rate_hz: float
    samples: int
    overruns: int
    busy_s: float
    wall_s: float
    periods: int
    realtime_factor: float
    end_to_end_factor: float
    deadline_us: float
    real_time: dict[str, str]
    wake_up_us: dict[str, float]
    execution_us: dict[str, float]
    response_us: dict[str, float]
    histograms: dict[str, HistogramTable]


class End(TypedDict, total=False):
    """How a part ended."""

    completed: bool
    reason: str
    text: str
    tripped: bool
    tripped_at: TrippedAtTable | None
    likely_cause: str
    what_to_do: str
    skipped: str
    loop: LoopTable
    counters: dict[str, int]


class ColumnTable(TypedDict):
    """A column of the rows of a part in an HDF5 file."""

    name: str
    unit: str
    description: str
    dtype: str
    shape: list[int]


class HeaderTable(TypedDict):
    """The header of a journal, except ``format``."""

    schema: int
    kind: str
    software_version: str
    started: str
    seed: int | None
    identity: str
    first_part: int
    row_dtype: list[tuple[str, str, list[int]]]
    columns: list[tuple[str, str, str]]
    channels: list[ChannelTable]
    configuration: Configuration


class StoredPoint(TypedDict, total=False):
    """A point; `rig.campaigns.evaluation.point.Point` has all its keys, with what they mean."""

    number: int
    part: int
    level: float
    level_unit: str
    direction: str
    repeat: int
    accepted: bool
    quality: str
    reason: str
    first_sample: int
    end_sample: int
    frequency_hz: float
    force_n: float
    amplitude_m: float
    phase_error_deg: float
