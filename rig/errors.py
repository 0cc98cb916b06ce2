"""The errors of the bench: a small tree, each with one clear line that says what happened, where, and what to do."""

from vibrolock.errors import StatedError

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


class RigError(StatedError):
    """Base class of the errors that are reported to the user; the command line prints each as one line."""


class ConfigurationError(RigError):
    """A bench, a plan or an option holds a value that is not allowed."""


class RecordingError(RigError):
    """A recording cannot be written or read: full disk, foreign, damaged or later file, missing permission."""


class DaqError(RigError):
    """A driver cannot carry out a request; the message names the channel or port and what to do."""


class DaqTimeout(DaqError):  # noqa: N818 (the names of the DAQ contract)
    """The device has not delivered or taken a block within the agreed time."""


class DaqDisconnected(DaqError):  # noqa: N818
    """The device is gone: unplugged, switched off, or its port was closed."""


class DaqOverrun(DaqError):  # noqa: N818
    """Samples were lost and the driver cannot continue: their position is unknown, or the device has stopped."""


class DaqRefused(DaqError):  # noqa: N818
    """The device or bus does not support the requested rate, block, voltage or channels."""


class DaqBusy(DaqError):  # noqa: N818
    """The port exists, but another process uses it."""


class DaqMismatch(DaqError):  # noqa: N818
    """The device's channels, ranges or rates differ from those of the bench."""


class DaqProtocol(DaqError):  # noqa: N818
    """The answering device uses another version or another protocol, or two devices answer at once."""


class DaqReset(DaqError):  # noqa: N818
    """The device has restarted during a run."""


class DaqWatchdog(DaqError):  # noqa: N818
    """The device's watchdog has set the output to 0 V, because no output arrived in time."""


class DaqEmergencyStop(DaqError):  # noqa: N818
    """The emergency stop has set the output to 0 V."""


class NotArmed(RigError):  # noqa: N818
    """Something physical would move and nobody has armed the bench."""


def as_daq_error(error: Exception) -> DaqError:
    """Return a driver's exception as a `DaqError`: unchanged if it is one, else a new one that names the exception."""
    return error if isinstance(error, DaqError) else DaqError(f"the driver has failed: {type(error).__name__}: {error}")
