"""A firmware as the emulated device: its program is a child process, and this process is the virtual structure behind it.

The exchange is that of ``firmware/boards/plant/plant.h``: a description in lines of text, then requests with output counts,
each answered by flags and a row of input counts for every output.
"""

import os
import select
import signal
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import IO

import numpy as np

from rig.emulator.parameters import LARGEST_BLOCK, LONGEST_WATCHDOG_US, SHORTEST_WATCHDOG_US
from rig.emulator.plant import OutputLog, VirtualPlant
from rig.emulator.programs import Running, running
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqDisconnected, DaqProtocol
from rig.wire.messages import DeviceFlag

STARTING_S = 30.0
"""Time in which a program has to say that it can be reached, s."""
ENDING_S = 5.0  # s that a program may take to end; chosen
POLL_S = 0.1
"""How often the order to end is looked for, s."""
BAD_DESCRIPTION = 2  # status with which a program refuses its description
MOST_TEXT = 32  # bytes of a text parameter (docs/reference/wire-protocol.md)
HEADER = struct.Struct("<I")


class Firmware:
    """A program that runs, as the structure behind it sees it."""

    def __init__(self, program: Running, plant: VirtualPlant) -> None:
        self.child, self.port = program.child, program.port
        self._has_stop = not program.in_qemu
        self._requests, self._answers, self._plant = program.requests, program.answers, plant

    def begin(self, text: str) -> None:
        """Send the description, and answer the first request: by it the program says that it can be reached."""
        until_s = time.monotonic() + STARTING_S
        with suppress(BrokenPipeError):
            self._write(text.encode("ascii"))
            while time.monotonic() < until_s:
                if self._has_asked():
                    if self._answer():
                        return
                    break
        raise self.failure()

    def serve(self, should_end: Callable[[], bool]) -> bool:
        """Answer requests until ``should_end``; False once the program has ended by itself."""
        while not should_end():
            try:
                if self._has_asked() and not self._answer():
                    return False
            except BrokenPipeError:
                return False
        return True

    def _has_asked(self) -> bool:
        return bool(select.select((self._requests,), (), (), POLL_S)[0])

    def _answer(self) -> bool:
        head = self._read(HEADER.size)
        n = HEADER.unpack(head)[0] if head else 0
        if n > LARGEST_BLOCK:
            raise DaqProtocol(f"firmware: asks for a block of {n} samples, allowed is {LARGEST_BLOCK}")
        data = self._read(4 * n)
        if not head or data is None:
            return False
        if n == 0:
            self._plant.reset()
            self._write(HEADER.pack(0))
            return True
        counts, flags = self._plant.step(np.frombuffer(data, "<i4") * self._plant.output_v_per_count)
        self._write(HEADER.pack(flags & DeviceFlag.OVERLOAD) + counts.astype("<i4").tobytes())
        return True

    def _read(self, n: int) -> bytes | None:
        data = b""
        while len(data) < n:
            more = os.read(self._requests, n - len(data))
            if not more:
                return None
            data += more
        return data

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._answers, data) :]

    def press_emergency_stop(self) -> None:
        """Press its emergency stop, if it has one."""
        if self._has_stop:
            self.child.send_signal(signal.SIGUSR1)

    def failure(self) -> ConfigurationError | DaqDisconnected:
        """The error for a program that has ended by itself, with what it said."""
        self._wait(ENDING_S)
        said = _text(self.child.stderr) or "it said nothing"
        if self.child.returncode == BAD_DESCRIPTION:
            return ConfigurationError(f"refuses to be this device: {said}", field="firmware")
        return DaqDisconnected(f"firmware: the program has ended, status {self.child.returncode}: {said}")

    def end(self) -> dict[str, int]:
        """Tell it to end; what it has counted."""
        self.child.terminate()
        until_s = time.monotonic() + ENDING_S
        self.serve(lambda: time.monotonic() > until_s)  # for it may wait for an answer
        self._wait(POLL_S)
        words = _text(self.child.stdout).split()
        counts = zip(words[::2], words[1::2], strict=False)
        return {name: int(count) for name, count in counts if count.isdigit() and int(count)}

    def _wait(self, longest_s: float) -> None:
        try:
            self.child.wait(longest_s)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()


def _text(pipe: IO[bytes] | None) -> str:
    return " ".join(pipe.read().decode("utf-8", "replace").split()) if pipe is not None else ""


@contextmanager
def started(settings: EmulatorSettings, plant: VirtualPlant) -> Iterator[Firmware]:
    """The firmware of the settings, reachable. Raises `ConfigurationError`, `rig.errors.DaqError`."""
    with running(settings) as program:
        if settings.log_output is not None and program.in_qemu:
            plant.log = OutputLog(settings.log_output)
        firmware = Firmware(program, plant)
        firmware.begin(description(settings, plant))
        yield firmware


def description(settings: EmulatorSettings, plant: VirtualPlant) -> str:
    """The lines by which a program learns what device it is."""
    lines = {
        "model": "vibrolock firmware",
        "firmware": "1.0",
        "serial_number": _printable(settings.serial_number),
        "boot": time.time_ns() >> 20 & 0xFFFFFFFF,  # milliseconds or so: another number at every start
        "simulated": settings.simulated,
        "bits": plant.bits,
        "rate_mhz": round(1e3 * plant.rate_hz),
        "shortest_watchdog_us": SHORTEST_WATCHDOG_US,
        "longest_watchdog_us": LONGEST_WATCHDOG_US,
        "filter_delay_ns": round(1e9 * plant.filter_delay_s),
        "filter_delay_s": float(plant.filter_delay_s).hex(),
        "output": f"{float(plant.output_range_v).hex()} {float(plant.output_v_per_count).hex()}",
        "wire": "serial" if settings.wire == "serial" else "can-fd" if settings.fd else "can",
        "node": settings.node,
        "lockstep": int(settings.lockstep),
    }
    channels = zip(plant.names, plant.range_v, plant.v_per_count, plant.skew_s, strict=True)
    rows = [
        f"channel {_printable(name)} {float(range_v).hex()} {float(step_v).hex()} {round(1e9 * float(skew_s))}"
        for name, range_v, step_v, skew_s in channels
    ]
    return "\n".join([*(f"{name} {value}" for name, value in lines.items()), *rows, "end\n"])


def _printable(text: str) -> str:
    return "".join(one if " " <= one <= "~" else "?" for one in text)[:MOST_TEXT]
