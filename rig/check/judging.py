"""Findings from the driven part of a check: dead, reversed, swapped or delayed channels, and channels of wrong size."""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import NDArray

from rig.bench import Bench
from rig.check.findings import Finding, Verdict, graded, not_tested
from rig.check.responses import BAND, MAX_MISFIT, Mode, Responses, fit_mode
from vibrolock.arrays import Float

MIN_LOG_RATIO = 0.03  # log ratio below which two channels cannot be distinguished; chosen
MAX_REMAINING = 0.5  # largest misfit of another assignment over that of the channels as wired; chosen
DOUBTFUL_LOG_RATIO = 0.05  # RMS log ratio above which the wiring is in doubt; chosen


def by_magnitude(found: Float, expected: Float) -> Float:
    """Cost [n, n] of identifying channel i with channel j: squared log ratio of their sizes [n] in sensor volts."""
    return np.asarray((np.log(found)[:, None] - np.log(expected)[None, :]) ** 2)


def by_shape(found: NDArray[np.complex128], expected: NDArray[np.complex128]) -> Float:
    """Cost [n, n] of identifying response i with response j: mean squared log ratio of their sizes over all lines.

    Both arguments are [n, n_lines].
    """
    sizes, known = np.log(np.abs(found)), np.log(np.abs(expected))
    return np.asarray(np.mean((sizes[:, None] - known[None]) ** 2, axis=-1))


def best_assignment(cost: Float) -> tuple[int, ...] | None:
    """Return the assignment of channels that fits far better than the declared wiring; None if there is none."""
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    as_wired, best = float(np.mean(np.diag(cost))), float(np.mean(cost[rows, columns]))
    if as_wired < DOUBTFUL_LOG_RATIO**2 or best > MAX_REMAINING**2 * as_wired or np.array_equal(rows, columns):
        return None
    return tuple(int(column) for column in columns)


MAX_DELAY_SAMPLES = 0.25  # largest delay beyond the driver's latency, samples; chosen


def latency_findings(bench: Bench, responses: Responses, delay_fraction: float) -> list[Finding]:
    """Measure the delay of each loopback beyond the latency that the driver reports, from its phase slope over the band.

    ``delay_fraction`` is the fraction of a sample by which the rows' outputs and inputs are not aligned.
    """
    omega, allowed = 2.0 * math.pi * responses.frequency_hz / bench.sample_rate_hz, f"+-{MAX_DELAY_SAMPLES:g}"
    out = []
    for channel, value in zip(bench.channels, responses.per_volt, strict=True):
        if channel.loopback:
            phase = np.unwrap(np.angle(value))
            late = -float(np.polyfit(omega, phase, 1, w=np.abs(value))[0]) - delay_fraction
            bad = abs(late) > MAX_DELAY_SAMPLES
            text = "more than the driver says: its queue or filter delay, or this channel's skew_samples" if bad else ""
            out.append(Finding("latency", channel.name, "fail" if bad else "ok", late, "samples", allowed, text))
    return out or [not_tested("latency", "no channel is declared with loopback = true")]


MIN_COHERENCE, GOOD_COHERENCE = 0.5, 0.98  # coherence below which a channel is dead, and from which it is good; chosen
MIN_POWER = 0.5  # least net power over the absolute power, for a verdict on its direction; chosen
SIZE_OK, SIZE_TOLERATED = (0.9, 1.1), (0.67, 1.5)
"""Sizes of a response over the expected one, without and with a warning; chosen."""
FREQUENCY_OK, FREQUENCY_TOLERATED = (0.98, 1.02), (0.9, 1.1)
"""Frequencies of the mode over that of the bench, without and with a warning; chosen."""
MAX_ROTATION_DEG = 3.0  # largest phase of a residue off its real value, deg; chosen
MAX_DISTORTION = 0.05  # distortion above which there is a warning; chosen


