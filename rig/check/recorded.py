"""Which recordings are those of a check."""

from collections.abc import Mapping
from typing import Any

from rig.recording.reader import Recording

PURPOSE = "check"


def is_check(recording: Recording) -> bool:
    """Whether a recording is that of a check."""
    return bool(recording.parts) and about(recording.parts[0].information).get("purpose") == PURPOSE


def about(information: Mapping[str, Any]) -> dict[str, Any]:
    """Return the facts of a run in the information of a part; an empty dictionary if there are none."""
    found = information.get("about", {})
    return dict(found) if isinstance(found, dict) else {}
