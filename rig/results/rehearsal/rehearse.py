"""Rehearse plans from files to files: sources of knowledge in, a rehearsal, an improved plan or a twin out."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from rig.bench import Bench
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.planning.plan import Plan
from rig.campaigns.running.dry_run import FAST, SLOW, dry_run
from rig.errors import ConfigurationError, RecordingError
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.rehearsal.files import write_bench, write_plan
from rig.rehearsal.forecast import Comparison, compare
from rig.rehearsal.forecasting import forecast
from rig.rehearsal.hypotheses import Hypotheses, load_hypotheses
from rig.rehearsal.knowledge import collect_knowledge
from rig.rehearsal.rehearsal import Draw, Effect, Rehearsal, RehearsalRequest, discard_draws, draws_path, rehearse
from rig.rehearsal.remedies import improve
from rig.results.files import load, save
from rig.results.kinds import KINDS
from rig.system.stop_signals import ended_in_order
from rig.text.durations import duration

START_S = 10.0  # s until the processes of a rehearsal are at work; measured on two cores
FURTHER_SEED = 1
"""Added to the seed of a rehearsal for that of the improved plan, which was chosen by the first one's twins."""


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What is to be rehearsed, and on what knowledge."""

    plan: Plan
    bench: Bench
    sources: Sequence[Path] = ()
    """Recordings and models that tell of the rig."""
    exact: bool = False
    """Whether a virtual bench is its own twin, with other seeds alone."""
    hypotheses: Path | None = None
    """Table of hypotheses; the defaults if None."""
    draws: int = 200
    """Number of twins."""
    seed: int = 0
    """Seed of the draws."""


@dataclass(frozen=True)
class Listener:
    """Is told how a rehearsal goes on."""

    draw: Callable[[Draw, int], None] = lambda _draw, _done: None
    """A draw is done, and how many are."""
    effect: Callable[[Effect], None] = lambda _: None
    """A remedy was tried."""


def request_for(subject: Subject) -> RehearsalRequest:
    """Read the sources and return what to rehearse. Raises `ConfigurationError` or `RecordingError`."""
    if subject.exact and subject.sources:
        raise ConfigurationError(
            "`exact`, `sources`: allowed is one of them: an exact twin is not made from measurements"
        )
    if subject.exact and subject.bench.driver.name != "virtual":
        name = subject.bench.driver.name
        raise ConfigurationError(
            f"`exact`: the driver of the bench {subject.bench.name} is {name!r}, allowed is 'virtual'"
        )
    hypotheses = Hypotheses() if subject.hypotheses is None else load_hypotheses(subject.hypotheses)
    with _opened(subject.sources) as sources:
        knowledge = None if subject.exact else collect_knowledge(subject.bench, subject.plan, sources)
    return RehearsalRequest(
        plan=subject.plan,
        bench=subject.bench,
        knowledge=knowledge,
        hypotheses=hypotheses,
        draws=subject.draws,
        seed=subject.seed,
    )


def expected_duration(request: RehearsalRequest, jobs: int | None) -> str:
    """Return how long a rehearsal will take, in words, on so many processes (-1: one a core)."""
    twin_s = dry_run(request.plan, request.bench, Path("rehearsal.h5")).least.duration_s
    processes = min(os.cpu_count() or 1 if jobs is None or jobs < 1 else jobs, request.draws)
    quick, slow = (duration(START_S + request.draws * twin_s / (speed * processes)) for speed in (FAST, SLOW))
    return f"some {quick} to {slow}: each runs {duration(twin_s)} at {SLOW:g} to {FAST:g} times real time"


@contextmanager
def _opened(paths: Sequence[Path]) -> Iterator[dict[str, object]]:
    with ExitStack() as stack:
        found: dict[str, object] = {}
        for path in paths:
            found[str(path)] = load(path) if kind_of(path) in KINDS else stack.enter_context(Recording(path))
        yield found


@ended_in_order()
def rehearse_into(
    request: RehearsalRequest,
    output: Path,
    *,
    overwrite: bool = False,
    until_certain: bool = False,
    listener: Listener | None = None,
    jobs: int | None = None,
) -> Rehearsal:
    """Rehearse and write the file ``output``; a rehearsal that was interrupted is taken up again.

    ``until_certain``: draws end as soon as it is certain whether the plan ends well.

    Raises `RecordingError` if the file exists and must stay, or cannot be written; the draws so far are then kept.
    """
    listener = listener or Listener()
    if output.exists() and not overwrite:
        raise RecordingError(f"{output}: exists already; choose another name, or `overwrite`")
    if output.is_dir() or not output.parent.is_dir():
        raise RecordingError(f"{output}: is a folder, or in none; the name of a file is expected")
    journal = draws_path(output)
    if overwrite and output.exists():
        discard_draws(journal)
    found = rehearse(
        request, journal, begin_anew=overwrite, until_certain=until_certain, progress=listener.draw, jobs=jobs
    )
    save(found, output)
    journal.unlink(missing_ok=True)
    return found


def improve_into(
    request: RehearsalRequest,
    rehearsal: Rehearsal,
    output: Path,
    improved: Path,
    *,
    listener: Listener | None = None,
    jobs: int | None = None,
) -> tuple[Rehearsal, Rehearsal | None]:
    """Try remedies, and write the improved plan and its own rehearsal beside it (``.h5``), on other twins.

    What was tried is added to the rehearsal in ``output``. Return that rehearsal and that of the improved plan; None if no
    remedy helped, and nothing is written then.
    """
    listener = listener or Listener()
    found = improve(request, rehearsal, progress=listener.effect, jobs=jobs)
    first = replace(rehearsal, tried=found.effects)
    save(first, output)
    if not found.changes:
        return first, None
    head = f"{request.plan.description or request.plan.kind}, improved by a rehearsal on {len(rehearsal.draws)} twins"
    write_plan(found, improved, [head])
    again = replace(request, plan=found.plan, drawn_for=request.plan, seed=request.seed + FURTHER_SEED)
    second = rehearse(again, progress=listener.draw, jobs=jobs)
    save(second, improved.with_suffix(".h5"))
    return first, second


def twin_into(request: RehearsalRequest, number: int, output: Path) -> dict[str, float]:
    """Write the twin of a draw (counted from 1) as a bench file; return its unknowns."""
    ConfigurationError.unless_between("twin", number, 1, request.draws)
    twin = request.twin(number - 1)
    unknowns = [f"{name} = {value:.6g}" for name, value in twin.unknowns.items()]
    write_bench(twin.bench, output, [f"{twin.bench.description}; run it with seed {twin.number}", *unknowns])
    return dict(twin.unknowns)


def compare_with(rehearsal: Rehearsal, path: Path) -> Comparison:
    """Compare a recording with what a rehearsal of its plan foresaw. Raises `RecordingError` for one of another kind."""
    kind = rehearsal.facts.plan_kind
    with Recording(path) as recording:
        if recording.kind != kind:
            raise RecordingError(f"{path}: is a recording of kind {recording.kind}; rehearsed was a {kind}")
        end = recording.parts[-1].end if recording.parts else None
        return compare(forecast(rehearsal), points_of(recording), end)
