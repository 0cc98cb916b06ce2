"""The errors of the bench: a small tree, each with one clear line that says what happened, where, and what to do."""

__all__ = [
    "ConfigurationError",
    "DaqDisconnected",
    "DaqError",
    "DaqOverrun",
    "DaqRefused",
    "DaqTimeout",
    "RecordingError",
    "RigError",
]


class RigError(Exception):
    """Anything that the bench reports to its user; the command line prints it as one line."""


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
    """Samples were lost because the host came too late."""


class DaqRefused(DaqError):  # noqa: N818
    """The device or bus cannot carry what was asked for: rate, block, voltage or channels."""
