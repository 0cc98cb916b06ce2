"""States of a device, what has latched, and the watchdog. Every transition out of ARMED brings the output to 0 V."""

import math
from collections import Counter
from collections.abc import Callable

from rig.emulator.parameters import Parameters
from rig.emulator.sampling import Sampling
from rig.wire.messages import ARM_KEY, DeviceFlag, DeviceState, Parameter, Status

ARMED = DeviceState.ARMED  # a member of an Enum is looked up slowly, and this one is asked for with every message


class StateMachine:
    """States and the transitions between them.

    ``changed`` is called with the time at every change of the state or of what has latched. Commands return the status and
    value of their answer.
    """

    def __init__(
        self, sampling: Sampling, parameters: Parameters, counts: Counter[str], changed: Callable[[float], None]
    ) -> None:
        self._sampling, self._parameters, self._counts, self._changed = sampling, parameters, counts, changed
        self.state = DeviceState.IDLE
        self.latch = 0
        """What has latched, as `DeviceFlag`."""
        self.is_pressed = False
        """Whether the device's own emergency stop is pressed and stays so."""
        self._fed_s = math.inf
        self._watchdog_s = 1.0

    @property
    def bites_s(self) -> float:
        """Time at which the watchdog trips unless it is fed before."""
        return self._fed_s + self._watchdog_s

    def feed(self, now_s: float, *, in_time: bool) -> None:
        """Note a valid output. One that is entirely late reaches no converter, so it does not feed the watchdog."""
        if self.state is ARMED:
            self._fed_s = now_s if in_time else self._fed_s

    def stand_still(self, late_s: float) -> None:
        """Extend the watchdog by a time for which the device clock stood still."""
        self._fed_s += late_s

    def watch(self, now_s: float) -> None:
        """Trip the watchdog if its time is over."""
        bites_s = self.bites_s
        if now_s >= bites_s and self.state is ARMED:
            self._counts["watchdog_trips"] += 1
            ramp_s = 1e-6 * self._parameters.value(Parameter.RAMP_US)
            self._bring_down(bites_s, DeviceState.LATCHED, ramp_s, DeviceFlag.WATCHDOG)

    def start(self, now_s: float) -> tuple[Status, int]:
        """Begin to sample with the present settings."""
        if self.state is DeviceState.LATCHED:
            return Status.LATCHED, self.latch
        if self.state is not DeviceState.IDLE:
            return Status.WRONG_STATE, int(self.state)
        value = self._parameters.value
        self._watchdog_s = 1e-6 * value(Parameter.WATCHDOG_US)
        rate_hz = 1e-3 * value(Parameter.RATE_MHZ)
        longest_period = self._parameters.words.get((Parameter.LONGEST_PERIOD, 0), 0)
        self._sampling.start(rate_hz, value(Parameter.BLOCK), value(Parameter.QUEUE), longest_period, now_s)
        self._become(DeviceState.RUNNING, now_s)
        return Status.DONE, 0

    def arm(self, key: int, now_s: float) -> tuple[Status, int]:
        """Pass outputs to the converter."""
        if key != ARM_KEY:
            return Status.NOT_ALLOWED, 0
        if self.state is DeviceState.LATCHED:
            return Status.LATCHED, self.latch
        if self.state is not DeviceState.RUNNING:
            return Status.WRONG_STATE, int(self.state)
        self._sampling.let_outputs_through(now_s)
        self._fed_s = now_s
        self._become(DeviceState.ARMED, now_s)
        return Status.DONE, 0

    def disarm(self, now_s: float) -> tuple[Status, int]:
        """Set the output to 0 V at once, also from the watchdog's ramp; sampling continues."""
        if self.state is DeviceState.ARMED:
            self._bring_down(now_s, DeviceState.RUNNING)
        elif self._sampling.is_ramping:
            self._bring_down(now_s, self.state)
        return Status.DONE, int(self.state)

    def stop(self, now_s: float) -> tuple[Status, int]:
        """Set the output to 0 V at once and end sampling; latched flags stay."""
        self._sampling.stop()
        self._fed_s = math.inf
        if self.state is not DeviceState.LATCHED:
            self._become(DeviceState.IDLE, now_s)
        return Status.DONE, int(self.state)

    def clear(self, now_s: float) -> tuple[Status, int]:
        """Clear latched flags, unless the emergency stop is still pressed."""
        if self._sampling.on:
            return Status.WRONG_STATE, int(self.state)
        if self.latch and self.is_pressed:
            return Status.LATCHED, self.latch
        self._become(DeviceState.IDLE, now_s, latch=0)
        return Status.DONE, int(self.state)

    def emergency_stop(self, now_s: float) -> None:
        """Set the output to 0 V at once, and latch."""
        self._counts["emergency_stops"] += 1
        self._bring_down(now_s, DeviceState.LATCHED, flag=DeviceFlag.EMERGENCY_STOP)

    def begin_anew(self) -> None:
        """Reset as after power loss, without notification."""
        self._sampling.stop()
        self._sampling.measured = 0
        self._fed_s = math.inf
        self.state, self.latch = DeviceState.IDLE, 0

    def _become(self, state: DeviceState, now_s: float, latch: int | None = None) -> None:
        before = self.state, self.latch
        self.state, self.latch = state, self.latch if latch is None else latch
        if (self.state, self.latch) != before:
            self._changed(now_s)

    def _bring_down(self, at_s: float, state: DeviceState, ramp_s: float = 0.0, flag: int = 0) -> None:
        self._sampling.bring_down(at_s, ramp_s)
        self._fed_s = math.inf
        self._become(state, at_s, self.latch | flag)
