"""Memory of a bench from run to run: its last check, and a trip that a person has to look at.

There is one small JSON file per bench in the user's state folder (``$XDG_STATE_HOME/vibrolock/benches``). It is always replaced
as a whole. Nothing is kept about virtual rigs.
"""

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TypedDict, Unpack

from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.errors import RecordingError
from rig.system.text_files import read_text
from rig.system.whole_file import whole_file
from vibrolock.errors import InputError

LARGEST_BYTES = 1_000_000  # bytes of a memory file that is read; chosen: a thousand times a usual one


@dataclass(frozen=True)
class RememberedCheck:
    """The last check of a bench."""

    at: str
    """End of the check, ISO 8601 with time zone."""
    failed: tuple[str, ...]
    """Names of the findings that failed; empty if the check passed."""
    recording: str
    """Path of the recording of the check."""
    fingerprint: str
    """`fingerprint` of the bench at the time of the check."""
    scale: CheckedScale | None = None
    """The scale of force and motion; None if the check did not tell it, or was made by a version that kept none."""


@dataclass(frozen=True)
class RememberedTrip:
    """A trip that nobody has looked at yet."""

    at: str
    """Time of the trip, ISO 8601 with time zone."""
    text: str
    """What tripped, as text."""
    recording: str
    """Path of the recording; empty if no run tripped but this memory could not be read."""


@dataclass(frozen=True)
class BenchMemory:
    """Memory of a bench."""

    check: RememberedCheck | None = None
    """Last check of the bench."""
    trip: RememberedTrip | None = None
    """The last trip, until a person has armed the bench again."""


def memory_path(bench: Bench) -> Path:
    """Return the path of the memory file of a bench, which depends on the name of the bench."""
    base = os.environ.get("XDG_STATE_HOME", "")
    folder = Path(base) if base and Path(base).is_absolute() else Path.home() / ".local" / "state"
    readable = re.sub(r"[^A-Za-z0-9_.-]+", "-", bench.name).strip(".-")
    if readable != bench.name:
        readable += "-" + hashlib.sha256(bench.name.encode()).hexdigest()[:8]
    return folder / "vibrolock" / "benches" / f"{readable}.json"


def fingerprint(bench: Bench, identity: Mapping[str, str]) -> str:
    """Digest of everything that a check depends on: channels, emergency stop, driver, rate, range, and the device.

    Of ``identity``, the driver's description of the device, only ``serial_number`` counts. The port may change; the channels
    may not.
    """
    kept = {"channels", "sample_rate_hz", "output_range_v", "emergency_stop"}
    table = bench.model_dump(mode="json", include=kept)
    device = {"driver": bench.driver.name, "serial_number": identity.get("serial_number", "")}
    text = json.dumps({**table, **device}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def memory_of(bench: Bench) -> BenchMemory:
    """Return the memory of a bench. A file that cannot be read counts as a trip, because it may have contained one."""
    path = memory_path(bench)
    try:
        if not path.exists():
            return BenchMemory()
        table = json.loads(read_text(path, LARGEST_BYTES, RecordingError))
        check, trip = table["check"], table["trip"]
        for found in (check, trip):
            if found is not None and datetime.fromisoformat(found["at"]).tzinfo is None:
                raise InputError("has no time zone", field="at", value=found["at"])
        if check is not None:
            scale = check.get("scale")
            known = {"failed": tuple(check["failed"]), "scale": None if scale is None else CheckedScale(**scale)}
            check = RememberedCheck(**{**check, **known})
        return BenchMemory(check, None if trip is None else RememberedTrip(**trip))
    except (OSError, ValueError, KeyError, TypeError, RecordingError, RecursionError) as error:
        text = f"{path} cannot be read, it may have held a trip ({type(error).__name__}: {error})"
        return BenchMemory(trip=RememberedTrip(now(), text, ""))


def known_scale(
    bench: Bench, identity: Mapping[str, str], given: CheckedScale | None, *, virtual: bool
) -> tuple[CheckedScale | None, str]:
    """Return the scale of the last check of the bench, or the ``given`` one, and why the scale is unproven if there is none.

    Nothing is remembered of a virtual bench, and nothing is said of it. A check of other channels or another device does not
    count. ``identity`` is what the driver says of its device.
    """
    if given is not None or virtual:
        return given, ""
    check = memory_of(bench).check
    if check is None:
        why = "the bench was never checked"
    elif check.fingerprint != fingerprint(bench, identity):
        why = "the last check was of other channels, another rate, another driver or another device"
    elif check.scale is None:
        why = "the last check did not record it"
    else:
        return check.scale, ""
    return None, (
        f"the scale of force and motion has not been checked: {why}; a sensitivity that is wrong by a factor would go "
        "unnoticed (run `rig check` with this bench)"
    )


class _Changes(TypedDict, total=False):
    check: RememberedCheck | None
    trip: RememberedTrip | None


def remember(bench: Bench, **changes: Unpack[_Changes]) -> None:
    """Replace ``check`` or ``trip`` in the memory; raise `RecordingError` if it cannot be written."""
    path = memory_path(bench)
    memory = replace(memory_of(bench), **changes)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path.parent}: cannot be made ({error.strerror})") from None
    with whole_file(path) as part:
        part.write_text(json.dumps(asdict(memory), indent=2), encoding="utf-8")


def now() -> str:
    """Return the present time, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")
