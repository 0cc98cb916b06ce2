"""How the program of a firmware is run: on this computer, or an image for ARM in QEMU."""

import os
import re
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from rig.emulator.plant import check_log
from rig.emulator.ports import named, pseudo_terminal
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqRefused

ARM_MACHINE = 40  # e_machine of an ELF file
QEMU = "qemu-system-arm"
BOARDS = ("mps2-an386", "mps2-an500")
"""QEMU's boards: an image runs on the one after which it is named, or on the first."""
STARTING_S = 30.0  # s that a program may take to start; chosen
POLL_S = 0.02  # s between two looks at a program that starts; chosen
PORT = re.compile(rb"char device redirected to (/dev/\S+)")


class Running(NamedTuple):
    """A program that runs, with the pipes to the structure behind it."""

    child: "subprocess.Popen[bytes]"
    requests: int
    """Descriptor from which its requests come."""
    answers: int
    """Descriptor to which their answers go."""
    port: str
    """Path of the port that reaches it."""
    in_qemu: bool
    """An image for ARM: it writes no log of its output, and has no emergency stop."""


def is_for_arm(path: Path) -> bool:
    """Whether a file is a program for a 32-bit ARM processor; `ConfigurationError` if it cannot be read."""
    try:
        with path.open("rb") as file:
            head = file.read(20)
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read: {error.strerror}; `make -C firmware` builds firmware/build/host",
            field="firmware",
            value=str(path),
        ) from error
    return head[:4] == b"\x7fELF" and int.from_bytes(head[18:20], "little") == ARM_MACHINE


@contextmanager
def running(settings: EmulatorSettings) -> Iterator[Running]:
    """Run the firmware of the settings; it is killed when the context ends."""
    assert settings.firmware is not None
    path = settings.firmware.absolute()
    run = _image if is_for_arm(path) else _program
    with ExitStack() as held:
        yield run(path, settings, held)


def _program(path: Path, settings: EmulatorSettings, held: ExitStack) -> Running:
    """A program of this computer. Line and pipes are passed on as descriptors."""
    if settings.log_output is not None:
        check_log(settings.log_output)
    line, port = held.enter_context(pseudo_terminal(settings.link))
    with ExitStack() as theirs:
        requests, output = os.pipe()
        held.callback(os.close, requests)
        theirs.callback(os.close, output)
        input_, answers = os.pipe()
        theirs.callback(os.close, input_)
        held.callback(os.close, answers)
        command = [str(path), "--plant-in", str(input_), "--plant-out", str(output), "--line", str(line)]
        if settings.log_output is not None:
            command += ["--log-output", str(settings.log_output)]
        child = held.enter_context(_child(command, (input_, output, line)))
    return Running(child, requests, answers, port, in_qemu=False)


def _image(path: Path, settings: EmulatorSettings, held: ExitStack) -> Running:
    """An image for ARM in QEMU. Its line is a pseudo-terminal of QEMU's, its pipes are FIFOs."""
    import tty

    if settings.wire != "serial":
        raise ConfigurationError("allowed with an image for ARM is 'serial'", field="wire", value=settings.wire)
    if not settings.lockstep:
        raise ConfigurationError("lockstep = False: allowed with an image for ARM is True, for QEMU's time is not real")
    if shutil.which(QEMU) is None:
        raise ConfigurationError(
            f"is for ARM and runs in {QEMU}", field="firmware", value=str(path), hint="install that package"
        )
    folder = Path(held.enter_context(TemporaryDirectory(prefix="vibrolock-")))
    from_structure, to_structure = folder / "from-structure", folder / "to-structure"
    for fifo in (from_structure, to_structure):
        os.mkfifo(fifo)
    requests = os.open(to_structure, os.O_RDONLY | os.O_NONBLOCK)
    held.callback(os.close, requests)
    child = held.enter_context(_child(_qemu(path, from_structure, to_structure)))
    port = _port_of(child)
    far = os.open(port, os.O_RDWR | os.O_NOCTTY)  # kept open, for QEMU looks for somebody once a second only
    held.callback(os.close, far)
    tty.setraw(far)
    answers = _opened(from_structure, child)
    held.callback(os.close, answers)
    os.set_blocking(requests, True)
    return Running(child, requests, answers, held.enter_context(named(port, settings.link)), in_qemu=True)


def _qemu(image: Path, from_structure: Path, to_structure: Path) -> list[str]:
    board = image.stem if image.stem in BOARDS else BOARDS[0]
    arguments = ",".join(f"arg={one}" for one in (board, from_structure, to_structure))
    semihosting = f"enable=on,target=native,{arguments}"
    machine = [QEMU, "-M", board, "-nographic", "-serial", "pty", "-monitor", "none"]
    return [*machine, "-semihosting-config", semihosting, "-kernel", str(image)]


def _port_of(child: "subprocess.Popen[bytes]") -> str:
    """The pseudo-terminal that QEMU says it has made."""
    assert child.stdout is not None
    said, until_s = b"", time.monotonic() + STARTING_S
    while (found := PORT.search(said)) is None:
        _require_running(child, until_s, "names its port")
        if select.select((child.stdout,), (), (), POLL_S)[0]:
            said += os.read(child.stdout.fileno(), 4096)
    return found[1].decode("ascii")


def _opened(fifo: Path, child: "subprocess.Popen[bytes]") -> int:
    """A FIFO, open for writing once the image has opened it for reading."""
    until_s = time.monotonic() + STARTING_S
    while True:
        _require_running(child, until_s, "opens its structure")
        try:
            out = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # nobody reads yet
            time.sleep(POLL_S)
        else:
            os.set_blocking(out, True)
            return out


def _require_running(child: "subprocess.Popen[bytes]", until_s: float, what: str) -> None:
    if child.poll() is not None or time.monotonic() > until_s:
        child.kill()
        said = " ".join(child.communicate()[1].decode("utf-8", "replace").split())
        raise DaqRefused(f"firmware: {QEMU} ended, or was too slow, before it {what}: {said or 'it said nothing'}")


@contextmanager
def _child(command: list[str], passed: tuple[int, ...] = ()) -> "Iterator[subprocess.Popen[bytes]]":
    """A child in a session of its own: Ctrl-C at the terminal reaches this process alone, which ends the child."""
    try:
        child = subprocess.Popen(
            command,
            pass_fds=passed,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except OSError as error:
        raise ConfigurationError(f"cannot be run: {error.strerror}", field="firmware", value=command[0]) from error
    with child:
        try:
            yield child
        finally:
            child.kill()
