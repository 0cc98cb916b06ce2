"""``rig calibrate``: gain, polarity, delay, high-pass and crosstalk of a device's channels, by cables."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, keep_existing
from rig.cli.run_options import of_a_recording, shown, with_options

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions
    from rig.calibration.run import Calibrated


@with_options(of_a_recording, monitored=True)
def calibrate_(
    bench: Annotated[Path, typer.Argument(help="Bench: a TOML file.")],
    *,
    output: Annotated[Path, typer.Option("-o", "--output", help="Bench to write: a TOML file beside BENCH.")],
    voltage: Annotated[
        float | None, typer.Option(help="RMS of the multisine, V; by default a tenth of what limits and ranges allow.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long to measure, s.", min=4.0, max=600.0)] = 10.0,
    rms_v: Annotated[
        float | None, typer.Option(help="Reading of a true RMS multimeter on the output while it plays, V.")
    ] = None,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Measure the channels of a device through cables from its output to its inputs, and write a bench that knows them.

    Take the cable off the amplifier and off the sensors first: a multisine is played for some seconds.
    """
    from rig.bench import load_bench
    from rig.calibration.run import bench_changes, calibrate, write_bench
    from rig.campaigns.multisine.points import MULTISINE_COLUMNS
    from rig.errors import ConfigurationError
    from rig.text.console import print_json

    loaded = load_bench(bench)
    for path in (bench, output):
        if path.suffix != ".toml":
            raise ConfigurationError("allowed is a .toml file", where=path)
    if output.absolute().parent != bench.absolute().parent:
        raise ConfigurationError(f"-o {output}: allowed is a file beside {bench}, from which it begins")
    if rms_v is not None and not 0.0 < rms_v < 1000.0:
        raise ConfigurationError(field="rms_v", value=rms_v, allowed="above 0 to 1000 V")
    recording = output.with_suffix(".h5")
    for path in (output, recording):
        keep_existing([bench], path, options.overwrite)
    with shown(options, MULTISINE_COLUMNS) as watched:
        found = calibrate(loaded, recording, watched, rms_v=voltage, seconds=seconds)
    write_bench(output, bench.name, bench_changes(found, loaded, rms_v))
    if json:
        print_json(_facts(found, output))
    else:
        _print(found, output, rms_v)


def _facts(found: "Calibrated", output: Path) -> dict[str, object]:
    return {
        "bench": str(output),
        "recording": str(found.recording),
        "rms_v": found.rms_v,
        "latency_from": found.latency_from,
        "output_high_pass_hz": found.paths.output_high_pass_hz,
        "inputs": [dict(vars(one)) for one in found.paths.inputs],
    }


def _print(found: "Calibrated", output: Path, rms_v: float | None) -> None:
    import math

    print(f"output: {found.rms_v:.4g} V RMS, high-pass {found.paths.output_high_pass_hz:.3g} Hz")
    for one in found.paths.inputs:
        if one.connected:
            polarity = ", polarity reversed" if one.gain < 0.0 else ""
            print(
                f"{one.name}: gain {abs(one.gain):.5g}{polarity}, delay {one.delay_samples:+.3f} samples, "
                f"high-pass {one.high_pass_hz:.3g} Hz, phase within {one.misfit_deg:.2f} deg of the model"
            )
        else:
            print(f"{one.name}: no cable; crosstalk {20.0 * math.log10(max(one.gain, 1e-12)):.0f} dB")
    if rms_v is None:
        print(
            "volts are those of the bench: measure the output with a true RMS multimeter while it plays, and give --rms-v"
        )
    if found.latency_from:
        print(f"latency from: {found.latency_from}")
    print(f"written: {output}; recorded in {found.recording}")
