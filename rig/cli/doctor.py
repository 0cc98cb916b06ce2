"""``rig doctor``: what this machine and a bench's device can promise, which settings hold, and all ways to run side by side."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json
from rig.system.studies import load_study

if TYPE_CHECKING:
    from rig.loop.doctor import MachineReport
    from rig.loop.worker.probe import Advice, DeviceReport, Tried

UNITS = {"block": "samples", "queue_blocks": "blocks", "watchdog_s": "s", "largest_rate_hz": "Hz"}


def doctor(
    others: Annotated[
        list[Path] | None,
        typer.Argument(help="With --matrix: files of rows that others have measured, to be shown too."),
    ] = None,
    daq: Annotated[
        str | None, typer.Option(help="Bench whose device to look at: a name or TOML file. It is given 0 V only.")
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(help="With --daq: for how long to measure before settings are recommended.", min=0.5, max=600),
    ] = 1.5,
    matrix: Annotated[
        bool, typer.Option("--matrix", help="Measure every way to run without a rig, side by side; half a minute.")
    ] = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="With --matrix: also run the conformance suite over each; two minutes.")
    ] = False,
    firmware: Annotated[
        list[Path] | None,
        typer.Option(help="With --matrix: firmware to measure as well, built for this machine or for ARM (QEMU)."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File for the rows that were measured: TOML or JSON.")
    ] = None,
    json: Json = False,
) -> None:
    """What this machine can promise: clock, privileges, disk, drivers; with --daq, what a bench's device answers.

    With --daq it also recommends block, queue, watchdog and the largest sample rate, and says whether they held when tried.
    """
    from rig.bench import load_bench
    from rig.loop.doctor import examine, examine_bench

    _check_options(daq, matrix, [*(others or ()), *(firmware or ()), *([Path("--verify")] if verify else ())], output)
    bench = None if daq is None else load_bench(daq)
    device = None if bench is None else (bench, examine_bench(bench, seconds=seconds))
    if matrix:
        load_study("matrix", "--matrix").compare(device, others or [], firmware or [], verify, output, json)
        return
    if device is not None and output is not None:
        load_study("matrix", "-o").write_device(device, output)
    _show(device[1] if device else examine(Path.cwd()), json)


def _check_options(daq: str | None, matrix: bool, of_the_matrix: list[Path], output: Path | None) -> None:
    from rig.errors import ConfigurationError

    if of_the_matrix and not matrix:
        raise ConfigurationError("allowed with --matrix alone", where=of_the_matrix[0])
    if output is not None and not (matrix or daq is not None):
        raise ConfigurationError(f"-o {output}: allowed with --matrix or --daq")
    if output is not None and output.suffix not in (".toml", ".json"):
        raise ConfigurationError(f"-o {output}: allowed is a file .toml or .json")
    if output is not None and output.exists():
        load_study("matrix", "-o").read_rows(output)  # only rows of a matrix are replaced


def _show(facts: "MachineReport | DeviceReport", json: bool) -> None:
    from rig.text.console import print_json
    from vibrolock.printable import printable_strings

    if json:
        print_json(facts)
    else:
        advice = facts.get("recommendation")
        for name, value in printable_strings({**facts}).items():
            if name == "recommendation":
                continue
            text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
            text = "; ".join(value) or "none" if isinstance(value, list) else text
            print(f"{name.replace('_', ' '):22} {text}")
        if advice is not None:
            _print_advice(printable_strings(advice))
    if facts.get("failure"):
        raise typer.Exit(1)


def _print_advice(advice: "Advice") -> None:
    print("\nrecommended")
    settings: Mapping[str, object] = advice["settings"]
    reasons = advice["reasons"]
    for name in (*settings, *(name for name in reasons if name not in settings)):
        value = f"{settings[name]:g} {UNITS[name]}" if name in settings else "as it is"
        print(f"  {name.replace('_', ' '):20} {value:14} {reasons.get(name, '')}")
    if "delay_s" in advice:
        print(f"  {'delay of the loop':20} {1e3 * advice['delay_s']:.3g} ms")
    for told in advice["tried"]:
        print(f"  {'tried, at 0 V':20} {_tried(told)}")
    if advice.get("bench_lines"):
        print("\nfor the bench file\n" + "\n".join(f"  {line}".rstrip() for line in advice["bench_lines"]))


def _tried(told: "Tried") -> str:
    names = ("block", "queue_blocks", "watchdog_s", "sample_rate_hz")
    given: Mapping[str, object] = told
    what = ", ".join(f"{name} {given[name]:g}" for name in names if name in given)
    if told.get("latched") or told.get("failure"):
        return f"{what}: {told.get('latched') or told['failure']}"
    return (
        f"{what}: {told['held_blocks']} of {told['blocks']} blocks held, {told['lost_blocks']} lost, "
        f"{told['reached_hz']:g} Hz reached"
    )
