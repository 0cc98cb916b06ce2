"""The package ``nidaqmx``: NI's driver of this computer, or an NI gRPC Device Server."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rig.errors import DaqBusy, DaqDisconnected, DaqError, DaqMismatch, DaqOverrun, DaqRefused, DaqTimeout, DaqWatchdog

MISSING = "the package nidaqmx is not installed (pip install 'vibrolock[ni]')"
"""What to do where the package is missing."""
NO_DRIVER = "NI-DAQmx is not installed on this computer; get it from ni.com (`nidaqmx installdriver` fetches it)"
"""What to do where NI's driver is missing."""

_GONE = "the device is gone: look at power and cable, see it in NI MAX or `rig list --devices`, then `rig resume`"
_OVERRUN = "inputs were not fetched in time: use longer blocks, a lower rate, or fewer programs beside it"
_UNDERFLOW = (
    "the output buffer ran empty and the device stopped the output, where it was: give driver.options.buffer_blocks more, "
    "and look at the output before anything else is started"
)
_RESERVED = "another program or task uses it: end that one (NI MAX's test panels too)"
_RANGE = "no range of the device holds it: see output_range_v, range_v of the channels and the device's data sheet"
_RATE = "the device does not sample at that rate: see sample_rate_hz and the device's data sheet"
_CLOCK = (
    "no samples came: see the cables of clock and start trigger where the bench names some (driver.options.clock, "
    "output_clock, trigger), and driver.options.timeout_s"
)
_ABORTED = "another program aborted the task or reset the device; start again"
_ROUTE = (
    "no line joins these terminals: see driver.options.clock, output_clock, trigger and output_trigger; across devices "
    "without a common bus, lead the clock through a cable"
)
_CHANNEL = "there is no such channel: see driver.options.output and inputs, and `rig list --devices`"
_SETTING = (
    "the channel has no such setting: see driver.options.coupling, terminal and excitation_ma, and the data sheet"
)
_EXPIRED = "the device's watchdog has expired and set the output to 0 V, because this computer did not answer in time"
_WAITED = "the device did not answer in time: see driver.options.timeout_s"

