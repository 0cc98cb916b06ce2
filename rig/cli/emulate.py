"""``rig emulate``: a virtual rig behind the wire protocol of a real device, as a sound card, or behind NI devices."""

import json as jsonlib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json
from rig.wire.can.frames import DATA_BIT_RATE_HZ

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.emulator.process import Ready

WRITTEN = "# Written by `rig emulate`, which replaces this file."
SHORTEST_BLOCK_S = 0.002
"""Shortest block of the written bench, s. A host with ordinary scheduling keeps up with it."""


def emulate(
    context: typer.Context,
    wire: Annotated[str, typer.Argument(help="serial, can, sound or nidaqmx.")],
    bench: Annotated[str, typer.Option(help="Virtual bench to put behind it: a name or TOML file.")] = "magnet-beam",
    lockstep: Annotated[bool, typer.Option("--lockstep", help="Wait for the host instead of keeping time.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the rig's noise.", min=0)] = 0,
    link: Annotated[Path | None, typer.Option(help="Symbolic link to the port, a name that stays.")] = None,
    bench_file: Annotated[Path | None, typer.Option(help="Bench to write that reaches it: a TOML file.")] = None,
    as_hardware: Annotated[
        bool, typer.Option("--as-hardware", help="Like a device that moves something: it must be armed.")
    ] = False,
    flip: Annotated[list[str] | None, typer.Option(help="Channel whose sensor sits the wrong way round.")] = None,
    dead: Annotated[list[str] | None, typer.Option(help="Channel that is connected to nothing.")] = None,
    swap: Annotated[list[str] | None, typer.Option(metavar="A,B", help="Two channels in each other's sockets.")] = None,
    high_pass_hz: Annotated[
        list[float] | None,
        typer.Option(
            "--high-pass",
            help="Sound: corner of the high-passes of output and inputs, Hz; given several times, of the output and each "
            "input. None by default: then the written bench needs no calibration.",
        ),
    ] = None,
    cables: Annotated[
        bool, typer.Option("--cables", help="Sound: a cable from the output to every input, as `rig calibrate` needs.")
    ] = False,
    interface: Annotated[str | None, typer.Option(help="CAN: python-can's; slcan over a port if left out.")] = None,
    channel: Annotated[str | None, typer.Option(help="CAN: channel of that interface.")] = None,
    fd: Annotated[bool, typer.Option("--fd/--classic", help="CAN: frames of up to 64 or 8 bytes.")] = True,
    node: Annotated[int, typer.Option(help="CAN: number of the device on its bus.", min=0, max=15)] = 1,
    bitrate: Annotated[int, typer.Option(help="CAN: bit/s.")] = 1_000_000,
    data_bitrate: Annotated[int, typer.Option(help="CAN FD: bit/s within the data.")] = DATA_BIT_RATE_HZ,
    log_output: Annotated[Path | None, typer.Option(help="File for the device's output, a line a block.")] = None,
    firmware: Annotated[
        Path | None, typer.Option(help="Firmware to run as the device: its program, or its image for ARM.")
    ] = None,
    json: Json = False,
) -> None:
    """Put a virtual rig behind a wire, into a sound card, or behind NI devices, at the pace of the clock, until Ctrl-C."""
    from rig.bench import load_bench
    from rig.bench.configuration import validated
    from rig.emulator.process import run_emulator
    from rig.emulator.settings import EmulatorSettings

    behind = load_bench(bench)
    given = {name: value for name, value in context.params.items() if name in EmulatorSettings.model_fields}
    changed = {"bench": behind.model_dump(), "swap": [_pair(text) for text in swap or []]}
    table = {name: value for name, value in (given | changed).items() if value is not None}
    settings = validated(EmulatorSettings, table, "rig emulate")
    _check_bench_file(bench_file)

    def when_ready(ready: "Ready") -> None:
        if wire in ("sound", "nidaqmx"):
            block, text = _own_bench(behind, bench, ready)
        else:
            block = _block(behind, ready)
            text = _bench_text(bench, block, ready, as_hardware)
        if bench_file is not None:
            _write_bench(bench_file, text)
        if json:
            facts = {"wire": wire, **ready.options, "block": block, "process": ready.process}
            print(jsonlib.dumps(facts), flush=True)
        else:
            where = ", ".join(f"{key} {value}" for key, value in {**ready.options, "block": block}.items())
            print(f"{bench} behind {wire}: {where} ({ready.scheduling}); Ctrl-C ends it", flush=True)

    counted = run_emulator(settings, when_ready)
    if json:
        print(jsonlib.dumps(counted), flush=True)
    else:
        counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counted.items())
        print(f"ended: {counts or 'nothing went wrong'}")


