"""The errors of the bench: a small tree, each with one clear line that says what happened, where, and what to do."""

from rig.text.printable import one_line

__all__ = [
    "ConfigurationError",
    "DaqBusy",
    "DaqDisconnected",
    "DaqEmergencyStop",
    "DaqError",
    "DaqMismatch",
    "DaqOverrun",
    "DaqProtocol",
    "DaqRefused",
    "DaqReset",
    "DaqTimeout",
    "DaqWatchdog",
    "NotArmed",
    "RecordingError",
    "RigError",
    "as_daq_error",
]


class RigError(Exception):
    """Anything that the bench reports to its user; the command line prints it as one line.

    Its text is that line: printable, and shortened in its middle where a file or a device has put much into it.
    """

    def __init__(self, *parts: object) -> None:
        super().__init__(one_line(" ".join(str(part) for part in parts)))


class ConfigurationError(RigError):
    """A bench or plan holds a value that is not allowed; the message names its path, the value and what is allowed."""


class RecordingError(RigError):
    """A recording cannot be written or read: full disk, foreign, damaged or later file, missing permission."""


class DaqError(RigError):
    """A driver cannot do what was asked of it; the message names the channel or port and what to do."""


class DaqTimeout(DaqError):  # noqa: N818 (the names of the DAQ contract)
    """The device has not delivered or taken a block within the agreed time."""


class DaqDisconnected(DaqError):  # noqa: N818
    """The device is gone: unplugged, switched off, or its port was closed."""


class DaqOverrun(DaqError):  # noqa: N818
    """Samples were lost, and the driver cannot go on: it does not know where, or the device has stopped over it."""


class DaqRefused(DaqError):  # noqa: N818
    """The device or bus cannot carry what was asked for: rate, block, voltage or channels."""


class DaqBusy(DaqError):  # noqa: N818
    """The port is there, but somebody else holds it."""


class DaqMismatch(DaqError):  # noqa: N818
    """The device says of its channels, ranges or rates something else than the bench does."""


class DaqProtocol(DaqError):  # noqa: N818
    """What answers speaks another version, not this protocol, or two devices answer as one."""


class DaqReset(DaqError):  # noqa: N818
    """The device has started anew in the middle of a run."""


class DaqWatchdog(DaqError):  # noqa: N818
    """The device's watchdog has brought the output to 0 V, because no output had come in time."""


class DaqEmergencyStop(DaqError):  # noqa: N818
    """The emergency stop has brought the output to 0 V."""


class NotArmed(RigError):  # noqa: N818
    """Something physical would move and nobody has armed the bench."""


def as_daq_error(error: Exception) -> DaqError:
    """An exception of a driver as a `DaqError`: itself where it is one, else one that names it."""
    return error if isinstance(error, DaqError) else DaqError(f"the driver has failed: {type(error).__name__}: {error}")
