"""Rows of the matrix: what was measured of one way to run a test, when and on what; read from and written to files."""

import json
import tomllib
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import Field

from rig.bench.configuration import Configured, validated
from rig.errors import ConfigurationError
from rig.system.whole_file import whole_file


class Verified(Configured):
    """What the conformance suite has found (`rig.conformance`)."""

    utc: str
    """When it was run, ISO 8601."""
    passed: int = Field(ge=0)
    """Duties that were kept."""
    failed: int = Field(ge=0)
    """Duties that were not kept."""
    not_applicable: int = Field(ge=0)
    """Duties that do not apply to this device, or that nobody could see."""
    failures: tuple[str, ...] = ()
    """One line for each duty that was not kept."""


class Row(Configured):
    """One way to run a test, as it was measured. A key that was not measured is left out."""

    way: str = Field(min_length=1)
    """What it is: driver, wire, device."""
    bench: str
    """Name of the bench."""
    driver: str
    """Name of the driver."""
    device: str = ""
    """Model and firmware, as the device tells them."""
    utc: str
    """When it was measured, ISO 8601."""
    version: str
    """Version of this product."""
    machine: str
    """System and processor on which it was measured."""
    sample_rate_hz: float | None = None
    """Sample rate, Hz."""
    reached_hz: float | None = None
    """Samples received per second, Hz."""
    largest_rate_hz: float | None = None
    """Largest sample rate by what was measured (`rig.loop.recommendation`), Hz."""
    block: int | None = None
    """Samples a block."""
    queue_blocks: int | None = None
    """Blocks of the device's queue."""
    latency_ms: float | None = None
    """From an output to its effect in the readings, as the driver tells it, ms."""
    block_p50_ms: float | None = None
    """Time between two blocks, median, ms."""
    late_p99_9_ms: float | None = None
    """How late blocks came, 99.9 % of them less, ms; of devices with a clock."""
    late_largest_ms: float | None = None
    """How late the latest block came, ms."""
    round_trip_p50_ms: float | None = None
    """Round trip of a short message, median, ms."""
    blocks: int | None = None
    """Blocks exchanged for these times."""
    held_blocks: int | None = None
    """Of these, blocks with a held output."""
    lost_blocks: int | None = None
    """Of these, blocks that were lost."""
    resolution_mv: dict[str, float] = Field(default_factory=dict)
    """Smallest step seen between two readings, mV, by channel; channels whose reading never changed are left out."""
    watchdog_s: float | None = None
    """Watchdog that was set and confirmed, s."""
    to_0v_s: float | None = None
    """From the last output of the host to 0 V on the converter, measured by a witness, s."""
    to_0v: Literal["measured", "reported", "ends with its process"] | None = None
    """How the time to 0 V is known: by a witness, or only by the watchdog that the device has confirmed."""
    verified: Verified | None = None
    """What the conformance suite has found; absent if it was not run."""
    failure: str = ""
    """Why nothing, or not all, could be measured."""


class _File(Configured):
    """A file of rows."""

    row: tuple[Row, ...]
    """The rows."""


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a TOML or JSON file; raise `ConfigurationError` if it is none."""
    try:
        text = path.read_text(encoding="utf-8")
        table: dict[str, Any] = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path}: cannot be read as rows of a matrix: {error}") from error
    if not isinstance(table, dict):
        raise ConfigurationError(where=path, allowed="a table with the key `row`")
    return list(validated(_File, table, str(path)).row)


def write_rows(path: Path, rows: list[Row]) -> None:
    """Write rows to a TOML or JSON file, by its suffix; the file is whole or as it was before."""
    table = {"row": [row.model_dump(mode="json", exclude_none=True, exclude_defaults=True) for row in rows]}
    with whole_file(path) as part:
        text = json.dumps(table, indent=1) + "\n" if path.suffix == ".json" else tomli_w.dumps(table)
        part.write_text(text, encoding="utf-8")
