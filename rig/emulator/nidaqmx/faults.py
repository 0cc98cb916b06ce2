"""Errors of NI-DAQmx that a call ends with on request."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from nidaqmx.error_codes import DAQmxErrors

from rig.emulator.nidaqmx.errors import NiError
from rig.errors import ConfigurationError


@dataclass
class Injection:
    """From the ``after``-th call of a name on, ``times`` calls of that name end with an error."""

    call: str
    """Name of the call in NI's gRPC interface, such as ``ReadAnalogF64``; ``*`` for all."""
    code: DAQmxErrors
    after: int = 1
    times: int = 1
    seen: int = field(default=0, init=False)

    def is_due(self, call: str) -> bool:
        """Count a call; whether it ends with the error."""
        if self.call not in ("*", call):
            return False
        self.seen += 1
        return self.after <= self.seen < self.after + self.times

    @property
    def error(self) -> NiError:
        """The error."""
        read, written = (0 if verb in self.call else None for verb in ("Read", "Write"))
        return NiError(self.code, "raised on request", read=read, written=written)


def injections(faults: Mapping[str, Mapping[str, int]]) -> list[Injection]:
    """Errors by call, from settings. Raises `ConfigurationError` for one that is none of NI-DAQmx."""
    out = []
    for call, fields in faults.items():
        try:
            out.append(Injection(call, **{**fields, "code": DAQmxErrors(fields["code"])}))
        except (TypeError, KeyError, ValueError) as error:
            raise ConfigurationError(
                f"{error}", field=f"faults.{call}", value=dict(fields), allowed="code of NI-DAQmx, after and times"
            ) from error
    return out
