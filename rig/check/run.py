"""Check of a bench: an ordinary run with silence, then a multisine, raised from a thousandth of the largest voltage."""

import math
from contextlib import nullcontext
from pathlib import Path

from rig.arming.bench_memory import RememberedCheck, fingerprint, now, remember
from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.planning.lengths import duration_of
from rig.campaigns.running.level_search import FIRST, LevelSearch, MultisineSeries, Seen, share_of_limits
from rig.check.assessment import Assessment, assess, responses_in
from rig.check.findings import PURPOSE
from rig.errors import ConfigurationError, RecordingError
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason

BAND = (0.4, 2.5)  # of the linear frequency: band of the multisine
LINES = 200.0  # least number of lines up to the linear frequency
ENOUGH = 0.999  # coherence of the worst channel that suffices
CLEAR_COHERENCE = 0.9999
"""Coherence of the best channel above which a dead one will not appear at a higher level either."""
DEAD_COHERENCE = 0.1  # coherence below which a channel is dead at a level; chosen
SILENT_S = 3.0  # silence before the multisine, s; chosen
SEARCH = LevelSearch(safe_share=0.1, least_rise=1.2, most_levels=5)  # see `LevelSearch`; chosen


def check(
    bench: Bench | str | Path,
    recording: str | Path,
    options: RunOptions | None = None,
    *,
    named: str | None = None,
    reference: str | Path | None = None,
    level_rms_v: float | None = None,
) -> Assessment:
    """Check a bench, record the check in ``recording``, and remember the result for arming unless the rig is virtual.

    ``named`` is the name of the bench in the recorded plan. ``reference`` is the recording of an earlier check of this bench.
    ``level_rms_v``: RMS voltage of the multisine, by default found by itself. A check moves the rig, gently, so it must be
    armed like a campaign.

    Raises `rig.errors.ConfigurationError`, `rig.errors.RecordingError`, `rig.errors.DaqError` or `rig.errors.NotArmed` if
    nothing could be checked. Faults of the rig are findings, not errors.
    """
    name = named or str(bench.name if isinstance(bench, Bench) else bench)
    bench = bench if isinstance(bench, Bench) else load_bench(bench)
    path = Path(recording)
    if reference is not None:
        if Path(reference).exists() and path.exists() and path.samefile(reference):
            raise RecordingError(f"{path}: is the reference that is read; choose another name")
        with Recording(reference) as known:
            _refuse_another_bench(known, bench)
    series = MultisineSeries(bench, path, options or RunOptions(), PURPOSE)
    silent_s = SILENT_S

    def listen(level_rms_v: float) -> Seen:
        nonlocal silent_s
        plan, silent_s = _plan(bench, name, level_rms_v, silent_s), 0.0
        with series.play(plan) as recorded:
            return seen_in(bench, recorded)

    if level_rms_v is None:
        SEARCH.search(bench, listen)
    else:
        listen(level_rms_v)
    return _assessed(bench, path, reference)


def expected_duration_s(bench: Bench, level_rms_v: float | None = None) -> tuple[float, float]:
    """Return how long a check takes at least and at most, s: silence, then the multisine at one level or at several."""
    plan = _plan(bench, bench.name, FIRST * bench.limits.voltage_v if level_rms_v is None else level_rms_v, 0.0)
    segments = plan.segments(bench.sample_rate_hz)
    one_s = sum(duration_of(plan, segment, bench.specimen.linear_frequency_hz) for segment in segments)
    return SILENT_S + one_s, SILENT_S + (SEARCH.most_levels if level_rms_v is None else 1) * one_s


def _refuse_another_bench(reference: Recording, bench: Bench) -> None:
    """Refuse, before anything moves, a reference that is no check, or is one of another bench."""
    responses_in(reference)
    name = reference.configuration["bench"]["name"]
    if name != bench.name:
        raise RecordingError(f"{reference.path}: is a check of the bench {name}, not of {bench.name}")


def _assessed(bench: Bench, path: Path, reference: str | Path | None) -> Assessment:
    with Recording(path) as recorded, nullcontext() if reference is None else Recording(reference) as known:
        found = assess(recorded, known)
        facts = recorded.parts[0].information["about"]
        virtual, identity = facts["armed"]["how"] == "virtual", facts["device"]
    if not virtual:
        remembered = RememberedCheck(
            now(), found.failed, str(path.absolute()), fingerprint(bench, identity), found.scale
        )
        remember(bench, check=remembered)
    return found


def _plan(bench: Bench, name: str, level_rms_v: float, silent_s: float) -> MultisinePlan:
    from scipy.fft import next_fast_len

    linear, allowed = bench.specimen.linear_frequency_hz, bench.limits.frequency_hz
    lowest, highest = max(BAND[0] * linear, allowed[0]), min(BAND[1] * linear, allowed[1])
    samples = next_fast_len(round(bench.sample_rate_hz * LINES / linear))  # other periods take eight times as long
    if samples < 4.0 * LINES or not lowest < linear < highest:
        raise ConfigurationError(
            field="specimen.linear_frequency_hz",
            value=linear,
            allowed=f"inside limits.frequency_hz and up to a quarter of sample_rate_hz, {0.25 * bench.sample_rate_hz:g} Hz",
        )
    return MultisinePlan(
        bench=name,
        description="low-level multisine of a check",
        levels_rms_v=(level_rms_v,),
        lowest_hz=lowest,
        highest_hz=highest,
        resolution_hz=bench.sample_rate_hz / samples,
        grid="odd-random",
        realisations=1,
        periods=2,
        transient_periods=1,
        silent_s=silent_s,
        accepted_change=1.0,
    )


def seen_in(bench: Bench, recorded: Recording) -> Seen:
    """Evaluate the last multisine of a check. If the run ended early, no higher level is allowed."""
    end = recorded.parts[-1].end
    found = responses_in(recorded)
    if found is None or end is None or end["reason"] != EndReason.COMPLETED.name.lower():
        return Seen(enough=False, share_of_limits=math.inf)
    counted = [i for i, channel in enumerate(bench.channels) if channel.role != "monitor"]
    coherence = found.coherence[counted]
    hopeless = (coherence < DEAD_COHERENCE) & (coherence.max() > CLEAR_COHERENCE)
    at = [point.rows for point in points_of(recorded) if point.rows is not None][-1]
    rows = recorded.parts[-1].read(at.first_sample, at.end_sample)
    lowest_hz = max(BAND[0] * bench.specimen.linear_frequency_hz, bench.limits.frequency_hz[0])

    lowest_rad_s = 2.0 * math.pi * lowest_hz  # all of the acceleration may be at this frequency
    enough = bool(((coherence >= ENOUGH) | hopeless).all())
    return Seen(enough, share_of_limits(bench, rows, lambda _, acceleration_m_s2: acceleration_m_s2 / lowest_rad_s**2))
