"""What the emulated NI-DAQmx refuses, by NI's codes."""

from nidaqmx.error_codes import DAQmxErrors


class NiError(Exception):
    """A call ends with an error of NI-DAQmx; a read or write tells how many samples a channel it has done before that."""

    def __init__(self, code: DAQmxErrors, reason: str, *, read: int | None = None, written: int | None = None) -> None:
        super().__init__(f"{code.name}: {reason}")
        self.code, self.reason = code, reason
        self._done = {"ni-samps-per-chan-read": read, "ni-samps-per-chan-written": written}

    @property
    def metadata(self) -> tuple[tuple[str, str], ...]:
        """Entries of the trailing metadata, from which NI's package makes its exception."""
        done = [(key, str(count)) for key, count in self._done.items() if count is not None]
        return (("ni-error", str(self.code.value)), *done)
