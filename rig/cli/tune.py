"""``rig tune``: from a bench to a plan with designed gains."""

import os
import sys
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, keep_existing
from rig.cli.run_options import by_the_clock, of_a_recording, shown, with_options

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions
    from rig.rehearsal.rehearsal import RehearsalRequest
    from rig.rehearsal.report import Summary
    from rig.tuning.tuning import Tuning


@with_options(of_a_recording, monitored=True)
def tune_(
    *,
    bench: Annotated[str, typer.Option(help="Shipped bench or TOML file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Plan to write: a TOML file.")],
    level_rms_v: Annotated[
        float | None,
        typer.Option("--level", metavar="V", help="RMS voltage of the multisine; found automatically if left out."),
    ] = None,
    law: Annotated[
        str, typer.Option(help="frequency-error (levels in metres) or phase (levels in volts).")
    ] = "frequency-error",
    from_m: Annotated[float | None, typer.Option(help="Lowest level, m; from the noise if left out.")] = None,
    to_m: Annotated[float | None, typer.Option(help="Highest level, m; from the limits if left out.")] = None,
    points: Annotated[int, typer.Option(help="Number of levels.", min=1, max=1000)] = 8,
    harmonics: Annotated[
        int | None,
        typer.Option(metavar="H", help="Highest harmonic of the force that the plan controls; none if left out."),
    ] = None,
    recording: Annotated[
        Path | None, typer.Option(help="Recording of the multisine; beside the plan if left out.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .png, .pdf, .svg or .html.")] = None,
    trial: Annotated[
        bool | None,
        typer.Option(
            "--trial/--no-trial",
            help="Carry the plan out once, and keep the levels that are held; by default on virtual rigs only.",
            show_default=False,
        ),
    ] = None,
    rehearse: Annotated[
        int,
        typer.Option(
            metavar="N",
            help="Twins on which the plan is rehearsed, fewer once the verdict is certain; 0: none.",
            min=0,
            max=100_000,
        ),
    ] = 40,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Measure a rig with a low-level multisine, design gains and levels, try them once, write the plan, and rehearse it."""
    from rig.bench import load_bench
    from rig.campaigns.multisine.points import MULTISINE_COLUMNS
    from rig.errors import ConfigurationError
    from rig.rehearsal.loading import load
    from rig.rehearsal.report import verdict_in_one_line
    from rig.show.waiting import Waiting
    from rig.text.console import print_json
    from rig.tuning.figure import check_figure, draw_tuning
    from rig.tuning.linear_test import expected_duration
    from rig.tuning.report import lines, summary
    from rig.tuning.trials import trial_recordings
    from rig.tuning.tuning import TuningRequest, tune
    from vibrolock.in_workers import meanwhile
    from vibrolock.printable import printable

    loaded = load_bench(bench)
    trial = loaded.driver.name == "virtual" if trial is None else trial
    request = TuningRequest(
        level_rms_v=level_rms_v, law=law, from_m=from_m, to_m=to_m, points=points, harmonics=harmonics
    )
    if output.suffix != ".toml":
        raise ConfigurationError(f"-o {output}: plans are written as .toml")
    keep_existing([], output, options.overwrite)
    recorded = output.with_suffix(".h5") if recording is None else recording
    if recorded.suffix != ".h5":
        raise ConfigurationError(f"--recording {recorded}: recordings are written as .h5")
    tried, rehearsed = (output.with_name(f"{output.stem}-{what}.h5") for what in ("trial", "rehearsal"))
    for path in [*(trial_recordings(tried) if trial else []), *([rehearsed] if rehearse > 0 else [])]:
        _check_result(path, recorded, options.overwrite)
    if figure is not None:
        check_figure(figure, options.overwrite)
    then = f"{', then a trial of the plan' if trial else ''}{', then a rehearsal' if rehearse else ''}"
    clock = by_the_clock(loaded, options)
    usual = expected_duration(loaded, by_the_clock=clock)
    with (
        Waiting(f"tuning {loaded.name}: a low-level multisine, then the gains{then}", usual, announced=True),
        shown(options, MULTISINE_COLUMNS) as watched,
    ):
        found = tune(bench, recorded, request, watched, named=_as_seen_from(bench, output))
    with meanwhile(load, 1 if clock or not rehearse else -1):  # by the clock all cores are the loop's
        if trial:
            found = _tried(found, output, tried, options, clock)
        _write(found, output)
        if figure is not None:
            draw_tuning(found, figure)
        twins = _twins(found, rehearse) if rehearse else None
    facts = {**summary(found), "plan": str(output), "figure": None if figure is None else str(figure)}
    foreseen = None if twins is None else _rehearsal(twins, found, output, rehearsed)
    facts["rehearsal"] = None if foreseen is None else foreseen.model_dump(by_alias=True)
    if json:
        print_json(facts)
        return
    for line in lines(found):
        print(printable(line))
    if foreseen is not None:
        print(f"rehearsal      {verdict_in_one_line(foreseen)}; `rig show {rehearsed}` has the page")
    trials = ", ".join(str(one.recording) for one in found.trials)
    files = {"multisine recorded in": recorded, "trial in": trials, "figure in": figure}
    parts = [f"{what} {file}" for what, file in files.items() if file]
    print(f"plan written to {output}, {', '.join(parts)}")


def _write(found: "Tuning", plan: Path, *head: str) -> None:
    from rig.system.whole_file import whole_file

    with whole_file(plan) as part:
        part.write_text("\n".join([*head, found.plan_toml]), encoding="utf-8")


def _check_result(path: Path, recorded: Path, overwrite: bool) -> None:
    """Refuse a result that is the recording of the multisine, or that exists."""
    from rig.errors import ConfigurationError

    if path.absolute() == recorded.absolute():
        raise ConfigurationError(
            f"--recording {recorded}: {path.name} is another result of this command, choose another name"
        )
    keep_existing([], path, overwrite)


def _tried(found: "Tuning", plan: Path, recording: Path, options: "RunOptions", by_the_clock: bool) -> "Tuning":
    """Try the plan; where the trial does not come to its end, write it untried."""
    from rig.campaigns.backbone.points import BACKBONE_COLUMNS
    from rig.campaigns.running.dry_run import expected_duration
    from rig.errors import RigError
    from rig.show.waiting import Waiting
    from rig.tuning.plant import TuningError
    from rig.tuning.trials import try_plan

    usual = expected_duration(found.plan, found.bench, by_the_clock=by_the_clock)
    with (
        Waiting("a trial of the plan, up to its highest level", usual, announced=by_the_clock),
        shown(options, BACKBONE_COLUMNS) as watched,
    ):
        try:
            return try_plan(found, recording, watched)
        except (RigError, OSError, KeyboardInterrupt, SystemExit) as error:
            if type(error) is not TuningError:  # which says that no plan suits
                _write(found, plan)
                print(f"the plan was written to {plan}; its trial is not complete", file=sys.stderr)
            raise


def _twins(found: "Tuning", draws: int) -> "RehearsalRequest":
    from rig.results.rehearsal.rehearse import Subject, request_for
    from rig.show.waiting import Waiting

    sources = [found.recording, *([] if found.trial is None else [found.trial.recording])]
    subject = Subject(plan=found.plan, bench=found.bench, sources=sources, draws=draws)
    with Waiting("learning what is known of the rig"):
        return request_for(subject)


def _rehearsal(request: "RehearsalRequest", found: "Tuning", plan: Path, rehearsed: Path) -> "Summary":
    from rig.cli.rehearse import Rehearsing
    from rig.rehearsal.report import summary, verdict_in_one_line
    from rig.results.rehearsal.rehearse import expected_duration, rehearse_into

    with Rehearsing(request.draws, expected_duration(request, jobs=-1)) as listener:
        facts = summary(
            rehearse_into(request, rehearsed, overwrite=True, until_certain=True, listener=listener, jobs=-1)
        )
    head = wrap(f"Rehearsal: {verdict_in_one_line(facts)}.", 118, initial_indent="# ", subsequent_indent="# ")
    _write(found, plan, *head)
    return facts


def _as_seen_from(bench: str, plan: Path) -> str:
    """Return the name of the bench in the plan; for a file, its path relative to the plan's folder."""
    if not bench.endswith(".toml") or Path(bench).is_absolute():
        return bench
    return Path(os.path.relpath(bench, plan.parent)).as_posix()