ERRORS: dict[type[DaqError], dict[str, tuple[int, ...]]] = {
    DaqDisconnected: {
        _GONE: (
            -200045,  # DEVICE_REMOVED
            -200324,  # DEV_ABSENT_OR_UNAVAILABLE
            -89130,  # the same of routing
            -201003,  # DEV_CANNOT_BE_ACCESSED
            -200220,  # INVALID_DEVICE_ID
            -201390,  # NETWORK_STATUS_CONNECTION_LOST
            -201253,  # NETWORK_STATUS_DOWN
            -201252,  # NETWORK_TARGET_UNREACHABLE
            -201250,  # NETWORK_STATUS_TIMED_OUT
            -201423,  # CHASSIS_COMMUNICATION_INTERRUPTED
            -50401,  # PAL_COMMUNICATIONS_FAULT
            -50405,  # PAL_TRANSFER_ABORTED
            -50802,  # PAL_CONNECTION_ABORTED
        )
    },
    DaqOverrun: {
        _OVERRUN: (
            -200279,  # SAMPLES_NO_LONGER_AVAILABLE
            -200222,  # ACQ_STOPPED_TO_PREVENT_INPUT_BUFFER_OVERWRITE
            -200613,  # the same, with one way of transfer
            -200283,  # ACQ_STOPPED_TO_PREVENT_INTERMEDIATE_BUFFER_OVERFLOW
            -200010,  # INPUT_FIFO_OVERFLOW
            -200361,  # INPUT_FIFO_OVERFLOW_2
            -209829,  # INPUT_FIFO_OVERFLOW_3
            -200714,  # ACQ_STOPPED_DRIVER_CANT_XFER_DATA_FAST_ENOUGH
        ),
        _UNDERFLOW: (
            -200290,  # GEN_STOPPED_TO_PREVENT_REGEN_OF_OLD_SAMPLES
            -200291,  # GEN_STOPPED_TO_PREVENT_INTERMEDIATE_BUFFER_REGEN_OF_OLD_SAMPLES
            -200289,  # SAMPLES_NO_LONGER_WRITEABLE
            -200462,  # OUTPUT_BUFFER_EMPTY
            -200166,  # OUTPUT_BUFFER_UNDERWRITE
            -200016,  # OUTPUT_FIFO_UNDERFLOW
            -200621,  # OUTPUT_FIFO_UNDERFLOW_2
            -200018,  # DAC_UNDERFLOW
        ),
    },
    DaqBusy: {
        _RESERVED: (
            -200022,  # RESOURCE_ALREADY_RESERVED
            -201105,  # RESOURCE_RESERVED_WITH_CONFLICTING_SETTINGS
            -50103,  # PAL_RESOURCE_RESERVED
            -201420,  # NETWORK_DEVICE_RESERVED_BY_ANOTHER_HOST
            -201273,  # NETWORK_DEVICE_IN_USE
        )
    },
    DaqRefused: {
        _RANGE: (
            -200490,  # SAMPLE_VALUE_OUT_OF_RANGE
            -200561,  # INVALID_AO_DATA_WRITE
            -200075,  # SUPPLIED_VOLTAGE_DATA_OUTSIDE_SPECIFIED_RANGE
            -200759,  # AO_MIN_MAX_NOT_IN_DAC_RANGE
            -200760,  # AO_MIN_MAX_NOT_IN_GAIN_RANGE
            -200872,  # AO_MIN_MAX_NOT_SUPPORTED_GIVEN_DAC_RANGE
        ),
        _RATE: (
            -200332,  # SAMP_RATE_TOO_HIGH
            -200331,  # SAMP_RATE_TOO_LOW
            -200660,  # SAMP_CLK_RATE_UNAVAILABLE
            -201093,  # SAMP_CLK_RATE_INVALID
            -200081,  # SAMPLE_RATE_NUM_CHANS_CONVERT_PERIOD_COMBO
            -201002,  # SAMP_CLK_RATE_DOESNT_MATCH_SAMP_CLK_SRC
        ),
        _ROUTE: (
            -89120,  # INVALID_ROUTING_SOURCE_TERMINAL_NAME_ROUTING
            -89125,  # TRIG_LINE_NOT_FOUND_ROUTING
            -89136,  # ROUTE_NOT_SUPPORTED_BY_HW_ROUTING
            -89137,  # RESOURCES_IN_USE_FOR_ROUTE_ROUTING
            -89139,  # NO_COMMON_TRIG_LINE_FOR_ROUTE_ROUTING
            -200040,  # INVALID_ROUTING_SOURCE_TERMINAL_NAME
            -200368,  # ROUTE_NOT_SUPPORTED_BY_HW
            -200369,  # RESOURCES_IN_USE_FOR_ROUTE
            -200395,  # NO_COMMON_TRIG_LINE_FOR_TASK_ROUTE
            -200414,  # INVALID_SAMP_CLK_SRC
        ),
        _SETTING: (
            -200077,  # INVALID_ATTRIBUTE_VALUE
            -200452,  # ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT
            -201172,  # IEPE_WITH_DC_NOT_ALLOWED
            -201498,  # NO_IEPE_WITH_AC_NOT_ALLOWED
            -200161,  # INT_EXCIT_SRC_NOT_AVAILABLE
            -200817,  # EXCITATION_NOT_SUPPORTED_WHEN_TERM_CFG_DIFF
        ),
    },
    DaqMismatch: {
        _CHANNEL: (
            -200170,  # PHYSICAL_CHAN_DOES_NOT_EXIST
            -200087,  # INVALID_CHANNEL
            -200461,  # INVALID_CHAN_NAME
            -200431,  # PHYS_CHAN_MEAS_TYPE
        )
    },
    DaqTimeout: {
        _CLOCK: (
            -200284,  # SAMPLES_NOT_YET_AVAILABLE
            -200303,  # EXT_SAMP_CLK_SRC_NOT_SPECIFIED
            -201461,  # REFERENCE_CLOCK_NOT_PRESENT
            -201015,  # PLL_NOT_LOCKED
        ),
        _WAITED: (
            -200221,  # TIMEOUT_EXCEEDED
            -200474,  # OPERATION_TIMED_OUT
            -200292,  # SAMPLES_CAN_NOT_YET_BE_WRITTEN
        ),
    },
    DaqWatchdog: {
        _EXPIRED: (
            -200678,  # WRITE_FAILED_BECAUSE_WATCHDOG_EXPIRED
            -201434,  # CONFIG_FAILED_BECAUSE_WATCHDOG_EXPIRED
            -200681,  # ROUTE_FAILED_BECAUSE_WATCHDOG_EXPIRED
            -201478,  # CHASSIS_WATCHDOG_TIMER_EXPIRED
        )
    },
    DaqError: {
        _ABORTED: (
            -201452,  # OPERATION_ABORTED
            -88709,  # RUNTIME_ABORTED_ROUTING
            -88710,  # RUNTIME_ABORTING_ROUTING
            -200088,  # INVALID_TASK
            -200278,  # SAMPLES_WILL_NEVER_BE_AVAILABLE
        )
    },
}
"""What NI's errors become, and what to do: the codes of ``nidaqmx.error_codes.DAQmxErrors``."""

