"""The plan that a tuning writes: TOML with comments on the origin of each number."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

from controller.tuning import PlantModel
from rig.bench import Bench
from rig.text.json_values import JsonValue
from rig.tuning.design import Chosen, gains_of, steepest_hardening
from rig.tuning.harmonics import HarmonicsChoice
from rig.tuning.levels import LevelChoice, significant
from rig.tuning.plant import ChannelRatios
from rig.tuning.shifts import Start, Window, ramp_periods, start_periods

HARMONICS = 5  # harmonics that are evaluated; chosen
AVERAGED_BITS = 30  # periods that the settle rule averages where rounding disturbs the force
MIN_TIMEOUT_PERIODS = 1000  # shortest time in which a point must settle, periods; chosen
LOST_PERIODS = 20  # at least
NEAR_LIMITS = 0.9  # of the limits: levels are given up there; chosen
GENTLE = 1.0  # largest slope that is written: only a vibration that runs away is beyond it
WAITING_DEG = 15.0  # error above which a ramp waits: the loops are quick


def plan_text(
    bench_name: str,
    bench: Bench,
    plant: PlantModel,
    measured: ChannelRatios,
    chosen: Chosen,
    levels: LevelChoice,
    ramp_factors: Sequence[float],
    start: Start,
    window: Window,
    harmonics: HarmonicsChoice | None,
    recording: Path,
) -> str:
    """Return a backbone plan as TOML."""
    settling = chosen.design.settling.longest
    lines = [
        *_summary(plant, chosen),
        *_levels(bench_name, bench, levels, chosen.law),
        *([] if chosen.law == "phase" else _start(plant, chosen, start)),
        *_ramps(plant, chosen, ramp_factors),
        *_rounding(levels),
        *_controller(plant, chosen, window),
        *([] if harmonics is None else _harmonics(harmonics)),
        *(_settle(settling, levels) if math.isfinite(settling) else []),
        *_measured_plant(plant, measured, recording),
    ]
    return "\n".join(lines) + "\n"


def plan_levels(levels: LevelChoice, law: str) -> list[float]:
    """Return the levels as a plan with this frequency law has them: V or m, peak."""
    return [significant(v) for v in levels.needed_v] if law == "phase" else list(levels.levels_m)


def _levels(bench_name: str, bench: Bench, levels: LevelChoice, law: str) -> list[str]:
    needed = f"the linear plant needs {levels.needed_v[0]:.3g} to {levels.needed_v[-1]:.3g} V, a nonlinear one may need more."
    return [
        _line("kind", "backbone"),
        _line("description", f"backbone of the {bench.specimen.name}, tuned by rig tune"),
        _line("bench", bench_name),
        *_comment(f"{levels.why[0].upper()}{levels.why[1:]}; {needed}"),
        _line("levels_v" if law == "phase" else "levels_m", plan_levels(levels, law)),
    ]


def _start(plant: PlantModel, chosen: Chosen, start: Start) -> list[str]:
    return [
        "# Voltage of the lowest level on the linear plant (before a trial), or less: the way there takes more force.",
        _line("start_v", significant(start.voltage_v, 4)),
        _line("start_ramp_periods", start.ramp_periods),
        "# Until vibration and frequency have come to rest there.",
        _line("start_periods", start_periods(plant, chosen.tracking_periods)),
    ]


def _ramps(plant: PlantModel, chosen: Chosen, factors: Sequence[float]) -> list[str]:
    longer = ["# Longer where the phase lagged in a trial.", _line("ramp_factors", list(factors))]
    return [
        "# Slow enough that force and frequency follow with the damping as measured.",
        _line("ramp_periods", ramp_periods(plant, chosen.tracking_periods)),
        *(longer if factors else []),
        "# A level that loses the lock, or comes near a limit, is left out, and those above it; one that loses it is tried",
        "# once more, by a slower ramp.",
        _line("on_lost_lock", "skip"),
        _line("lost_lock_attempts", 2),
        _line("near_limits", NEAR_LIMITS),
    ]


def _rounding(levels: LevelChoice) -> list[str]:
    out = []
    if levels.accepted_nonharmonic is not None:
        out += [
            "# Rounding of the output: lines away from the harmonics, which do not change frequency and damping.",
            _line("accepted_nonharmonic_force", significant(levels.accepted_nonharmonic, 2)),
        ]
    if levels.noise_shaping:
        out += [
            "# Errors of rounding are fed back, away from the frequency of the test.",
            _line("noise_shaping", True),
        ]
    return out


def _controller(plant: PlantModel, chosen: Chosen, window: Window) -> list[str]:
    hertz = plant.lock_frequency_rad_s() / (2.0 * math.pi)
    lost_periods = max(LOST_PERIODS, math.ceil(2.0 * chosen.tracking_periods))
    return [
        "",
        "[controller]",
        *_comment(f"{chosen.why}."),
        _line("detector", "adaptive"),
        _line("harmonics_followed", HARMONICS),
        _line("low_pass_rad_s", significant(chosen.low_pass_rad_s)),
        _line("frequency_law", chosen.law),
        *_gains(chosen),
        "# In a ramp the frequency changes with the level as from point to point before.",
        _line("frequency_feed_forward", True),
        *([] if chosen.law == "phase" else _slopes(chosen)),
        *_comment(f"Resonance of the structure alone as measured; {window.why}."),
        _line("centre_frequency_hz", significant(hertz, 6)),
        _line("frequency_window_hz", [window.lowest_hz, window.highest_hz]),
        "# A lock counts as lost if it has not returned within twice the time in which the frequency follows.",
        f"lock = {{ lost_periods = {lost_periods}, waiting_deg = {WAITING_DEG:g} }}",
    ]


def _settle(settling: float, levels: LevelChoice) -> list[str]:
    return [
        "",
        "[settle]",
        f"# Predicted for a step of 30 % in level or of half a bandwidth in frequency: {settling:.0f} periods.",
        _line("longest_periods", max(MIN_TIMEOUT_PERIODS, 100.0 * math.ceil(0.05 * settling))),
        *([] if levels.accepted_nonharmonic is None else [_line("average_periods", AVERAGED_BITS)]),
    ]


def _measured_plant(plant: PlantModel, measured: ChannelRatios, recording: Path) -> list[str]:
    out = [
        "",
        f"# The plant as measured ({recording.name}): gains and levels are checked against it before anything moves.",
        "[plant]",
        *(_line(key, value) for key, value in plant.to_dict().items()),
    ]
    if measured.ratios:
        out.append("# Motion of the response channels for that of the drive point, and standard errors.")
        for key, values in zip(("response_ratios", "response_ratio_stds", "response_turns_deg"), measured, strict=True):
            listed = ", ".join(f"{name} = {significant(value)}" for name, value in values.items())
            out += [f"{key} = {{ {listed} }}"] if values else []
    return out


def _slopes(chosen: Chosen) -> list[str]:
    hardening = min(steepest_hardening(chosen.design.loop), GENTLE)
    text = "Hardening, d ln(frequency)/d ln(level), that these gains bear, after the softening; a steeper backbone ends a ramp"
    return [
        *_comment(f"{text} ({GENTLE:g}: no bound is known)."),
        _line("steepest_backbone", [GENTLE, significant(hardening, 3)]),
    ]


def _harmonics(choice: HarmonicsChoice) -> list[str]:
    settings = choice.settings
    peaks = ", ".join(f"{peak:.2f} at {order}" for order, peak in choice.sensitivity_peaks.items())
    out = ["", "[controller.harmonics]", _line("highest", settings.highest)]
    if peaks:
        out += _comment(f"Stable on the measured force per volt with max |S| {peaks}.")
    for reason in choice.reasons:
        out += _comment(f"{reason[0].upper()}{reason[1:]}.")
    out.append(_line("integral", settings.integral))
    if settings.left_alone:
        out.append(_line("left_alone", list(settings.left_alone)))
    if settings.force_per_v:
        listed = ", ".join(f"{order} = [{re:g}, {im:g}]" for order, (re, im) in settings.force_per_v.items())
        out += ["# Force per volt at each harmonic, N/V, as measured.", f"force_per_v = {{ {listed} }}"]
    return out


def _summary(plant: PlantModel, chosen: Chosen) -> list[str]:
    margins, response = chosen.design.frequency_margins, chosen.design.amplitude_margins
    text = [
        f"# Structure: {plant.frequency_rad_s / 2.0 / math.pi:.6g} Hz, {100.0 * plant.damping_ratio:.4g} % damping, phi_d "
        f"{plant.drive_shape:.5g} kg^-1/2; coupled pole {plant.coupled_pole_rad_s.imag / 2.0 / math.pi:.6g} Hz.",
        f"# Frequency loop: max |S| {margins.sensitivity_peak:.2f}, gain margin {margins.gain_margin:.3g}, phase margin "
        f"{margins.phase_margin_deg:.0f} deg.",
    ]
    if response is not None:
        text.append(
            f"# Response loop: max |S| {response.sensitivity_peak:.2f}, gain margin {response.gain_margin:.3g}, phase margin "
            f"{response.phase_margin_deg:.0f} deg."
        )
    return text


COMMENTS = {
    "k1": "Proportional and integral gain of the phase error.",
    "frequency_integral_per_s": "Part of the low-pass, see above.",
    "response_integral_per_s": "Part of the low-pass, see above.",
    "plant_pole_rad_s": "Coupled pole less i times the resonance, as measured: the response loop cancels it.",
    "reference_integral_per_s": "For levels in newtons: as fast as the measured damping allows.",
    "drive_mode_shape": "As measured here, not from the bench.",
}


def _gains(chosen: Chosen) -> list[str]:
    out = [_line("force_loop", "through-response")] if chosen.law == "frequency-error" else []
    for key, value in gains_of(chosen).items():
        if key in COMMENTS:
            out.append(f"# {COMMENTS[key]}")
        if key == "plant_pole_rad_s" and chosen.cancels != 1.0:
            out.append("# Not exactly: a proportional gain other than the cancelling one tolerates more hardening.")
        out.append(_line(key, [significant(v) for v in value] if isinstance(value, tuple) else significant(value)))
    return out


def _comment(text: str) -> list[str]:
    return wrap(text, 118, initial_indent="# ", subsequent_indent="# ")


def _line(key: str, value: JsonValue) -> str:
    return f"{key} = {json.dumps(value)}"
