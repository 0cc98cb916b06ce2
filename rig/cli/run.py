"""``rig run`` and ``rig resume``: carry out a plan, and finish an interrupted run."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, plan_and_bench
from rig.cli.run_options import by_the_clock, of_a_further_part, of_a_recording, shown, with_options

if TYPE_CHECKING:
    from rig.arming.run_options import RunOptions
    from rig.bench import Bench
    from rig.campaigns.planning.plan import Plan
    from rig.recording.reader import Recording

Rehearsed = Annotated[Path | None, typer.Option(help="Rehearsal of the plan on this bench, for arming and the record.")]
Check = Annotated[Path | None, typer.Option(help="Check of this bench to compare with, in place of the last one.")]
Override = Annotated[
    str, typer.Option("--override-rehearsal", metavar="WHY", help="Run although the bench asks for another rehearsal.")
]


@with_options(of_a_recording, monitored=True)
def run(
    *,
    plan: Annotated[str, typer.Argument(help="Shipped plan (magnet-beam/backbone) or TOML file.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Recording to write; not needed with --dry-run.")
    ] = None,
    bench: Annotated[str | None, typer.Option(help="Bench to use instead of the plan's: a name or TOML file.")] = None,
    daq: Annotated[str | None, typer.Option(help="Driver to use instead of the bench's.")] = None,
    check: Check = None,
    rehearsal: Rehearsed = None,
    override_rehearsal: Override = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what the run would do and take, and what arms it; drive nothing.")
    ] = False,
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Carry out a plan and record it."""
    from rig.campaigns.running.runner import run_plan
    from rig.show.waiting import Waiting

    loaded, chosen = plan_and_bench(plan, bench)
    if output is None and not dry_run:
        raise typer.BadParameter(
            "missing: the file of the recording, such as -o run.h5, or --dry-run", param_hint="--output"
        )
    if daq is not None:
        chosen = chosen.model_copy(update={"driver": chosen.driver.model_copy(update={"name": daq})})
    if output is None or dry_run:
        _say_what_would_be_done(loaded, chosen, output or Path("recording.h5"), json)
        return
    if check is not None:
        from rig.check.assessment import checked_scale

        options = replace(options, check=checked_scale(check, chosen))
    options = _with_rehearsal(options, rehearsal, override_rehearsal)
    how_long = partial(_how_long, loaded, chosen, by_the_clock(chosen, options))
    with Waiting(f"running {plan} on {chosen.name}", how_long):
        _carry(loaded.kind, options, lambda watched: run_plan(loaded, chosen, output, watched), json, plan)


@with_options(of_a_further_part, monitored=True)
def resume(
    *,
    output: Annotated[Path, typer.Argument(help="Recording of the interrupted run.")],
    plan: Annotated[str | None, typer.Option(help="Changed plan to go on with: a name or TOML file.")] = None,
    retry_tripped: Annotated[
        bool, typer.Option("--retry-tripped", help="Try a level at which the run tripped again.")
    ] = False,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Import the functions that the recording's bench names.")
    ] = False,
    rehearsal: Rehearsed = None,
    override_rehearsal: Override = "",
    options: "RunOptions",
    json: Json = False,
) -> None:
    """Finish a run that was interrupted, by its plan or a changed one; points that were accepted stay."""
    from rig.campaigns.plans import load_plan
    from rig.campaigns.running.runner import resume_run
    from rig.recording.reader import Recording
    from rig.show.waiting import Waiting

    with Recording(output) as recording:
        kind = recording.kind
    change = None if plan is None else load_plan(plan)
    options = _with_rehearsal(options, rehearsal, override_rehearsal)
    with Waiting(f"resuming {output}"):
        _carry(
            kind,
            options,
            lambda watched: resume_run(
                output, watched, change=change, source=plan or "", retry_tripped=retry_tripped, trust_code=trust_code
            ),
            json,
        )


def _how_long(plan: "Plan", bench: "Bench", by_the_clock: bool) -> str:
    """Say how long a run takes; nothing if plan and bench do not fit, which the run itself will say."""
    from rig.campaigns.running.dry_run import expected_duration
    from rig.errors import RigError

    with suppress(RigError):
        return expected_duration(plan, bench, by_the_clock=by_the_clock)
    return ""


def _with_rehearsal(options: "RunOptions", rehearsal: Path | None, override: str) -> "RunOptions":
    if rehearsal is not None:
        from rig.rehearsal.forecasting import rehearsed_in
        from rig.rehearsal.rehearsal import Rehearsal
        from rig.results.files import load_as

        options = replace(options, rehearsal=rehearsed_in(load_as(Rehearsal, rehearsal), str(rehearsal)))
    return replace(options, override_rehearsal=override)


def _carry(
    kind: str, options: "RunOptions", start: "Callable[[RunOptions], Recording]", json: bool, source: str = ""
) -> None:
    """Run, show each point and how the run ended; exit with status 1 if the plan was not completed."""
    from rig.campaigns.kinds import KINDS
    from rig.recording.reader import Recording
    from rig.show.summary import summarise_recording
    from rig.show.tables import say_how_it_ended
    from rig.system.stop_signals import Interrupted, Terminated, ignore_from_now_on
    from rig.text.console import print_json

    with shown(options, KINDS[kind].columns) as watched:
        try:
            result = start(watched)
        except (Interrupted, Terminated) as signal:
            if signal.recorded is None:
                raise
            result = Recording(signal.recorded)  # the signal came when the recording was already complete
    ignore_from_now_on()
    with result:
        summary = summarise_recording(result)
        complete, path = result.complete, result.path
    if json:
        print_json(summary)
    else:
        say_how_it_ended(summary, path, _pure_plan(source))
    if not complete:
        raise typer.Exit(1)


def _say_what_would_be_done(plan: "Plan", bench: "Bench", output: Path, json: bool) -> None:
    from rig.campaigns.running.dry_run import dry_run
    from rig.text.console import print_json
    from vibrolock.printable import printable

    found = dry_run(plan, bench, output)
    if json:
        print_json(found.to_json())
        return
    for line in found.lines():
        print(printable(line))


def _pure_plan(source: str) -> str:
    """Say how the plan ``source`` is carried out under a force that is a sine."""
    from rig.campaigns.plans import shipped_plans

    pure = f"{source}-pure"
    how = f"the plan {pure}" if pure in shipped_plans() else "a table [controller.harmonics] in the plan"
    return f"{how} makes the force a sine, which avoids force harmonics"
