"""The compiled tick as a program: of this computer, or as an image for a Cortex-M in QEMU. It runs captured samples."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.firmware.signature import example
from rig.tick.layout import TickArrays

HERE = Path(__file__).parent
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wno-sign-conversion", "-Werror")
BOARDS = {"cortex-m7": "mps2-an500", "cortex-m33": "mps2-an505"}
"""QEMU's boards."""
FLOATS = {"cortex-m7": "fpv5-d16", "cortex-m33": "fpv5-sp-d16"}
FUNCTIONS = ("sin", "cos", "exp", "log", "pow", "atan2")
"""Functions of libm that the program evaluates: of x; x to the power of 1.7, and the angle of (0.7, x)."""
TICKING, EVALUATING, ENDING = 1, 2, 0
INSTRUCTIONS = 40
"""Instructions in a count of the program's clock."""


class Samples(NamedTuple):
    """What a tick was given: its arrays before, and for every sample volts, flags and what was put out instead."""

    before: TickArrays
    volts: np.ndarray
    flags: np.ndarray
    put_out: np.ndarray


class Ticked(NamedTuple):
    """What a tick came to: arrays after, readings, rows and outputs.

    Instructions a block stand at the block's first sample; the stack is in bytes; the digest is the one that the object tells.
    """

    after: TickArrays
    readings: np.ndarray
    rows: np.ndarray
    outputs: np.ndarray
    instructions: np.ndarray
    stack: int
    digest: str


def program(target: str, built: Path, folder: Path, *, one_libm: bool = False) -> Path:
    """Link the program of a target, ``host`` or one of `BOARDS`, into a folder; return its path.

    ``built`` is the folder that `rig firmware tick` has filled.

    With ``one_libm`` the host's program notes what its libm returns, in ``libm.bin``, and an image takes its values from there.
    """
    out = folder / f"check-{target}"
    wrapped = [HERE / "libm.c", *(f"-Wl,--wrap={name}" for name in (*FUNCTIONS, "sincos"))] if one_libm else []
    sources = [HERE / "check.c", *wrapped, built / f"tick-{target}.o", f"-I{built}", f"-I{HERE}", "-o", out, "-lm"]
    if target not in BOARDS:
        command = ["cc", *FLAGS, *sources]
    else:
        processor = [f"-mcpu={target}", "-mthumb", f"-mfpu={FLOATS[target]}", "-mfloat-abi=hard"]
        board = ["-nostartfiles", "--specs=rdimon.specs", f"-L{HERE}", f"-T{HERE}/{BOARDS[target]}.ld"]
        command = [
            "arm-none-eabi-gcc",
            *FLAGS,
            *processor,
            HERE / "start.c",
            *sources,
            *board,
            "-Wl,--no-warn-execstack",
        ]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return out


def command_for(path: Path, *options: str) -> list[str]:
    """Return the command that runs a program, in QEMU where it is an image."""
    board = BOARDS.get(path.name.removeprefix("check-"))
    if board is None:
        return [str(path)]
    quiet = ["-nographic", "-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"]
    return ["qemu-system-arm", "-M", board, *quiet, "-icount", "shift=0", *options, "-kernel", str(path)]


def write_requests(folder: Path, requests: bytes) -> None:
    """Write what a program that runs in a folder is asked."""
    (folder / "in.bin").write_bytes(requests + np.int64(ENDING).tobytes())


def answer(path: Path, folder: Path, requests: bytes) -> bytes:
    """Run a program once on requests; return its answers."""
    write_requests(folder, requests)
    subprocess.run(command_for(path), check=True, cwd=folder, capture_output=True, timeout=600)
    return (folder / "out.bin").read_bytes()


def evaluated(path: Path, folder: Path, function: str, values: np.ndarray) -> np.ndarray:
    """Return a function of `FUNCTIONS` at float64[n] values, by the program's libm."""
    head = np.array([EVALUATING, FUNCTIONS.index(function), values.size], np.int64)
    return np.frombuffer(answer(path, folder, head.tobytes() + values.tobytes()))


def ticked(path: Path, folder: Path, all_samples: Sequence[Samples], block: int = 1) -> list[Ticked]:
    """Run the tick of a program over captured samples, in one run of the program."""
    raw = answer(path, folder, requests_for(all_samples, block))
    out = []
    for one in all_samples:
        done, raw = _answered(one, raw)
        out.append(done)
    return out


def first(samples: Samples, n: int) -> Samples:
    """Return the first n samples."""
    return Samples(samples.before, samples.volts[:n], samples.flags[:n], samples.put_out[:n])


def requests_for(all_samples: Sequence[Samples], block: int = 1) -> bytes:
    """Return what a program is asked, to run the tick over samples in blocks."""
    return b"".join(_request(one, block) for one in all_samples)


def _request(samples: Samples, block: int) -> bytes:
    n, channels = samples.volts.shape
    parts = [np.array([TICKING, n, channels, block], np.int64)]
    for name, array in samples.before._asdict().items():
        if name != "waveforms":
            parts += [np.array([array.size]), array]
    waveforms = samples.before.waveforms
    parts += [np.array(waveforms.shape), waveforms, samples.volts, samples.flags, samples.put_out]
    return b"".join(part.tobytes() for part in parts)


def _answered(samples: Samples, raw: bytes) -> tuple[Ticked, bytes]:
    n, channels = samples.volts.shape
    at = 72

    def take(dtype: np.dtype, *shape: int) -> np.ndarray:
        nonlocal at
        array = np.frombuffer(raw, dtype, int(np.prod(shape)), at).reshape(shape)
        at += array.nbytes
        return array

    like = samples.before._asdict()
    after = {name: take(array.dtype, *array.shape) for name, array in like.items() if name != "waveforms"}
    types = {name: array.dtype for name, array in example().by_name().items()}
    rest = [take(types["readings"], n, channels), take(types["rows"], n), take(types["outputs"], n)]
    counts = take(np.dtype(np.uint32), n) & 0xFFFFFF
    whole = TickArrays(**after, waveforms=samples.before.waveforms)
    digest, stack = raw[:64].decode(), int.from_bytes(raw[64:72], "little")
    return Ticked(whole, *rest, counts * INSTRUCTIONS, stack, digest), raw[at:]