def driven_findings(bench: Bench, responses: Responses) -> tuple[list[Finding], Mode | None]:
    """Return the findings from the responses and the bench's facts, and the mode under test."""
    coherences = _coherence(bench, responses)
    dead = {finding.channel for finding in coherences if finding.verdict == "fail"}
    out = [*coherences, *_distortion(bench, responses, dead)]
    force, drive = bench.index_of("force"), bench.index_of("drive")
    names, linear_hz = responses.names, bench.specimen.linear_frequency_hz
    if names[force] in dead or names[drive] in dead:
        return [*out, not_tested("power", "force or drive channel is dead", names[drive])], None
    accelerations = [drive, *(i for i, channel in enumerate(bench.channels) if channel.role == "response")]
    alive = [i for i in accelerations if names[i] not in dead]
    mode = fit_mode(responses.frequency_hz, responses.per(force)[alive], linear_hz)
    out.append(_power(bench, responses))
    verdict = "fail" if mode is None else graded(mode.frequency_hz / linear_hz, FREQUENCY_OK, FREQUENCY_TOLERATED)
    if mode is None or mode.misfit > MAX_MISFIT or verdict == "fail":
        text = (
            "the accelerations per force show no single mode near specimen.linear_frequency_hz: force and drive swapped, "
            "another specimen, or wrong facts"
        )
        value = None if mode is None else mode.frequency_hz
        low, high = (part * linear_hz for part in FREQUENCY_TOLERATED)
        return [*out, Finding("frequency", "", "fail", value, "Hz", f"{low:.4g} to {high:.4g}", text)], None
    text = "" if verdict == "ok" else "correct specimen.linear_frequency_hz, or see what has changed"
    low, high = (part * linear_hz for part in FREQUENCY_OK)
    out.append(Finding("frequency", "", verdict, mode.frequency_hz, "Hz", f"{low:.4g} to {high:.4g}", text))
    out += _shapes(bench, responses, alive, mode)
    return [*out, *_delays(bench, alive, mode)], mode


def _coherence(bench: Bench, responses: Responses) -> list[Finding]:
    out = []
    for channel, value in zip(bench.channels, responses.coherence, strict=True):
        if channel.role == "monitor" and not channel.loopback:
            continue
        verdict = graded(float(value), (GOOD_COHERENCE, 1.0), (MIN_COHERENCE, 1.0))
        text = {"ok": "", "warn": "much noise in addition to the excitation: a loose cable, or a level too low"}.get(
            verdict, "does not follow the excitation: sensor, cable or supply is dead"
        )
        out.append(Finding("life", channel.name, verdict, float(value), "coherence", f"from {GOOD_COHERENCE:g}", text))
    return out


def _distortion(bench: Bench, responses: Responses, dead: set[str]) -> list[Finding]:
    """Judge the distortion of the force, which reveals a clipping amplifier or a nonlinear specimen."""
    index = bench.index_of("force")
    name, value = responses.names[index], float(responses.distortion[index])
    if name in dead:
        return []
    bad = value > MAX_DISTORTION
    text = (
        "there is a response at lines that were not excited: amplifier clipping, a rattle, or a very nonlinear specimen"
        if bad
        else ""
    )
    return [Finding("distortion", name, "warn" if bad else "ok", value, "", f"up to {MAX_DISTORTION:g}", text)]


def _power(bench: Bench, responses: Responses) -> Finding:
    """Judge the direction of the power: into a passive structure, the mean of force times velocity is positive."""
    force, drive = bench.index_of("force"), bench.index_of("drive")
    part = responses.frequency_hz / bench.specimen.linear_frequency_hz
    around = (part > BAND[0]) & (part < BAND[1])
    velocity = responses.per_volt[drive] / (2j * math.pi * responses.frequency_hz)
    power = np.real(responses.per_volt[force].conj() * velocity)[around]
    share = float(power.sum() / max(np.abs(power).sum(), 1e-300))
    verdict: Verdict = "ok" if share >= MIN_POWER else "warn" if share > -MIN_POWER else "fail"
    text = {
        "warn": "goes in at some frequencies and out at others: the drive channel is not at the drive point",
        "fail": "power comes out of the specimen: force or drive is reversed, or the two are swapped",
    }.get(verdict, "")
    return Finding("power", responses.names[drive], verdict, share, "into specimen", f"from {MIN_POWER:g}", text)


