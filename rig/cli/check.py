"""``rig check``: the health check of a bench before a test."""

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, keep_existing
from rig.cli.run_options import by_the_clock, of_a_recording, shown, with_options

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions


@with_options(of_a_recording, monitored=True)
def check_(
    *,
    bench: Annotated[str, typer.Option(help="Shipped bench or TOML file.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Recording to write; named by bench and time if left out.")
    ] = None,
    reference: Annotated[Path | None, typer.Option(help="Recording of an earlier check to compare with.")] = None,
    level_rms_v: Annotated[
        float | None,
        typer.Option("--level", metavar="V", help="RMS voltage of the multisine; found automatically if left out."),
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .png, .pdf, .svg or .html.")] = None,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Check noise, dead, reversed and swapped channels, gains and latency, with a low-level multisine; 1 if anything fails."""
    from rig.bench import load_bench
    from rig.campaigns.multisine.points import MULTISINE_COLUMNS
    from rig.check.figure import write_check
    from rig.check.report import print_summary, summary
    from rig.check.run import check, expected_duration_s
    from rig.errors import ConfigurationError
    from rig.show.waiting import Waiting
    from rig.text.console import print_json
    from rig.text.durations import duration
    from rig.tuning.figure import check_figure

    loaded = load_bench(bench)
    path = Path(f"check-{Path(bench).stem}-{datetime.now():%Y%m%d-%H%M%S}.h5") if output is None else output
    if path.suffix != ".h5":
        raise ConfigurationError(f"-o {path}: recordings are written as .h5")
    keep_existing([] if reference is None else [reference], path, options.overwrite)
    if figure is not None:
        check_figure(figure, options.overwrite)
    least_s, most_s = expected_duration_s(loaded, level_rms_v)
    usual = f"{duration(least_s)}" + (f", up to {duration(most_s)} if the level must rise" if most_s > least_s else "")
    what = f"checking {loaded.name}: silence, then a low-level multisine"
    with Waiting(what, usual if by_the_clock(loaded, options) else ""), shown(options, MULTISINE_COLUMNS) as watched:
        found = check(loaded, path, watched, named=bench, reference=reference, level_rms_v=level_rms_v)
    if figure is not None:
        write_check(found, figure)
    facts = summary(found)
    if json:
        print_json(facts.model_dump())
    else:
        print_summary(facts)
        print(f"recorded in {path}" + (f", figure in {figure}" if figure else ""))
    if found.failed:
        raise typer.Exit(1)
