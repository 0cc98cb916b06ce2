"""``rig rehearse``: a plan on many virtual twins of a bench, before anything moves."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.options import Json, Overwrite, keep_existing, plan_and_bench

if TYPE_CHECKING:
    from rig.rehearsal.forecast import Comparison
    from rig.rehearsal.rehearsal import Draw, Effect
    from rig.results.rehearsal.rehearse import Listener, Subject


def rehearse_(
    plan: Annotated[str, typer.Argument(help="Shipped plan or TOML file; with --compare a rehearsal (.h5).")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Rehearsal (.h5) or, with --twin, bench (.toml).")
    ] = None,
    bench: Annotated[str | None, typer.Option(help="Bench to use instead of the plan's: a name or TOML file.")] = None,
    sources: Annotated[
        list[Path] | None,
        typer.Option(
            "--from",
            metavar="FILE",
            help="What is known of the rig: a recording of rig tune, rig check, any multisine or a backbone, linear modes, "
            "an exciter, a nonlinear mode; may be given several times.",
        ),
    ] = None,
    exact: Annotated[bool, typer.Option("--exact", help="A virtual bench is its own twin, with other seeds.")] = False,
    hypotheses: Annotated[Path | None, typer.Option(help="TOML table of what is assumed of the rest.")] = None,
    draws: Annotated[int, typer.Option("-n", "--draws", help="Number of twins.", min=1)] = 200,
    until_certain: Annotated[
        bool, typer.Option("--until-certain", help="End as soon as it is certain whether the plan ends well.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the draws.", min=0)] = 0,
    improve: Annotated[
        Path | None, typer.Option(metavar="PLAN", help="Try what would help; write the changed plan.")
    ] = None,
    twin: Annotated[int | None, typer.Option(metavar="N", help="Only write twin N as a bench file.", min=1)] = None,
    compare: Annotated[
        Path | None, typer.Option(metavar="RECORDING", help="Where a run lies within a rehearsal.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .png, .pdf, .svg or .html.")] = None,
    jobs: Annotated[int, typer.Option(help="Processes; -1 for one a core.")] = -1,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Run a plan on virtual twins of a bench: how probably it ends well, trips, or loses the lock, and what would help."""
    from rig.results.rehearsal.rehearse import Subject

    if compare is not None:
        _compare(Path(plan), compare, json)
        return
    loaded, chosen = plan_and_bench(plan, bench)
    subject = Subject(
        plan=loaded,
        bench=chosen,
        sources=sources or [],
        exact=exact,
        hypotheses=hypotheses,
        draws=draws,
        seed=seed,
    )
    if output is None:
        wanted = "bench, such as -o twin.toml" if twin is not None else "rehearsal, such as -o rehearsal.h5"
        raise typer.BadParameter(f"missing: the file of the {wanted}", param_hint="--output")
    if twin is not None:
        _write_twin(subject, twin, output, overwrite)
        return
    _rehearse(subject, output, improve, figure, overwrite=overwrite, until_certain=until_certain, jobs=jobs, json=json)


def _write_twin(subject: "Subject", number: int, output: Path, overwrite: bool) -> None:
    from rig.errors import ConfigurationError
    from rig.results.rehearsal.rehearse import request_for, twin_into

    if output.suffix != ".toml":
        raise ConfigurationError(f"-o {output}: benches are written as .toml")
    keep_existing(list(subject.sources), output, overwrite)
    for name, value in twin_into(request_for(subject), number, output).items():
        print(f"{name:18} {value:.6g}")
    print(f"twin {number} written to {output}; rig run PLAN --bench {output} --seed {number - 1}")