BY_CODE = {code: (kind, what) for kind, group in ERRORS.items() for what, codes in group.items() for code in codes}
"""Kind and advice by NI's code."""


def library() -> Any:
    """Return the package ``nidaqmx``.

    Raises `DaqRefused` where it is not installed.
    """
    try:
        import nidaqmx
    except ImportError:
        raise DaqRefused(MISSING) from None
    return nidaqmx


def as_ni_error(error: Exception, where: str) -> DaqError:
    """Return an exception of the package as one of ours, by NI's code; ``where``: the channel or device."""
    from nidaqmx import errors

    if isinstance(error, DaqError):
        return error
    if isinstance(error, errors.DaqNotFoundError | errors.DaqNotSupportedError):
        return DaqRefused(NO_DRIVER)
    if isinstance(error, errors.RpcError):
        if any(code in str(error) for code in ("UNAVAILABLE", "CANCELLED")):  # is not there; went away
            return DaqDisconnected(f"the device server does not answer ({error})", where=where)
        return DaqError(f"the device server has failed ({error})", where=where)
    if not isinstance(error, errors.DaqError):
        return DaqError(f"the driver has failed: {type(error).__name__}: {error}", where=where)
    kind, what = BY_CODE.get(error.error_code, (DaqError, "NI-DAQmx has refused it"))
    said = " ".join(str(error).partition("\n")[0].split())
    return kind(f"{what} (NI-DAQmx {error.error_code}: {said})", where=where)


@contextmanager
def ni_errors(where: str) -> Iterator[None]:
    """Turn exceptions of the package into ours."""
    try:
        yield
    except Exception as error:
        raise as_ni_error(error, where) from error


class Session:
    """Where tasks are made: on this computer, or on a device server. ``options`` goes to each of them."""

    def __init__(self, server: str = "") -> None:
        self.ni = library()
        self.options: object = None
        self._channel: Any = None
        if server:
            try:
                import grpc
            except ImportError:
                raise DaqRefused("the package grpcio is not installed (pip install 'nidaqmx[grpc]')") from None
            self._channel = grpc.insecure_channel(server)
            self.options = self.ni.GrpcSessionOptions(self._channel, "")
        self.where = server or "NI-DAQmx"

    def system(self) -> Any:
        """The devices there are. Raises `DaqRefused` where NI's driver is missing."""
        from nidaqmx.system import System

        with ni_errors(self.where):
            return System.remote(self.options) if self.options else System.local()

    def close(self) -> None:
        """Let the server go."""
        if self._channel is not None:
            self._channel.close()


def value_or(read: Callable[[], Any], otherwise: Any) -> Any:
    """Return an attribute of a device, or something else where the device, NI's driver or the server does not have it."""
    from nidaqmx.errors import Error

    try:
        return read()
    except Error:
        return otherwise
