"""One thing that can be looked up."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """A key, command, option, message or public name."""

    what: str
    """``key``, ``table``, ``command``, ``option``, ``message`` or ``name``."""
    title: str
    """Its full name, such as ``settle.phase_deg``, ``rig run --bench`` or ``identification.linear_modes``."""
    words: tuple[str, ...]
    """Words under which it is found."""
    line: str
    """What it is, in one line."""
    target: str
    """Where it stands on the site: an anchor, the full name of a Python object, or a page."""
    facts: str = ""
    """What else is known of it, such as default and allowed values; empty for nothing."""
