"""Emulators from Python: each runs in its own process and is reached by an ordinary bench."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

from rig import errors
from rig.bench import Bench, DriverChoice
from rig.bench.configuration import Table, validated
from rig.emulator.settings import EmulatorSettings

ENDING_S = 10.0
"""Longest time for the process to end, s; chosen."""
LOCKSTEP_S = 60.0
"""Watchdog and time-out of a bench whose device waits for the host, s."""

HARDWARE_S = 1.0
"""The same watchdog where the device does not report itself as simulated, s: drivers allow no longer one."""


def driver_options(options: Table, *, lockstep: bool, as_hardware: bool = False) -> Table:
    """Options of a driver that reaches an emulator; with long time-outs where the device waits for the host."""
    watchdog_s = HARDWARE_S if as_hardware else LOCKSTEP_S
    patience = {"watchdog_s": watchdog_s, "timeout_s": LOCKSTEP_S} if lockstep else {}
    return {**patience, **options}


def reaching(bench: Bench, wire: str, options: Table) -> Bench:
    """Return the bench with which a host reaches the emulator of a virtual bench."""
    if wire == "sound":
        from rig.emulator.sound import reaching_bench

        return reaching_bench(bench, options)
    if wire == "nidaqmx":
        from rig.emulator.nidaqmx.reaching import reaching_bench as chassis_bench

        return chassis_bench(bench, options)
    return bench.model_copy(update={"driver": DriverChoice(name=wire, options=options)})


class Emulator:
    """An emulator in a process of its own; a context manager.

    ``bench`` reaches it. ``counted`` is filled when it ends: watchdog trips, held blocks, damaged frames and so on.
    Errors: `ConfigurationError` or a `DaqError` for what the emulator refuses.
    """

    def __init__(self, bench: Bench, wire: str = "serial", *, options: Table | None = None, **settings: object) -> None:
        table = {"wire": wire, "bench": bench.model_dump(), **settings}
        self._settings = validated(EmulatorSettings, table, "emulator")
        self._options = options or {}
        self.bench = bench
        self.counted: dict[str, int] = {}
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> Self:
        """Start it and wait until it can be reached."""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rig.emulator"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C at the terminal reaches the host only
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(self._settings.model_dump_json() + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            self.stop()
            raise errors.DaqRefused("the emulator ended before it could be reached")
        message = json.loads(line)  # of `rig.emulator.__main__`
        if "error" in message:
            self.process.wait(ENDING_S)
            self.stop()
            raise getattr(errors, message["error"], errors.DaqError)(message["message"])
        lockstep, as_hardware = self._settings.lockstep, self._settings.as_hardware
        options = {**message["ready"]["options"], **self._options}
        options = driver_options(options, lockstep=lockstep, as_hardware=as_hardware)
        self.bench = reaching(self._settings.bench, self._settings.wire, options)
        return self

    def press_emergency_stop(self) -> None:
        """Press the device's own emergency stop. `DaqRefused` on a system without SIGUSR1 (Windows)."""
        if not hasattr(signal, "SIGUSR1"):
            raise errors.DaqRefused(
                "the emulator's emergency stop is pressed by a signal that this system does not have"
            )
        if self.process is not None:
            os.kill(self.process.pid, signal.SIGUSR1)

    def stop(self) -> None:
        """End it; any number of times."""
        process, self.process = self.process, None
        if process is None:
            return
        process.terminate()
        try:
            said, _ = process.communicate(timeout=ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            said, _ = process.communicate()
        for line in said.splitlines():
            self.counted = json.loads(line).get("counted", self.counted)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()


@contextmanager
def emulated(
    bench: Bench,
    wire: str = "serial",
    *,
    lockstep: bool = True,
    seed: int = 0,
    options: Table | None = None,
    **settings: object,
) -> Iterator[Bench]:
    """Emulate a virtual bench over ``serial``, ``can``, ``sound`` or ``nidaqmx``; gives a bench that reaches it.

    ``options`` are further driver options (``queue_blocks``, ``watchdog_s``...), ``settings`` further `EmulatorSettings`.
    """
    with Emulator(bench, wire, options=options, lockstep=lockstep, seed=seed, **settings) as emulator:
        yield emulator.bench
