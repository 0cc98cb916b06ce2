"""The device's end of each wire that can be emulated, and the driver options with which a bench reaches it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqRefused
from rig.wire.link import Link
from rig.wire.serial.link import SerialLink
from rig.wire.serial.port import open_pseudo_terminal

if TYPE_CHECKING:
    from rig.wire.can.bus import FrameBus

__all__ = ["device_end"]


@contextmanager
def device_end(settings: EmulatorSettings) -> Iterator[tuple[Link, dict[str, Any]]]:
    """The device's end of a wire, open, and the driver options with which a bench finds the other end.

    Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    with ExitStack() as stack:
        if settings.wire == "can" and settings.interface not in (None, "slcan"):
            link, options = _can_interface(settings)
        else:
            descriptor, path = stack.enter_context(_pseudo_terminal(settings.link))
            link, options = _slcan(settings, descriptor, path) if settings.wire == "can" else _serial(descriptor, path)
        link.open()
        stack.callback(link.close)
        yield link, options


def _serial(descriptor: int, path: str) -> tuple[Link, dict[str, Any]]:
    return SerialLink.on(descriptor, path), {"port": path}


def _slcan(settings: EmulatorSettings, descriptor: int, path: str) -> tuple[Link, dict[str, Any]]:
    """An adapter on a pseudo-terminal, and the device on the bus behind it."""
    from rig.wire.can.slcan import SlcanBus

    bus = SlcanBus(descriptor, settings.timing, adapter=True)
    return _can_link(settings, bus), {"interface": "slcan", "channel": path, **_can_options(settings)}


def _can_interface(settings: EmulatorSettings) -> tuple[Link, dict[str, Any]]:
    from rig.wire.can.bus import PythonCanBus

    assert settings.interface is not None
    assert settings.channel is not None
    bus = PythonCanBus(settings.interface, settings.channel, settings.timing, settings.node)
    options = {"interface": settings.interface, "channel": settings.channel, **_can_options(settings)}
    return _can_link(settings, bus), options


def _can_link(settings: EmulatorSettings, bus: "FrameBus") -> Link:
    from rig.wire.can.link import CanLink

    return CanLink(bus, len(settings.bench.channels), settings.timing, settings.node, device=True)


def _can_options(settings: EmulatorSettings) -> dict[str, Any]:
    options: dict[str, Any] = {"fd": settings.fd, "node": settings.node, "bitrate": settings.bitrate}
    return {**options, "data_bitrate": settings.data_bitrate} if settings.fd else options


@contextmanager
def _pseudo_terminal(link: Path | None) -> Iterator[tuple[int, str]]:
    """Descriptor of the near end and path of the far end; the path of the symbolic link, if there is one."""
    try:
        line = open_pseudo_terminal()
    except (ImportError, OSError) as error:
        raise DaqRefused(f"this system has no pseudo-terminals: {error}") from error
    try:
        if link is not None:
            _name(link, line.path)
        yield line.descriptor, str(link.absolute()) if link is not None else line.path
    finally:
        if link is not None:
            with suppress(OSError):  # the link may be gone or lead elsewhere by now
                if link.readlink() == Path(line.path):
                    link.unlink()
        line.close()


def _name(link: Path, path: str) -> None:
    """Make a symbolic link to a port; a link to a port that no longer exists is replaced."""
    try:
        if link.is_symlink():
            target = link.readlink()
            if target != Path(path) and link.exists():
                raise ConfigurationError(
                    f"link = {str(link)!r}: leads to {target} already; end the emulator there, or remove the link"
                )
            link.unlink()
        link.symlink_to(path)
    except OSError as error:
        raise ConfigurationError(f"link = {str(link)!r}: cannot be made: {error.strerror}") from error
