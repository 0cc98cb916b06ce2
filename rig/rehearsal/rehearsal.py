"""Rehearsal of a plan on many twins, in parallel, resumable, with a journal of the draws."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from pydantic import JsonValue, TypeAdapter

import vibrolock
from rig.arming.rehearsed import subject_digest
from rig.bench import Bench
from rig.campaigns.planning.plan import Plan
from rig.errors import ConfigurationError, RecordingError
from rig.rehearsal.hypotheses import Hypotheses
from rig.rehearsal.knowledge import Knowledge
from rig.rehearsal.sequential import fewest_further, is_certain
from rig.rehearsal.trial import Trial, not_computed, run_trial
from rig.rehearsal.truth import NOT_BALANCED, TrueBackbone, true_backbone
from rig.rehearsal.twins import Twin, draw_twin
from simulators.ensemble import ensemble
from vibrolock.results import Result

MAX_DRAWS = 100_000  # largest number of draws; chosen: their file stays below some 100 MB
_HEAD = '{"rehearsal": "'  # beginning of every journal of draws


@dataclass(frozen=True, kw_only=True)
class Draw:
    """One twin and how the plan ended on it."""

    number: int
    """Number, from 0."""
    unknowns: Mapping[str, float]
    """What was drawn, by name."""
    trial: Trial
    """How the plan ended."""
    truth: TrueBackbone
    """What harmonic balance of the twin finds."""


_DRAWS = TypeAdapter(list[Draw])  # reader of a journal's draws; keys of other versions are ignored
Table = dict[str, JsonValue]
"""Keys of a plan, a bench or hypotheses, as in JSON."""


@dataclass(frozen=True)
class Effect:
    """What a remedy did on the twins on which it was tried."""

    name: str
    """The remedy."""
    changes: Table
    """Keys of the plan with their new values."""
    ends_well: tuple[float, float]
    """Probability that the plan ends well, without and with it."""
    trips: tuple[float, float]
    """Probability of a trip, without and with it."""
    points: tuple[float, float]
    """Accepted points over those of the plan as it was given, in the mean, without and with it; at most 1."""
    draws: int
    """Number of twins on which it was tried."""
    taken: bool = False
    """Whether it is part of the improved plan."""


@dataclass(frozen=True, kw_only=True)
class RehearsalFacts:
    """Everything that the draws of a rehearsal depend on; the number of draws is not among it."""

    plan: Table
    """The plan."""
    bench: Table
    """The bench."""
    hypotheses: Table | None = None
    """The hypotheses; None where a virtual bench is rehearsed on itself."""
    sources: tuple[str, ...] = ()
    """Sources of the knowledge, one line each."""
    most_likely: dict[str, float] = field(default_factory=dict)
    """Most likely parameters of the linear rig."""
    relative_std: dict[str, float] = field(default_factory=dict)
    """Their standard deviations, relative where a parameter is positive."""
    determined: float | None = None
    """Proportion of the parameters' directions that the data determine."""
    drawn_for: Table | None = None
    """Plan for which the twins were drawn, if it is another one."""
    tests: str
    """Digest of plan and bench (`rig.arming.rehearsed.subject_digest`)."""
    seed: int
    """Seed of the draws."""
    software_version: str
    """Version of this program."""

    @property
    def plan_kind(self) -> str:
        """Kind of the plan."""
        return str(self.plan["kind"])

    @property
    def plan_text(self) -> str:
        """Description of the plan, or else its kind."""
        return str(self.plan["description"] or self.plan["kind"])

    @property
    def bench_name(self) -> str:
        """Name of the bench."""
        return str(self.bench["name"])

    @property
    def specimen(self) -> str:
        """Name of the specimen."""
        facts = self.bench["specimen"]
        return str(facts["name"]) if isinstance(facts, dict) else ""


