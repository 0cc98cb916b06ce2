"""Recordings of a study. Each is made once, and resumed where it was interrupted."""

from collections.abc import Callable
from pathlib import Path

from identification import Exciter, Experiment, identify_exciter
from rig.arming.run_options import Progress, RunOptions, Silent
from rig.bench import Bench
from rig.campaigns.kinds import KINDS
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.planning.plan import Plan
from rig.campaigns.plans import load_plan
from rig.campaigns.running.runner import resume_run, run_plan
from rig.errors import RigError
from rig.measurements import spectra
from rig.measurements.experiments import experiments
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from rig.show.progress import RunProgress
from studies.reproduce.options import Options

_REDRAWN = 20
"""Largest number of new draws of a realisation's phases if its peaks are beyond the bench's limits."""
_STOPPED = "stop_requested"


def multisines(options: Options, say: Callable[[str], None]) -> dict[str, tuple[Experiment, ...]]:
    """Return all realisations by level."""
    found: dict[str, tuple[Experiment, ...]] = {}
    for level, name in options.plans.items():
        plan = load_plan(f"{options.specimen.name}/{name}")
        assert isinstance(plan, MultisinePlan)
        if not options.scatter:
            found[level] = training_data(options, recorded(options, name, say))
            continue
        say(f"{name}: {plan.realisations} realisations, a run each")
        runs = [_own_run(options, name, plan, index) for index in range(plan.realisations)]
        found[level] = tuple(one for path in runs for one in training_data(options, path))
    return found


def segments(options: Options, say: Callable[[str], None]) -> tuple[Experiment, ...]:
    """Return the points that are fitted together with multisines."""
    return tuple(one for name in options.beside for one in training_data(options, recorded(options, name, say)))


def recorded(options: Options, name: str, say: Callable[[str], None]) -> Path:
    """Record a shipped plan in one run with a separate seed; return the path of the recording."""
    path = options.recordings / f"{name}.h5"
    if not path.exists():
        say(f"{name}: recording")
    plan = load_plan(f"{options.specimen.name}/{name}")
    _make(plan, _bench(options), path, _seed(options, name))
    return path


def exciter_of(options: Options, say: Callable[[str], None]) -> Exciter:
    """Identify the exciter that is coupled to models whose input is the force, from a multisine of its own."""
    with Recording(recorded(options, options.specimen.exciter, say)) as recording:
        measured = next(iter(spectra(recording).values()))
        rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    return identify_exciter(measured, sample_rate_hz=rate_hz)


def _own_run(options: Options, name: str, plan: MultisinePlan, index: int) -> Path:
    """Record one realisation as a run with a separate seed. With scatter, each run has another specimen."""
    path = options.recordings / f"{name}-{index:02d}.h5"
    seed = _seed(options, name) + 1 + index
    for draw in range(_REDRAWN):
        phases = plan.phase_seed + 1000 * (1 + index) + 100_000 * draw
        one = plan.model_copy(update={"realisations": 1, "phase_seed": phases})
        if _make(one, _bench(options), path, seed, quiet=True):
            return path
        path.unlink()
    raise RigError(
        f"{path}: no phases of {_REDRAWN} keep {name} within the limits of bench {options.bench.name}; lower the level"
    )


def _make(plan: Plan, bench: Bench, path: Path, seed: int, *, quiet: bool = False) -> bool:
    """Record or resume a run, or leave a complete one; return whether it is complete.

    Raises `KeyboardInterrupt` if the user stopped it.
    """
    if path.exists() and not journal_path(path).exists():
        with Recording(path) as recording:
            if recording.complete:
                return True
    shown = RunProgress(KINDS[plan.kind].columns)
    watcher: Progress = Silent() if quiet else shown
    try:
        if path.exists() or journal_path(path).exists():  # tripped levels may be tried again, as these rigs are virtual
            recording = resume_run(path, RunOptions(progress=watcher), retry_tripped=True)
        else:
            recording = run_plan(plan, bench, path, RunOptions(seed=seed, progress=watcher))
    finally:
        if not quiet:
            shown.close()
    with recording:
        end = recording.parts[-1].end or {}
        if end.get("reason") == _STOPPED:
            raise KeyboardInterrupt
        return recording.complete


def training_data(options: Options, path: Path, *, given: str | None = None) -> tuple[Experiment, ...]:
    """Return the experiments of a recording in the form that the models of this study need, or with another input ``given``."""
    by = options.input if given is None else given
    outputs = (*(("force",) if by == "voltage" else ()), *options.specimen.outputs)
    with Recording(path) as recording:
        return experiments(recording, inputs=(by,), outputs=outputs, rate_hz=options.specimen.rate_hz)


def _bench(options: Options) -> Bench:
    if not options.scatter:
        return options.bench
    driver = options.bench.driver
    scatter = {**driver.table("scatter"), "frequency": options.scatter}
    return options.bench.model_copy(
        update={"driver": driver.model_copy(update={"options": {**driver.options, "scatter": scatter}})}
    )


def _seed(options: Options, name: str) -> int:
    """Return the seed of a plan, derived from that of the study; the next thousand seeds are for single runs of the plan."""
    specimen = options.specimen
    first, *others = specimen.beside
    names = [*specimen.levels.values(), first, specimen.exciter, *specimen.sweeps, *others, specimen.modes_plan]
    return options.seed * 1_000_000 + 1000 * names.index(name)