def _own_bench(behind: "Bench", name: str, ready: "Ready") -> tuple[int, str]:
    """Return the block and the text of a bench file that reaches a device with a rate and channels of its own."""
    import tomli_w

    from rig.emulator.emulated import driver_options, reaching

    options = driver_options(ready.options, lockstep=ready.lockstep)
    reached = reaching(behind, ready.wire, options | {"queue_blocks": "auto"})
    table = {
        "base": _base(name),
        "sample_rate_hz": reached.sample_rate_hz,
        "block": reached.block,
        "driver": reached.driver.model_dump(),
        "arming": reached.arming.model_dump(exclude_unset=True),
        "channels": [channel.model_dump(exclude_unset=True) for channel in reached.channels],
    }
    return reached.block, f"{WRITTEN}\n{tomli_w.dumps(table)}"


def _base(bench: str) -> str:
    """Return what a bench file begins from: a shipped bench, or a file by its whole path."""
    return str(Path(bench).absolute()) if bench.endswith(".toml") else bench


def _pair(text: str) -> list[str]:
    from rig.errors import ConfigurationError

    names = text.split(",")
    if len(names) != 2:
        raise ConfigurationError(f"--swap {text}: allowed is two channels with a comma between them")
    return names


def _write_bench(path: Path, text: str) -> None:
    from rig.errors import ConfigurationError

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"--bench-file {path}: cannot be written: {error.strerror}") from error


def _check_bench_file(path: Path | None) -> None:
    from rig.errors import ConfigurationError

    if path is None:
        return
    if path.suffix != ".toml" or not path.parent.is_dir():
        raise ConfigurationError(f"--bench-file {path}: allowed is a .toml file in a folder that exists")
    try:
        with path.open("rb") as stream:
            start = stream.read(len(WRITTEN))
    except FileNotFoundError:
        return
    except OSError as error:
        raise ConfigurationError(f"--bench-file {path}: cannot be written: {error.strerror}") from error
    if start not in (b"", WRITTEN.encode()):
        raise ConfigurationError(
            f"--bench-file {path}: exists already and was not written by `rig emulate`; choose another name"
        )


def _block(bench: "Bench", ready: "Ready") -> int:
    """Return the samples per block: those of the bench in lockstep, else at least 2 ms if the wire's frames can hold it."""
    if ready.lockstep:
        return bench.block
    wanted = math.ceil(round(SHORTEST_BLOCK_S * bench.sample_rate_hz, 6))
    return max(bench.block, min(wanted, ready.largest_block))


def _bench_text(bench: str, block: int, ready: "Ready", as_hardware: bool) -> str:
    from rig.emulator.emulated import driver_options

    options = driver_options(ready.options, lockstep=ready.lockstep, as_hardware=as_hardware) | {"queue_blocks": "auto"}
    lines = "".join(f"{key} = {jsonlib.dumps(value)}\n" for key, value in options.items())
    return (
        f"{WRITTEN}\nbase = {jsonlib.dumps(_base(bench))}\nblock = {block}\n\n"
        f"[driver]\nname = {jsonlib.dumps(ready.wire)}\n\n[driver.options]\n{lines}"
    )