@dataclass(frozen=True, eq=False, kw_only=True)
class RehearsalRequest:
    """What is to be rehearsed.

    Raises `ConfigurationError` for values that are not allowed.
    """

    plan: Plan
    """The plan."""
    bench: Bench
    """The bench."""
    knowledge: Knowledge | None = None
    """What is known of the rig; None rehearses a virtual bench on itself."""
    hypotheses: Hypotheses = field(default_factory=Hypotheses)
    """What is assumed of everything else."""
    draws: int = 200
    """Number of twins."""
    seed: int = 0
    """Seed of the draws."""
    drawn_for: Plan | None = None
    """Plan whose highest level the sizes of hypotheses refer to; the plan itself if None. A changed plan keeps the rigs of the
    one before."""
    balanced: bool = True
    """Whether harmonic balance of each twin is wanted."""

    def __post_init__(self) -> None:
        ConfigurationError.unless_between("draws", self.draws, 1, MAX_DRAWS)
        ConfigurationError.unless_at_least("seed", self.seed, 0)
        self.plan.check(self.bench)

    def twin(self, number: int) -> Twin:
        """Return the twin of a number."""
        if self.knowledge is None:  # the virtual bench itself, with another seed
            return Twin(self.seed + number, self.bench, {})
        return draw_twin(self.bench, self.drawn_for or self.plan, self.knowledge, self.hypotheses, self.seed, number)

    def __call__(self, number: int) -> Draw:
        """Draw a twin and run the plan on it. A twin that cannot be computed is a result too: the others go on."""
        unknowns: Mapping[str, float] = {}
        truth = NOT_BALANCED
        try:
            twin = self.twin(number)
            unknowns = twin.unknowns
            exact = self.knowledge is None  # other twins are like the rig near its mode, not where images lie
            trial = run_trial(self.plan, twin.bench, twin.number, images_known=exact)
        except (OSError, MemoryError):  # of the machine, not of the twin
            raise
        except Exception as error:  # whatever a drawn rig does to the numbers
            trial = not_computed(error)
        else:
            if self.balanced:
                truth = true_backbone(twin.bench, trial, twin.number, self.plan.law.harmonics)
        return Draw(number=number, unknowns=unknowns, trial=trial, truth=truth)

    @property
    def facts(self) -> RehearsalFacts:
        """Everything that the draws depend on."""
        known = self.knowledge
        facts = RehearsalFacts(
            plan=self.plan.model_dump(mode="json"),
            bench=self.bench.model_dump(mode="json"),
            drawn_for=None if self.drawn_for is None else self.drawn_for.model_dump(mode="json"),
            tests=subject_digest(self.plan, self.bench),
            seed=self.seed,
            software_version=vibrolock.__version__,
        )
        if known is None:
            return facts
        return replace(
            facts,
            hypotheses=self.hypotheses.model_dump(mode="json"),
            sources=known.sources,
            most_likely=dict(known.linear.rig().values),
            relative_std={name: known.linear.std(name) for name in known.linear.names},
            determined=known.linear.determined,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Rehearsal(Result):
    """The draws of a rehearsal and what they depend on."""

    facts: RehearsalFacts
    """What the draws depend on."""
    draws: tuple[Draw, ...]
    """The draws, by number."""
    finished: str
    """When it was finished, ISO 8601."""
    tried: tuple[Effect, ...] = ()
    """Remedies that were tried on its twins."""
    at_most: int | None = None
    """Number of twins that were asked for, of a rehearsal that ends once it is certain (`rig.rehearsal.sequential`)."""

    @property
    def digest(self) -> str:
        """Digest of facts and draws, which a recording names."""
        return _digest({"facts": asdict(self.facts), "draws": [asdict(draw) for draw in self.draws]})


def _digest(content: Mapping[str, object]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def draws_path(output: Path) -> Path:
    """Return the journal of the draws beside the file of a rehearsal."""
    return output.with_name(f"{output.name}.draws")


def discard_draws(journal: Path) -> None:
    """Remove the journal of a rehearsal. Raises `RecordingError` if it is none of this program's, or cannot be removed."""
    try:
        with journal.open(encoding="utf-8") as stream:
            start = stream.read(len(_HEAD))
        if not _HEAD.startswith(start):
            raise RecordingError(f"{journal}: holds no draws of a rehearsal; move it away, or choose another name")
        journal.unlink()
    except FileNotFoundError:
        return
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{journal}: cannot be removed ({error})") from None


def rehearse(
    request: RehearsalRequest,
    journal: Path | None = None,
    *,
    begin_anew: bool = False,
    until_certain: bool = False,
    progress: Callable[[Draw, int], None] = lambda _draw, _done: None,
    jobs: int | None = None,
) -> Rehearsal:
    """Run the plan on all twins.

    Parameters
    ----------
    request
        Plan, bench, knowledge and number of twins.
    journal
        File to which every draw is appended. A journal of the same rehearsal is resumed; the caller removes it.
    begin_anew
        Whether a journal of another rehearsal is replaced rather than refused.
    until_certain
        Whether draws end as soon as it is certain whether the plan ends well (`rig.rehearsal.sequential`), rather than all of
        the request being made.
    progress
        Is called with each draw and the number of draws that are done.
    jobs
        Number of processes as in joblib; None follows `joblib.parallel_config`, with which a cluster is one line of the caller.

    Raises
    ------
    RecordingError
        For a journal of another rehearsal, or one that cannot be written.
    ConfigurationError
        If no twin could be computed.
    """
    done = {} if journal is None else _completed_draws(journal, request, begin_anew)
    for count, draw in enumerate(done.values(), 1):
        progress(draw, count)
    draws: list[Draw] = []
    certain = False
    while len(draws) < request.draws and not certain:
        further = fewest_further(*_ended_well(draws)) if until_certain else request.draws
        numbers = range(len(draws), min(len(draws) + further, request.draws))
        results = ensemble({str(number): number for number in numbers if number not in done}, request, n_jobs=jobs)
        with closing(results):
            for number in numbers:
                if number not in done:
                    _, draw = next(results)
                    done[number] = draw
                    if journal is not None:
                        _append(journal, asdict(draw))
                    progress(draw, len(done))
                draws.append(done[number])
                certain = until_certain and is_certain(*_ended_well(draws))
                if certain:
                    break
    if not any(draw.trial.computed for draw in draws):
        raise ConfigurationError(f"none of {len(draws)} twins could be computed: {draws[0].trial.text}")
    return Rehearsal(
        facts=request.facts,
        draws=tuple(draws),
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
        at_most=request.draws if until_certain else None,
    )


def _ended_well(draws: Sequence[Draw]) -> tuple[int, int]:
    """Number of draws that ended well, and of those that could be computed."""
    return sum(draw.trial.completed for draw in draws), sum(draw.trial.computed for draw in draws)


def _completed_draws(journal: Path, request: RehearsalRequest, begin_anew: bool) -> dict[int, Draw]:
    """Return the draws that a journal holds; begin it if it does not exist. A last line that was cut off is dropped."""
    head = {"rehearsal": _digest(asdict(request.facts))}
    if not journal.exists():
        _append(journal, head)
        return {}
    try:
        lines = journal.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{journal}: cannot be read ({error})") from None
    tables: list[Mapping[str, object]] = []
    with suppress(json.JSONDecodeError):  # from a last line that was cut off
        tables.extend(json.loads(line) for line in lines)
    if tables[:1] != [head]:
        if begin_anew:
            discard_draws(journal)
            _append(journal, head)
            return {}
        raise RecordingError(
            f"{journal}: holds the draws of another rehearsal (another plan, bench, knowledge, seed or version); "
            "`overwrite` to start over"
        )
    if len(tables) < len(lines):
        discard_draws(journal)
        for table in tables:
            _append(journal, table)
    draws = _DRAWS.validate_python(tables[1:])
    return {draw.number: draw for draw in draws if draw.number < request.draws}


def _append(journal: Path, table: Mapping[str, object]) -> None:
    try:
        with journal.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(table) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise RecordingError(f"{journal}: cannot be written ({error.strerror}); the draws so far are in it") from None
