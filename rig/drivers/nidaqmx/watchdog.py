"""The watchdog of an output's device, where it has one: 0 V when nothing has been heard of this computer for a while."""

import time
from contextlib import suppress
from typing import Any

from rig.drivers.nidaqmx.library import Session, ni_errors

FEEDS = 4
"""Number of times that a watchdog is fed within its time; chosen."""


class DeviceWatchdog:
    """NI's watchdog task on the device of an output, reserved before the other tasks, as NI-DAQmx wants it.

    Most devices have none: ``about`` says so, and nothing is fed then. The first `feed` starts it. ``was_expired``: it had
    expired before and has been cleared; the output is at 0 V then.
    """

    def __init__(self, session: Session, output: str, timeout_s: float) -> None:
        from nidaqmx.constants import TaskMode, WatchdogAOExpirState
        from nidaqmx.errors import Error
        from nidaqmx.system.watchdog import AOExpirationState, WatchdogTask

        self.about, self.was_expired = f"0 V after {timeout_s:g} s", False
        self._output, self._between_s, self._fed_s = output, timeout_s / FEEDS, 0.0
        self._task: Any = None
        try:
            self._task = WatchdogTask(output.partition("/")[0], timeout=timeout_s, grpc_options=session.options)
            self._task.cfg_watchdog_ao_expir_states([AOExpirationState(output, 0.0, WatchdogAOExpirState.VOLTAGE)])
            self._task.control(TaskMode.TASK_COMMIT)
            self.was_expired = bool(self._task.expired)
            if self.was_expired:
                self._task.clear_expiration()
        except Error as error:  # also where NI's driver or the server does not know of watchdogs
            self.about = f"the device has none that could be used ({str(error).partition(chr(10))[0]})"
            self.close()

    def feed(self) -> None:
        """Tell the device that this computer is there, when it is time again."""
        if self._task is None:
            return
        now_s = time.monotonic()
        if now_s - self._fed_s < self._between_s:
            return
        with ni_errors(self._output):
            self._task.reset_timer() if self._fed_s else self._task.start()
        self._fed_s = now_s

    def close(self) -> None:
        """Stop it and let it go; also where the device is gone."""
        task, self._task = self._task, None
        if task is not None:
            for end in (task.stop, task.close):
                with suppress(Exception):
                    end()
