"""Who tested what on which bench with which sensors: the facts of a recording, of any kind."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from rig.arming.run_facts import About
from rig.errors import RecordingError
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from rig.recording.stored import About as StoredAbout, StoredTable
from rig.report.document import Block, Facts, Section, Table, Text
from rig.report.keys import key_rows, limit_rows
from rig.text.console import number


def subject_section(recording: Recording) -> Section:
    """Return what was tested, by whom, on which bench, when, and how it ended."""
    bench, plan = recording.configuration["bench"], recording.configuration["plan"]
    abouts = _abouts(recording)
    devices = [", ".join(f"{key} {value}" for key, value in (about.get("device") or {}).items()) for about in abouts]
    told = {name: dict.fromkeys(str(about.get(name)) for about in abouts if about.get(name)) for name in About.single()}
    rows = [
        ("specimen", bench["specimen"]["name"]),
        *((name.replace("_", " "), ", ".join(values)) for name, values in told.items()),
        ("test", recording.kind + (f": {plan['description']}" if plan.get("description") else "")),
        ("bench", bench["name"] + (f": {bench['description']}" if bench.get("description") else "")),
        ("driver", bench["driver"]["name"]),
        ("device", "; ".join(dict.fromkeys(filter(None, devices)))),
        ("started", recording.started),
        ("ended", "; ".join(endings(recording))),
        ("notes", "; ".join(note for about in abouts for note in about.get("notes") or ())),
    ]
    return Section("What was tested", [Facts("", [(name, value) for name, value in rows if value])])


def endings(recording: Recording) -> list[str]:
    """Return how each part of a recording ended."""
    if not recording.parts:
        return ["nothing recorded"]
    texts = [
        "cut short, without a record of the end" if part.end is None else part.end["text"] for part in recording.parts
    ]
    return texts if len(texts) == 1 else [f"part {n}: {text}" for n, text in enumerate(texts, 1)]


def bench_section(recording: Recording) -> Section:
    """Return sensors with their calibration, and the limits of the bench."""
    bench = recording.configuration["bench"]
    day = recording.started[:10]
    channels = bench["channels"]
    overdue = frozenset(
        i for i, one in enumerate(channels) if one.get("calibration_due") and str(one["calibration_due"]) < day
    )
    sensors = Table(
        "Channels and sensors",
        ("channel", "role", "sensor", "serial number", "sensitivity", "range\nV", "calibrated", "due"),
        [
            (
                str(one["name"]),
                str(one["role"]) + (", loopback" if one.get("loopback") else ""),
                str(one.get("sensor") or "-"),
                str(one.get("serial_number") or "-"),
                _sensitivity(one),
                number(one.get("range_v"), "g"),
                (
                    str(one.get("calibrated") or "") + (f" ({one['certificate']})" if one.get("certificate") else "")
                ).strip()
                or "-",
                str(one.get("calibration_due") or "-") + (" (overdue)" if i in overdue else ""),
            )
            for i, one in enumerate(channels)
        ],
        overdue,
    )
    blocks: list[Block] = [sensors]
    if not any(one.get("serial_number") or one.get("calibrated") for one in channels):
        blocks.append(Text("The bench states no serial numbers and no calibration dates.", "note"))
    facts = [
        ("sample rate", f"{bench['sample_rate_hz']:g} Hz"),
        ("output range", f"{bench['output_range_v']:g} V"),
        *limit_rows(bench["limits"]),
        ("linear frequency of the mode", f"{bench['specimen']['linear_frequency_hz']:g} Hz"),
    ]
    if bench["specimen"].get("drive_mode_shape") is not None:
        facts.append(("mode shape at the drive point", f"{bench['specimen']['drive_mode_shape']:g} kg^-1/2"))
    blocks.append(Facts("Limits and facts of the bench", facts, dense=True))
    return Section("Bench and sensors", blocks)


def _sensitivity(channel: StoredTable) -> str:
    """Return the sensitivity as on the data sheet, or else in mV per unit."""
    if sheet := channel.get("sensitivity"):
        gain = f" x {channel['amplifier_gain']}" if channel.get("amplifier_gain") else ""
        return f"{sheet}{gain}" + (", inverted" if channel.get("inverted") else "")
    unit = str(channel["unit"])
    return f"{number(channel['sensitivity_v_per_unit'], '.6g', 1e3)} mV/{f'({unit})' if '/' in unit else unit}"


def safety_section(recording: Recording) -> Section:
    """Return who let the bench move, what spoke against it, and the remarks made before the start."""
    rows, blocks = [], list[Block]()
    for n, about in enumerate(_abouts(recording), 1):
        armed = about.get("armed") or {}
        how = armed.get("how")
        if how == "virtual":
            text = "a virtual bench, on which nothing physical moves"
        elif how:
            text = f"armed by {how} ({armed.get('by') or 'unknown'}), {armed.get('at', '')}"
        else:
            text = "no record of arming"
        cautions = "; ".join(armed.get("cautions") or ()) or (
            "-" if how == "virtual" else "none: the last check counts"
        )
        rows.append((str(n), text, cautions, "; ".join(about.get("remarks") or ()) or "-"))
    if rows:
        blocks.append(Table("Before each part", ("part", "armed", "against it (check, limits)", "remarks"), rows))
    return Section("Checks and arming", blocks)


def plan_section(recording: Recording) -> Section:
    """Return every key of the plan in force that has a value."""
    rows = key_rows(recording.configuration["plan"])
    return Section("Plan", [Facts("Keys of the plan in force, given ones and defaults", rows, code=True, dense=True)])


def files_and_versions(recording: Recording, files: Table) -> Section:
    """Return versions, seed and digests."""
    facts = [
        ("recorded by", f"vibrolock {recording.software_version}"),
        ("seed", "none: a real bench" if recording.seed is None else str(recording.seed)),
        ("integrity", recording.integrity),
    ]
    return Section("Versions and files", [Facts("", facts), files])


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording or model that exist: the HDF5 file, and the journal of a run without an end."""
    return [one for one in (path, journal_path(path)) if one.is_file()]


def _digest_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits; raise `RecordingError` if it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None


def table_of_files(paths: Sequence[Path]) -> Table:
    """Return names, sizes and digests of files."""
    rows = [(path.name, f"{path.stat().st_size}", _digest_of(path)) for path in paths]
    return Table("Files", ("file", "size\nbytes", "SHA-256"), rows)


def _abouts(recording: Recording) -> Sequence[StoredAbout]:
    return [part.information.get("about") or {} for part in recording.parts]
