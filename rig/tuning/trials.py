"""Trials of a tuned plan, one after the other until its levels are held."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rig.arming.run_options import RunOptions
from rig.tuning.levels import NARROWEST_SPAN, LevelChoice
from rig.tuning.plant import TuningError
from rig.tuning.trial import PlanTrial, TrialEndedError, carried_out
from rig.tuning.tuning import Tuning

TRIALS = 3  # of a plan whose levels change, at most; chosen


def try_plan(tuning: Tuning, recording: str | Path, options: RunOptions | None = None) -> Tuning:
    """Carry out the plan of a tuning, and return the tuning with the levels that were held.

    The plan keeps the longest row of levels that were accepted with something to spare (`PlanTrial.held`), in as many steps. Of
    what lies above them, as a backbone that becomes too steep, or below, as rounding, a linear test tells little. Where levels
    span little and rounding disturbs some of them, larger ones are tried once; where the lowest were too large, lower ones, and
    twice as many where one seemed implausible after the one before. A plan whose levels have changed is tried again, up to
    `TRIALS` times in all; then levels that were all accepted once, with less to spare, are better than others that were never
    tried. Ramps in which the phase lagged are made longer (`rig.tuning.longer_ramps`). The first trial is recorded in
    ``recording``, others beside it (`trial_recordings`).

    Raises `rig.tuning.plant.TuningError` if no range of levels was held, `rig.tuning.trial.TrialEndedError` if the run ended
    for another reason, and the errors of `rig.run`.
    """
    options, paths = options or RunOptions(), trial_recordings(Path(recording))
    tuning, found = _first_trial(tuning, paths[0], options)
    tuning, tried = replace(tuning, ramps=found.ramps), [(tuning.levels, found)]
    while (levels := _after(tried, tuning)) is not tuning.levels:
        notes = tuple(note for note in tuning.notes if note not in tuning.level_notes)
        tuning = replace(tuning, levels=levels, notes=notes)
        if len(tried) == TRIALS:
            ramps = next((trial.ramps for one, trial in tried if one is levels), found.ramps)
            tuning = replace(tuning, ramps=ramps)
            break
        if options.seed is not None:
            options = replace(options, seed=options.seed + 1)
        found = _tried(tuning, paths[len(tried)], options)
        tuning = replace(tuning, ramps=found.ramps)
        tried.append((levels, found))
    return replace(tuning, trials=tuple(trial for _, trial in tried))


def _tried(tuning: Tuning, recording: Path, options: RunOptions) -> PlanTrial:
    """Carry out the plan; where that ends for another reason than its levels, say what bounds these too."""
    try:
        return carried_out(tuning.plan, tuning.bench, recording, options)
    except TrialEndedError as ended:
        raise TrialEndedError("; ".join((str(ended), *tuning.level_notes))) from ended


def _after(tried: Sequence[tuple[LevelChoice, PlanTrial]], tuning: Tuning) -> LevelChoice:
    """Return the levels that follow from the trials; those of the last one if these were held.

    A refusal says what bounds these.
    """
    planned, last = tried[-1]
    if len(tried) > 1 and len(planned.levels_m) > len(tried[-2][0].levels_m):  # finer steps
        last.check_repeats(tried[-2][1])
    if len(tried) < TRIALS and (further := last.finer_levels(planned) or last.lower_levels(planned)):
        return further
    accepted = [levels for levels, trial in tried if trial.accepted == len(levels.levels_m) and len(tried) == TRIALS]
    widest = max(accepted, key=lambda levels: levels.span, default=None)
    try:
        held = last.levels(planned)
    except TuningError as refusal:
        if widest is not None:
            return widest
        raise TuningError("; ".join((str(refusal), *tuning.level_notes))) from refusal
    return held if held is planned else widest or held


def trial_recordings(first: Path) -> list[Path]:
    """Return the files in which trials of a plan are recorded, in their order."""
    return [first, *(first.with_name(f"{first.stem}-{number}{first.suffix}") for number in range(2, TRIALS + 1))]


def _first_trial(tuning: Tuning, path: Path, options: RunOptions) -> tuple[Tuning, PlanTrial]:
    """Carry out the plan, or the one of larger levels where these are better; return the tuning with this plan's levels."""
    found = _tried(tuning, path, options)
    if tuning.larger is None or not found.is_disturbed or tuning.levels.span >= NARROWEST_SPAN:
        return tuning, found
    note = f"up to a third of the limits rounding disturbs the levels ({found.missing}); these are larger"
    larger = replace(tuning, levels=tuning.larger, larger=None, notes=(*tuning.notes, note))
    beside = path.with_name(f"{path.stem}-larger{path.suffix}")
    again = _tried(larger, beside, options)
    if again.held_span(larger.levels) > found.held_span(tuning.levels):
        return larger, replace(again, recording=beside.replace(path))
    beside.unlink()
    return tuning, found
