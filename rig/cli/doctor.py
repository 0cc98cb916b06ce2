"""``rig doctor``: what this machine and a bench's device can promise, and which settings hold."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import Json

__all__ = ["doctor"]

UNITS = {"block": "samples", "queue_blocks": "blocks", "watchdog_s": "s", "largest_rate_hz": "Hz"}


def doctor(
    daq: Annotated[
        str | None, typer.Option(help="Bench whose device to look at: a name or TOML file. It is given 0 V only.")
    ] = None,
    json: Json = False,
) -> None:
    """What this machine can promise: clock, privileges, disk, drivers; with --daq, what a bench's device answers.

    With --daq it also recommends block, queue, watchdog and the largest sample rate, and says whether they held when tried.
    """
    from rig.bench import load_bench
    from rig.loop.doctor import examine, examine_bench
    from rig.text.console import print_json
    from rig.text.printable import printable_strings

    facts = examine(Path.cwd()) if daq is None else examine_bench(load_bench(daq))
    if json:
        print_json(facts)
    else:
        advice = facts.pop("recommendation", None)
        for name, value in printable_strings(facts).items():
            _print(name, value)
        if advice is not None:
            _print_advice(printable_strings(advice))
    if facts.get("failure"):
        raise typer.Exit(1)


def _print(name: str, value: Any) -> None:
    text = ", ".join(f"{k} {v}" for k, v in value.items()) if isinstance(value, dict) else value
    text = "; ".join(value) or "none" if isinstance(value, list) else text
    print(f"{name.replace('_', ' '):22} {text}")


def _print_advice(advice: Mapping[str, Any]) -> None:
    """Print the recommended settings, each with its reason, what was tried, and lines for the bench file."""
    print("\nrecommended")
    settings, reasons = advice["settings"], advice["reasons"]
    for name in (*settings, *(name for name in reasons if name not in settings)):
        value = f"{settings[name]:g} {UNITS[name]}" if name in settings else "as it is"
        print(f"  {name.replace('_', ' '):20} {value:14} {reasons.get(name, '')}")
    if "delay_s" in advice:
        print(f"  {'delay of the loop':20} {1e3 * advice['delay_s']:.3g} ms")
    for told in advice["tried"]:
        print(f"  {'tried, at 0 V':20} {_tried(told)}")
    if advice.get("bench_lines"):
        print("\nfor the bench file\n" + "\n".join(f"  {line}".rstrip() for line in advice["bench_lines"]))


def _tried(told: Mapping[str, Any]) -> str:
    """Return one line on settings that were tried."""
    names = ("block", "queue_blocks", "watchdog_s", "sample_rate_hz")
    what = ", ".join(f"{name} {told[name]:g}" for name in names if name in told)
    if told.get("latched") or told.get("failure"):
        return f"{what}: {told.get('latched') or told['failure']}"
    return (
        f"{what}: {told['held_blocks']} of {told['blocks']} blocks held, {told['lost_blocks']} lost, "
        f"{told['reached_hz']:g} Hz reached"
    )
