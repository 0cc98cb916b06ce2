"""Transports by which a test runs without a rig: virtual driver, emulators of wires and of a sound card, firmware."""

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.bench import Bench
from rig.drivers.sound.devices import library
from rig.emulator.emulated import emulated
from rig.errors import DaqRefused

EMULATED_BLOCK = 10
"""Samples a block, 2 ms at 5 kHz: what a host with ordinary scheduling keeps up with."""
ARM = 40
"""Machine in the header of an ELF file."""
CLASSICAL_PART = 0.5
"""Part of the bench's sample rate: classical CAN cannot carry 5 kHz sample by sample."""
SOUND_RATES_HZ = (48000.0, 12000.0, 6000.0)
"""Sample rates of the benches at an emulated sound card: its own, and fractions of it."""
FILTER_PART = 0.4
"""Corner of the virtual converter's filter at another sample rate, as a part of that rate; chosen."""


@dataclass(frozen=True)
class Transport:
    """What carries a test between host and device."""

    name: str
    wire: str | None = None
    """``serial``, ``can`` or ``sound``; None for the virtual driver in this process."""
    lockstep: bool = True
    """Whether the device waits for the host."""
    rate_part: float = 1.0
    """Sample rate, as a part of the bench's."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Further settings of the emulator (`rig.emulator.settings.EmulatorSettings`)."""
    rate_hz: float | None = None
    """Sample rate at a sound card, which runs at its own."""

    def scaled(self, bench: Bench) -> Bench:
        """Return the bench at the rate and with the block of this transport."""
        changes: dict[str, Any] = {}
        if self.wire is not None and self.rate_hz is None:
            changes["block"] = max(bench.block, EMULATED_BLOCK)
        if self.rate_part != 1.0:
            rate_hz = self.rate_part * bench.sample_rate_hz
            converter = {**bench.driver.table("converter"), "anti_alias_hz": FILTER_PART * rate_hz}
            options = {**bench.driver.options, "converter": converter}
            changes |= {"sample_rate_hz": rate_hz, "driver": bench.driver.model_copy(update={"options": options})}
        return bench.model_copy(update=changes)

    @contextmanager
    def opened(self, bench: Bench, output_log: Path) -> Iterator[Bench]:
        """Give a bench that reaches the device while the context lasts; its outputs are written to ``output_log``."""
        bench = self.scaled(bench)
        if self.wire is None:
            yield bench
            return
        with emulated(bench, self.wire, lockstep=self.lockstep, log_output=output_log, **self.settings) as reached:
            yield reached if self.rate_hz is None else at_rate(reached, self.rate_hz)


def transports(firmware: Sequence[Path] = ()) -> list[Transport]:
    """Return the transports that every machine has, and those to ``firmware``: files for the host or for ARM (QEMU)."""
    out = [Transport("virtual"), *_wires("emulator"), *_sound_cards()]
    for path in firmware:
        settings = {"firmware": path}
        if is_arm(path):  # time in QEMU is not real, and its serial line is slow
            out.append(Transport(f"serial, firmware {path.stem} in QEMU, in lockstep", "serial", settings=settings))
        else:
            out += _wires(f"firmware {path.name}", **settings)
    return out


def _wires(device: str, **settings: Any) -> Iterator[Transport]:
    """Yield serial, CAN FD and classical CAN to a device, by the clock and in lockstep."""
    for lockstep, how in ((False, "by the clock"), (True, "in lockstep")):
        yield Transport(f"serial, {device} {how}", "serial", lockstep, settings=settings)
        yield Transport(f"CAN FD, {device} {how}", "can", lockstep, settings=settings)
        yield Transport(f"classical CAN, {device} {how}", "can", lockstep, CLASSICAL_PART, {"fd": False, **settings})


def _sound_cards() -> Iterator[Transport]:
    """Yield an emulated sound card at each rate; nothing where PortAudio or JACK is missing, with a word."""
    try:
        library()
        import jack  # noqa: F401
    except (DaqRefused, ImportError, OSError) as error:
        missing = str(error)
    else:
        missing = "" if shutil.which("jackd") else "the program jackd is not installed"
    if missing:
        print(f"left out: the emulated sound card: {missing}", file=sys.stderr)
        return
    for rate_hz in SOUND_RATES_HZ:
        name = f"sound at {1e-3 * rate_hz:g} kHz, emulated card by the clock"
        yield Transport(name, "sound", lockstep=False, rate_hz=rate_hz)


def at_rate(bench: Bench, rate_hz: float) -> Bench:
    """Return the bench of an emulated sound card at another rate, with a block of a period of the audio system."""
    options = bench.driver.options
    block = round(int(str(options["period_frames"])) * rate_hz / float(str(options["device_rate_hz"])))
    return bench.model_copy(update={"sample_rate_hz": rate_hz, "block": block})


def is_arm(path: Path) -> bool:
    """Return whether a file is an ELF file of machine code for ARM, 32 bit; False if it cannot be read."""
    try:
        with path.open("rb") as stream:
            head = stream.read(20)
    except OSError:
        return False
    return head[:4] == b"\x7fELF" and int.from_bytes(head[18:20], "little") == ARM
