"""The check of a bench: silence, then a multisine from a thousandth of the largest voltage upwards, as an ordinary run."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.arming.arming import Arm, asked_once
from rig.arming.bench_memory import RememberedCheck, fingerprint, now, remember
from rig.arming.run_facts import About
from rig.bench import Bench, load_bench
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.running.execution import Progress
from rig.campaigns.running.runner import carry_out, take_up
from rig.check.assessment import PURPOSE, Assessment, assess, responses_in
from rig.errors import ConfigurationError, RecordingError
from rig.recording.reader import Recording
from rig.tick.safety.layout import EndReason

__all__ = ["check", "next_level", "share_of_limits"]

BAND = (0.4, 2.5)  # of the linear frequency
LINES = 200.0  # up to the linear frequency
FIRST = 1e-3  # of the largest voltage, RMS
SAFE = 0.1  # of every limit: what peaks may reach
RISE = 4.0
ENOUGH = 0.999  # coherence of the worst channel
CLEAR = 0.9999  # of the best: what another does not show now, it will not show louder
DEAD = 0.1
MOST_LEVELS = 5
SILENT_S = 3.0


def check(
    bench: Bench | str | Path,
    recording: str | Path,
    *,
    named: str | None = None,
    reference: str | Path | None = None,
    seed: int = 0,
    realtime: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    arm: Arm = None,
    about: About | None = None,
) -> Assessment:
    """Check a bench, record it in ``recording``, and remember the result for arming unless the rig is virtual.

    ``named`` is what the recorded plan calls the bench.
    ``reference`` is the recording of an earlier check. ``arm`` and ``about`` as for
    `rig.campaigns.running.runner.carry_out`: a check moves the rig, gently, and so it must be armed too.

    Raises `rig.errors.ConfigurationError`, `rig.errors.RecordingError`, `rig.errors.DaqError` and `rig.errors.NotArmed`
    where nothing could be checked; what is wrong with the rig are findings.
    """
    name = named or str(bench.name if isinstance(bench, Bench) else bench)
    bench = bench if isinstance(bench, Bench) else load_bench(bench)
    path, about = Path(recording), replace(about or About(), purpose=PURPOSE)
    if reference is not None:
        if Path(reference).exists() and path.exists() and path.samefile(reference):
            raise RecordingError(f"{path}: is the reference that is read; choose another name")
        with Recording(reference) as known:
            responses_in(known)  # refused before anything moves
    level, arm = FIRST * bench.limits.voltage_v, asked_once(arm)
    for tried in range(MOST_LEVELS):
        plan = _plan(bench, name, level, silent=tried == 0)
        if tried == 0:
            done = carry_out(
                plan,
                bench,
                path,
                seed=seed,
                realtime=realtime,
                overwrite=overwrite,
                progress=progress,
                arm=arm,
                about=about,
            )
        else:
            done = take_up(
                path, change=plan, realtime=realtime, progress=progress, arm=arm, about=about, trust_code=True
            )
        with done as recorded:
            higher = next_level(bench, recorded, level)
        if higher is None:
            break
        level = higher
    return _assessed(bench, path, reference)


def _assessed(bench: Bench, path: Path, reference: str | Path | None) -> Assessment:
    with Recording(path) as recorded:
        if reference is None:
            found = assess(recorded)
        else:
            with Recording(reference) as known:
                found = assess(recorded, known)
        facts = recorded.parts[0].information["about"]
        virtual, identity = facts["armed"]["how"] == "virtual", facts["device"]
    if not virtual:
        remembered = RememberedCheck(now(), found.failed, str(path.absolute()), fingerprint(bench, identity))
        remember(bench, check=remembered)
    return found


def _plan(bench: Bench, name: str, level_rms_v: float, *, silent: bool) -> MultisinePlan:
    linear, allowed = bench.specimen.linear_frequency_hz, bench.limits.frequency_hz
    lowest, highest = max(BAND[0] * linear, allowed[0]), min(BAND[1] * linear, allowed[1])
    samples = round(bench.sample_rate_hz * LINES / linear)
    if samples < 4.0 * LINES or not lowest < linear < highest:
        raise ConfigurationError(
            f"specimen.linear_frequency_hz = {linear:g} Hz: allowed is inside limits.frequency_hz and up to a quarter of "
            f"sample_rate_hz, {0.25 * bench.sample_rate_hz:g} Hz"
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
        silent_s=SILENT_S if silent else 0.0,
        accepted_change=1.0,
    )


def next_level(bench: Bench, recorded: Recording, level: float) -> float | None:
    """The level to go on with; None where this one suffices, none would, or the run ended early."""
    end = recorded.parts[-1].end
    found = responses_in(recorded)
    if found is None or end is None or end["reason"] != EndReason.COMPLETED.name.lower():
        return None
    counted = [i for i, channel in enumerate(bench.channels) if channel.role != "monitor"]
    coherence = found.coherence[counted]
    hopeless = (coherence < DEAD) & (coherence.max() > CLEAR)
    if np.all((coherence >= ENOUGH) | hopeless):
        return None
    share = share_of_limits(bench, recorded)
    if not math.isfinite(share):
        return None
    rise = min(RISE, SAFE / share)
    return level * rise if rise > 1.2 else None


def share_of_limits(bench: Bench, recorded: Recording) -> float:
    """Largest peak of the last realisation against its limit, lost samples left out; inf where a channel has none left."""
    point = [point for point in recorded.latest.values() if "end_sample" in point][-1]
    rows = recorded.parts[-1].read(point["first_sample"], point["end_sample"])
    limits = bench.limits
    shares = [float(np.abs(rows["output_v"]).max()) / limits.voltage_v]
    lowest = 2.0 * math.pi * max(BAND[0] * bench.specimen.linear_frequency_hz, limits.frequency_hz[0])
    for index, channel in enumerate(bench.channels):
        if channel.role == "monitor":
            continue
        values = rows["inputs"][:, index].astype(float)
        values = values[np.isfinite(values)]
        if not values.size:
            return math.inf  # what was never seen may have been anything
        largest = float(np.abs(values - values.mean()).max())
        shares.append(largest / (limits.force_n if channel.role == "force" else limits.acceleration_m_s2))
        if channel.role != "force":  # as if all of it were at the lowest frequency, where it moves the farthest
            shares.append(largest / lowest**2 / limits.displacement_m)
    return max(shares)
