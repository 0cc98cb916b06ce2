"""Proposed mapping as its text."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MappingText:
    """Text of a proposed mapping."""

    text: str
    """TOML with comments."""
    missing: tuple[str, ...]
    """Keys that are left to be filled in."""
