"""What the distribution `vibrolock-studies` adds to the commands. It is installed apart and found by entry point."""

from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "vibrolock.studies"
"""Group of entry points under which the studies are installed."""
HOW_TO_INSTALL = "pip install ./studies (in a clone of this repository)"


def find_study(name: str) -> "EntryPoint | None":
    """Return the entry point of a study; None if the studies are not installed."""
    from importlib.metadata import entry_points

    return next(iter(entry_points(group=GROUP, name=name)), None)


def load_study(name: str, user: str) -> Any:
    """Return what a study brings; ``user``: what needs it, with which the message begins.

    Raises `rig.errors.ConfigurationError`, with the command that installs the studies, if they are not installed.
    """
    entry = find_study(name)
    if entry is None:
        raise ConfigurationError(
            f"{user}: needs the distribution vibrolock-studies, which is not installed; {HOW_TO_INSTALL}"
        )
    return entry.load()
