"""The firmware, built by its Makefile once for all workers of a run of the tests."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NoReturn

import pytest

from rig.errors import ConfigurationError
from rig.firmware.build import build_tick
from rig.firmware.targets import target_named
from tests.sharing import made_once, shared_folder

FOLDER = Path(__file__).parents[2] / "firmware"
ARM = ("make", "arm-none-eabi-gcc", "newlib")
NEEDS = {"mps2-an386": ARM, "nucleo-h743zi2": ARM, "nucleo-h743zi2-can": ARM}
"""Programs that a target needs; others need those of this computer."""
HOSTS = ("make", "cc")
LOOP_BOARDS = ("mps2-an500", "nucleo-h743zi2", "nucleo-h743zi2-can")
"""Targets with a Cortex-M7, which can run the loop."""
MAKING_S = 900.0


@cache
def _made(target: str) -> Path:
    folder = made_once(shared_folder() / "firmware" / target, lambda folder: _make(target, folder))
    (program,) = (path for path in (folder / target, folder / f"{target}.elf") if path.is_file())
    return program


def _make(target: str, folder: Path, *variables: str) -> None:
    done = subprocess.run(
        ["make", "-C", str(FOLDER), f"BUILD={folder}", *variables, target],
        capture_output=True,
        text=True,
        timeout=MAKING_S,
        check=False,
    )
    assert done.returncode == 0, f"make {target}:\n{done.stdout[-2000:]}{done.stderr[-4000:]}"


def built_tick(target: str) -> Path:
    """The folder with the compiled tick for a target of `rig firmware tick`, made once; skips or fails as `need` does."""
    if sys.platform != "linux" and target == "host":
        do_without("object files of this system are no ELF files")
    try:
        target_named(target).machine()
    except ConfigurationError as error:
        do_without(str(error))
    return made_once(shared_folder() / f"tick-{target}", lambda folder: build_tick(target, folder) and None)


def built_with_loop(target: str, room: int | None = None) -> Path:
    """The program of a target with the compiled tick linked in, built once; ``room``: bytes for the records of a run.

    ``host``, ``host-sanitized`` and ``script`` are for this computer, those of `LOOP_BOARDS` for a Cortex-M7. Skips or fails as
    `need` does, also where the tick cannot be compiled.
    """
    of_arm = target in LOOP_BOARDS
    need(*(NEEDS["mps2-an386"] if of_arm else HOSTS))
    tick = built_tick("cortex-m7" if of_arm else "host")
    name = f"{target}-with-loop" + (f"-{room}" if room else "")
    variables = [f"TICK={tick}"] + ([f"ROOM={room}"] if room else [])
    folder = made_once(shared_folder() / "firmware" / name, lambda folder: _make(target, folder, *variables))
    return folder / (f"{target}.elf" if of_arm else target)


@cache
def _is_there(name: str) -> bool:
    if name != "newlib":
        return shutil.which(name) is not None
    command = ["arm-none-eabi-gcc", "-print-file-name=nosys.specs"]  # the bare name where it has none
    return (
        _is_there(command[0]) and os.sep in subprocess.run(command, capture_output=True, text=True, check=True).stdout
    )


def need(*programs: str) -> None:
    """Skip the test where a program, or the C library ``newlib`` for ARM, is missing.

    With ``VIBROLOCK_FIRMWARE=required`` the test fails instead.
    """
    missing = [name for name in programs if not _is_there(name)]
    if missing:
        do_without(f"the firmware needs {' and '.join(missing)} to be built or run")


def do_without(why: str) -> NoReturn:
    """Skip the test for a reason, or fail it with ``VIBROLOCK_FIRMWARE=required``."""
    if os.environ.get("VIBROLOCK_FIRMWARE") == "required":
        pytest.fail(why)
    pytest.skip(why)


def built(target: str) -> Path:
    """The program of a target (``host``, ``host-sanitized``, ``script``, ``mps2-an386``), built once.

    Skips or fails as `need` does where a program that builds it is missing.
    """
    need(*NEEDS.get(target, HOSTS))
    return _made(target)
