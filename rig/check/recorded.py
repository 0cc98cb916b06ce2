"""Which recordings are those of a check."""

from rig.recording.reader import Recording

PURPOSE = "check"  # purpose of the recording of a check, in the facts of its parts


def is_check(recording: Recording) -> bool:
    """Return whether a recording is that of a check."""
    return bool(recording.parts) and recording.parts[0].information.get("about", {}).get("purpose") == PURPOSE
