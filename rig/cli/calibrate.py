"""``rig calibrate``: gain, polarity, delay, high-pass and crosstalk of a device's channels, by cables."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, keep_existing
from rig.cli.run_options import of_a_recording, on_a_terminal, shown, with_options

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions
    from rig.calibration.run import Calibrated

SECONDS, READING_S = 10.0, 30.0
"""How long is measured by default, s, and while a person reads a multimeter; chosen."""
LARGEST_V = 1000.0
"""Voltage that a reading must stay below, V."""
UNCERTAIN = 0.001
"""Relative uncertainty of amplitudes from which on it is told; chosen: a tenth of what a multimeter's reading brings."""


@with_options(of_a_recording, monitored=True)
def calibrate_(
    bench: Annotated[Path, typer.Argument(help="Bench: a TOML file.")],
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Bench to write: a TOML file beside BENCH.")],
    voltage: Annotated[
        float | None, typer.Option(help="RMS of the multisine, V; by default a tenth of what limits and ranges allow.")
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(help="How long to measure, s; by default 10, and 30 to read the multimeter.", min=4.0, max=600.0),
    ] = None,
    rms_v: Annotated[
        float | None,
        typer.Option(help="Reading of a true RMS multimeter on the output while it plays, V; asked for on a terminal."),
    ] = None,
    output_high_pass_hz: Annotated[
        float | None,
        typer.Option(
            "--output-high-pass",
            help="Corner of the output, Hz, roughly, where it is known: 0 if direct voltage passes. It says whose corner is "
            "whose where the inputs are alike.",
            min=0.0,
            max=100.0,
        ),
    ] = None,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Measure the channels of a device through cables from its output to its inputs, and write a bench that knows them.

    Take the cable off the amplifier and off the sensors first: a multisine is played for some seconds. A bench that this
    command has written is calibrated anew, from its base.
    """
    from rig.calibration.run import begun_from, bench_changes, calibrate, write_bench
    from rig.campaigns.multisine.points import MULTISINE_COLUMNS
    from rig.errors import ConfigurationError
    from rig.text.console import print_json

    for path in (bench, output):
        if path.suffix != ".toml":
            raise ConfigurationError("allowed is a .toml file", where=path)
    if output.absolute().parent != bench.absolute().parent:
        raise ConfigurationError(f"-o {output}: allowed is a file beside {bench}, from which it begins")
    if rms_v is not None and not 0.0 < rms_v < LARGEST_V:
        raise ConfigurationError(field="rms_v", value=rms_v, allowed=f"above 0 to {LARGEST_V:g} V")
    asks = rms_v is None and on_a_terminal()
    base, loaded = begun_from(bench)
    recording = output.with_suffix(".h5")
    for path in (output, recording):
        keep_existing([bench, base], path, options.overwrite)
    seconds = seconds or (READING_S if asks else SECONDS)
    if asks:
        print(f"read a true RMS multimeter on the output while it plays, for {seconds:g} s", file=sys.stderr)
    with shown(options, MULTISINE_COLUMNS) as watched:
        found = calibrate(
            loaded,
            recording,
            watched,
            rms_v=voltage,
            seconds=seconds,
            output_high_pass_hz=output_high_pass_hz,
        )
    if asks:
        rms_v = _reading()
    told = output_high_pass_hz is not None
    write_bench(output, base.name, bench_changes(found, loaded, rms_v))
    if json:
        print_json(_facts(found, output))
    else:
        _print(found, output, rms_v, told)


def _reading() -> float | None:
    """Ask for the multimeter's reading, V; None for an empty line. The output is at 0 V by then."""
    while True:
        print("reading of the multimeter, V RMS (Enter for none): ", end="", file=sys.stderr, flush=True)
        text = sys.stdin.readline().strip()
        if not text:
            return None
        try:
            if 0.0 < float(text) < LARGEST_V:
                return float(text)
        except ValueError:
            pass
        print(f"allowed is a number above 0 to {LARGEST_V:g}, such as 0.1372", file=sys.stderr)


def _facts(found: "Calibrated", output: Path) -> dict[str, object]:
    return {
        "bench": str(output),
        "recording": str(found.recording),
        "rms_v": found.rms_v,
        "passed_rms_v": found.passed_rms_v,
        "latency_from": found.latency_from,
        "output_high_pass_hz": found.paths.output_high_pass_hz,
        "inputs": [dict(vars(one)) for one in found.paths.inputs],
    }


def _print(found: "Calibrated", output: Path, rms_v: float | None, told: bool) -> None:
    import math

    print(f"output: {found.rms_v:.4g} V RMS, high-pass {found.paths.output_high_pass_hz:.3g} Hz")
    reference = found.reference
    for one in found.paths.inputs:
        if one.connected:
            polarity = ", polarity reversed" if one.gain < 0.0 else ""
            print(
                f"{one.name}: gain {abs(one.gain):.5g}{polarity}, "
                f"delay {one.delay_samples - reference.delay_samples:+.3f} samples, "
                f"high-pass {one.high_pass_hz:.3g} Hz, phase within {one.misfit_deg:.2f} deg of the model"
            )
        else:
            print(f"{one.name}: no cable; crosstalk {20.0 * math.log10(max(one.gain, 1e-12)):.0f} dB")
    if found.uncertain_gain > UNCERTAIN and not told:
        print(
            "the inputs are alike, so it is not known which corner is the output's: amplitudes at "
            f"{found.bench.specimen.linear_frequency_hz:g} Hz may be {100.0 * found.uncertain_gain:.1f} % wrong; phases are "
            "right (--output-high-pass)"
        )
    if rms_v is None:
        print(
            "volts are those of the bench: measure the output with a true RMS multimeter while it plays, and give --rms-v"
        )
    if found.latency_from:
        print(f"latency from: {found.latency_from}")
    print(f"written: {output}; recorded in {found.recording}")
