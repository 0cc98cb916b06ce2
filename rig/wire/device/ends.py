"""The device's end of every wire that can be emulated, and how a bench reaches it."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rig.errors import ConfigurationError, DaqRefused
from rig.wire.device.settings import EmulatorSettings
from rig.wire.link import Link
from rig.wire.serial.link import SerialLink
from rig.wire.serial.pty import open_pseudo_terminal

__all__ = ["device_end"]


@contextmanager
def device_end(settings: EmulatorSettings) -> Iterator[tuple[Link, dict[str, Any]]]:
    """The device's end of a wire, open, and the driver options with which a bench finds the other end."""
    if settings.wire == "can":
        raise ConfigurationError("wire = 'can': not in this version")
    with _pseudo_terminal(settings.link) as (descriptor, path):
        link = SerialLink.on(descriptor, path)
        link.open()
        try:
            yield link, {"port": path}
        finally:
            link.close()


@contextmanager
def _pseudo_terminal(link: Path | None) -> Iterator[tuple[int, str]]:
    """Descriptor of the near end and path of the far end, which is that of the symbolic link where one is wanted."""
    try:
        line = open_pseudo_terminal()
    except (ImportError, OSError) as error:
        raise DaqRefused(f"this system has no pseudo-terminals: {error}") from error
    try:
        if link is not None:
            if link.is_symlink():
                link.unlink()
            try:
                link.symlink_to(line.path)
            except OSError as error:
                raise ConfigurationError(f"link = {str(link)!r}: cannot be made: {error.strerror}") from error
        yield line.descriptor, str(link.absolute()) if link is not None else line.path
    finally:
        if link is not None and link.is_symlink():
            with suppress(OSError):
                link.unlink()
        line.close()