def _rehearse(
    subject: "Subject",
    output: Path,
    improve: Path | None,
    figure: Path | None,
    *,
    overwrite: bool,
    until_certain: bool,
    jobs: int,
    json: bool,
) -> None:
    from rig.errors import ConfigurationError
    from rig.figures.files import plot
    from rig.rehearsal.loading import load
    from rig.rehearsal.report import lines, summary
    from rig.results.rehearsal.rehearse import expected_duration, improve_into, rehearse_into, request_for
    from rig.show.waiting import Waiting
    from rig.text.console import print_json
    from rig.tuning.figure import check_figure
    from vibrolock.in_workers import meanwhile
    from vibrolock.printable import printable

    if output.suffix != ".h5":
        raise ConfigurationError(f"-o {output}: rehearsals are written as .h5")
    keep_existing(list(subject.sources), output, overwrite)
    if improve is not None:
        if improve.suffix != ".toml":
            raise ConfigurationError("plans are written as .toml", field="improve", value=improve)
        if improve.with_suffix(".h5").absolute() == output.absolute():
            raise ConfigurationError(
                f"its own rehearsal would be written to {output}; choose another name", field="improve", value=improve
            )
        keep_existing([], improve, overwrite)
        keep_existing([], improve.with_suffix(".h5"), overwrite)
    if figure is not None:
        check_figure(figure, overwrite)
    with Waiting("learning what is known of the rig"), meanwhile(load, jobs):
        request = request_for(subject)
    usual = expected_duration(request, jobs)
    with Rehearsing(subject.draws, usual) as listener:
        found = rehearse_into(
            request, output, overwrite=overwrite, until_certain=until_certain, listener=listener, jobs=jobs
        )
    second = None
    if improve is not None:
        with Rehearsing(subject.draws, usual) as listener:
            found, second = improve_into(request, found, output, improve, listener=listener, jobs=jobs)
    if figure is not None:
        plot(output, figure)
    if json:
        facts = {**summary(found).model_dump(by_alias=True), "file": str(output)}
        if improve is not None:
            own = None if second is None else summary(second).model_dump(by_alias=True)
            facts["improved"] = None if own is None else {**own, "plan": str(improve)}
        print_json(facts)
        return
    for line in lines(summary(found)):
        print(printable(line))
    print(f"rehearsal written to {output}" + (f", figure to {figure}" if figure else ""))
    if improve is None:
        return
    if second is None:
        print(f"no change of the plan helped: nothing was written to {improve}")
        return
    print(f"improved plan written to {improve}, its own rehearsal to {improve.with_suffix('.h5')}:")
    for line in lines(summary(second)):
        print(printable(line))


class Rehearsing:
    """Shows how many draws are done: a bar on a terminal, a line now and then elsewhere."""

    def __init__(self, total: int, usual: str) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        from rig.show.waiting import Waiting

        self.total, self.bad = total, 0
        self.terminal = sys.stderr.isatty()
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self.waiting = Waiting(f"rehearsing on {total} twins", usual, announced=True)
        self.began_s = self.first_s = time.monotonic()
        self.bar = Progress(*columns, console=Console(stderr=True), disable=not self.terminal)
        self.task = self.bar.add_task("rehearsing", total=total)

    def __enter__(self) -> "Listener":
        from rig.results.rehearsal.rehearse import Listener

        self.waiting.__enter__()
        self.bar.start()
        return Listener(self.draw, self.effect)

    def __exit__(self, *_: object) -> None:
        self.bar.stop()
        self.waiting.__exit__(None, None, None)

    def draw(self, draw: "Draw", done: int) -> None:
        """Show a draw."""
        from rig.show.waiting import heard
        from rig.text.durations import duration

        heard()
        if done <= 1:
            self.first_s = time.monotonic()
        self.bad += 0 if draw.trial.completed else 1
        text = f"rehearsing, {done - self.bad} well" if done >= self.bad else "rehearsing"
        self.bar.update(self.task, completed=done, description=text)
        if not self.terminal and (done % max(1, self.total // 10) == 0 or done == self.total):
            now_s = time.monotonic()
            left_s = (now_s - self.first_s) / max(done - 1, 1) * (self.total - done)
            left = f", about {duration(left_s)} left" if 1 < done < self.total else ""
            line = f"[{now_s - self.began_s:.0f} s] {done} of {self.total} draws, {self.bad} did not end well{left}"
            print(line, file=sys.stderr, flush=True)

    def effect(self, effect: "Effect") -> None:
        """Show a remedy that was tried."""
        (well, then), (trips, later) = effect.ends_well, effect.trips
        text = f"tried {effect.name}: ends well {well:.3f} -> {then:.3f}, trips {trips:.3f} -> {later:.3f}"
        say: Callable[[str], None] = (
            self.bar.console.print if self.terminal else lambda line: print(line, file=sys.stderr)
        )
        say(text)


def _compare(rehearsal: Path, recording: Path, json: bool) -> None:
    from dataclasses import asdict

    from rig.rehearsal.rehearsal import Rehearsal
    from rig.results.files import load_as
    from rig.results.rehearsal.rehearse import compare_with
    from rig.text.console import print_json

    found = compare_with(load_as(Rehearsal, rehearsal), recording)
    if json:
        print_json(asdict(found))
        return
    print_comparison(found)


def print_comparison(found: "Comparison") -> None:
    """Print where each point lies within what was foreseen, and the findings."""
    from rig.text.console import number, print_table

    names = ("frequency_hz", "force_n", "amplitude_m", "voltage_v", "damping_ratio")
    print_table(
        ("point", "level", "frequency", "force", "amplitude", "voltage", "damping", "finding"),
        [
            (
                str(point.number + 1),
                number(point.level, ".4g"),
                *(number(point.rank.get(name), ".0f", 100.0) for name in names),
                "yes" if point.findings else "",
            )
            for point in found.points
        ],
    )
    print("columns: per cent of the draws below what was measured")
    for text in found.findings:
        print(f"FINDING {text}")
    if not found.findings:
        print("the run lies within the forecast")
