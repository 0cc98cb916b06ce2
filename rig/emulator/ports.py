"""The device's end of each wire that can be emulated, and the driver options with which a bench reaches it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rig.bench.configuration import Table
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqRefused
from rig.wire.link import Link
from rig.wire.serial.link import SerialLink
from rig.wire.serial.port import open_pseudo_terminal

if TYPE_CHECKING:
    from rig.wire.can.bus import FrameBus


@contextmanager
def device_end(settings: EmulatorSettings) -> Iterator[tuple[Link, Table]]:
    """The device's end of a wire, open, and the driver options with which a bench finds the other end.

    Raises `ConfigurationError`, `rig.errors.DaqError`.
    """
    with ExitStack() as stack:
        link: Link
        if settings.wire == "can" and settings.interface not in (None, "slcan"):
            from rig.wire.can.bus import PythonCanBus

            assert settings.interface is not None
            assert settings.channel is not None
            bus = PythonCanBus(settings.interface, settings.channel, settings.timing, settings.node)
            link = _can_link(settings, bus)
            options = {"interface": settings.interface, "channel": settings.channel, **_can_options(settings)}
        else:
            descriptor, path = stack.enter_context(pseudo_terminal(settings.link))
            options = driver_options_of(settings, path)
            if settings.wire == "serial":
                link = SerialLink.on(descriptor, path)
            else:  # the device on a bus behind an adapter
                from rig.wire.can.slcan import SlcanBus

                link = _can_link(settings, SlcanBus(descriptor, settings.timing, adapter=True))
        link.open()
        stack.callback(link.close)
        yield link, options


def driver_options_of(settings: EmulatorSettings, path: str) -> Table:
    """Driver options with which a bench finds a device at the other end of a port."""
    if settings.wire == "serial":
        return {"port": path}
    return {"interface": "slcan", "channel": path, **_can_options(settings)}


def _can_link(settings: EmulatorSettings, bus: "FrameBus") -> Link:
    from rig.wire.can.link import CanLink

    return CanLink(bus, len(settings.bench.channels), settings.timing, settings.node, device=True)


def _can_options(settings: EmulatorSettings) -> Table:
    options: Table = {"fd": settings.fd, "node": settings.node, "bitrate": settings.bitrate}
    return {**options, "data_bitrate": settings.data_bitrate} if settings.fd else options


@contextmanager
def pseudo_terminal(link: Path | None) -> Iterator[tuple[int, str]]:
    """Descriptor of the near end and path of the far end; the path of the symbolic link, if there is one."""
    try:
        line = open_pseudo_terminal()
    except (ImportError, OSError) as error:
        raise DaqRefused(f"this system has no pseudo-terminals: {error}") from error
    try:
        with named(line.path, link) as path:
            yield line.descriptor, path
    finally:
        line.close()


@contextmanager
def named(port: str, link: Path | None) -> Iterator[str]:
    """The path of a port: that of a symbolic link to it while the context lasts, if one is wanted."""
    if link is None:
        yield port
        return
    _name(link, port)
    try:
        yield str(link.absolute())
    finally:
        with suppress(OSError):  # the link may be gone or lead elsewhere by now
            if link.readlink() == Path(port):
                link.unlink()


def _name(link: Path, path: str) -> None:
    """Make a symbolic link to a port; a link to such a port that no longer exists is replaced, and nothing else."""
    try:
        if link.is_symlink():
            target = link.readlink()
            if target != Path(path) and (link.exists() or target.parent != Path(path).parent):
                raise ConfigurationError(
                    f"leads to {target} already; end the emulator there, or remove the link",
                    field="link",
                    value=str(link),
                )
            link.unlink()
        link.symlink_to(path)
    except OSError as error:
        raise ConfigurationError(f"cannot be made: {error.strerror}", field="link", value=str(link)) from error