def _shapes(bench: Bench, responses: Responses, alive: Sequence[int], mode: Mode) -> list[Finding]:
    """Judge sizes, signs and places of the accelerations by the mode shape in the bench."""
    drive_shape = bench.specimen.drive_mode_shape
    names, channels = list(responses.names), bench.channels
    if drive_shape is None:
        return [not_tested("place", "the bench has no drive_mode_shape to compare with; a reference check would do")]
    shapes = {
        i: drive_shape if channels[i].role == "drive" else shape
        for i in alive
        if channels[i].role == "drive" or (shape := channels[i].mode_shape) is not None
    }
    known = [i for i in alive if shapes.get(i)]
    residues = np.array([mode.residue[alive.index(i)] for i in known])
    expected = drive_shape * np.array([shapes[i] or 0.0 for i in known])
    volts = np.array([abs(channels[i].sensitivity_v_per_unit) for i in known])
    swapped = best_assignment(by_magnitude(np.abs(residues) * volts, np.abs(expected) * volts))
    text = "the bench has no mode_shape of it to compare with; a reference check would do"
    out = [not_tested("place", text, names[i]) for i in alive if i not in known]
    names = [names[i] for i in known]
    if swapped is not None:
        return [*out, *_misplaced(names, swapped)]
    out += _look_alike(names, np.abs(expected))
    out += _polarities(bench, names, np.sign(residues.real * expected))
    text = "per force, against the mode's shape: a sensitivity, its place, or the shape is wrong"
    ratios = np.abs(residues / expected).tolist()
    return [*out, *(sized("size", n, r, "of expected", text) for n, r in zip(names, ratios, strict=True))]


def _polarities(bench: Bench, names: Sequence[str], signs: Float) -> list[Finding]:
    """Judge the signs of the accelerations relative to the force. If most are wrong, the force is reversed."""
    force = bench.channels[bench.index_of("force")].name
    turned = len(names) > 2 and int(np.sum(signs < 0.0)) > len(names) / 2
    against = signs > 0.0 if turned else signs < 0.0
    unsure = "" if len(names) > 2 else ", or the force is"
    whys = (" against the accelerations", *(unsure for _ in names))
    out = []
    for name, wrong, why in zip((force, *names), (turned, *against), whys, strict=True):
        text = f"reversed{why}: turn the sign of its sensitivity" if wrong else ""
        out.append(Finding("polarity", name, "fail" if wrong else "ok", -1.0 if wrong else 1.0, "sign", "1", text))
    return out


def _misplaced(names: Sequence[str], swapped: tuple[int, ...]) -> list[Finding]:
    out = []
    for place, (name, really) in enumerate(zip(names, swapped, strict=True)):
        if place != really:
            who = "the two" if swapped[really] == place else "channels"
            out.append(Finding("place", name, "fail", text=f"reads what {names[really]} should: {who} are swapped"))
    return out


def _look_alike(names: Sequence[str], expected: Float) -> list[Finding]:
    text = "moves like {other} in this mode: only a reference check can show whether the two are swapped"
    return [
        not_tested("place", text.format(other=names[i]), names[j])
        for i, j in combinations(range(len(names)), 2)
        if abs(math.log(expected[i] / expected[j])) < MIN_LOG_RATIO
    ]


def sized(name: str, channel: str, ratio: float, unit: str, text: str) -> Finding:
    """Judge the size of a response over the expected one; ``text`` says what to do unless it is ok."""
    verdict = graded(ratio, SIZE_OK, SIZE_TOLERATED)
    allowed = f"{SIZE_OK[0]:g} to {SIZE_OK[1]:g}"
    return Finding(name, channel, verdict, ratio, unit, allowed, "" if verdict == "ok" else text)


def _delays(bench: Bench, alive: Sequence[int], mode: Mode) -> list[Finding]:
    """Judge the delay of each channel behind the force by the phase of its residue (0 or 180 degrees for a normal mode)."""
    out = []
    for place, i in enumerate(alive):
        residue = complex(mode.residue[place])
        turn = math.degrees(math.atan(residue.imag / residue.real)) if residue.real else 90.0
        samples = -turn / 360.0 / mode.frequency_hz * bench.sample_rate_hz
        late = abs(turn) > MAX_ROTATION_DEG
        text = f"{samples:+.2f} samples behind the force more than skew_samples says" if late else ""
        name = bench.channels[i].name
        out.append(Finding("skew", name, "warn" if late else "ok", turn, "deg", f"+-{MAX_ROTATION_DEG:g}", text))
    return out
