"""Report of a tuning, as JSON and as lines for the terminal."""

import math
from dataclasses import asdict

from controller.tuning import Design
from rig.text.json_values import JsonValue
from rig.tuning.design import gains_of
from rig.tuning.harmonics import HarmonicsChoice
from rig.tuning.longer_ramps import ramp_factors
from rig.tuning.plant import mass_ratios
from rig.tuning.trial import PlanTrial
from rig.tuning.tuning import Tuning

SHOWN_SHIFT = 0.05  # shift of the frequency for which the slope of a cubic spring is given; chosen


def summary(tuning: Tuning) -> dict[str, JsonValue]:
    """Return test, plant, gains, margins, levels and notes as a dictionary for JSON."""
    plant, chosen, test = tuning.plant, tuning.chosen, tuning.test
    low, high = mass_ratios(tuning.bench, test.responses, plant)
    facts = tuning.bench.specimen
    return {
        "kind": "tuning",
        "bench": tuning.bench.name,
        "specimen": facts.name,
        "recording": str(tuning.recording),
        "test": {
            "level_rms_v": test.level_rms_v,
            "levels_tried_v": list(test.levels_tried_v),
            "coherence_force": test.coherence[0],
            "coherence_drive": test.coherence[1],
            "distortion": test.distortion,
        },
        "plant": {
            "frequency_hz": plant.frequency_rad_s / (2.0 * math.pi),
            "bench_frequency_hz": facts.linear_frequency_hz,
            "frequency_std_hz": None
            if plant.frequency_std_rad_s is None
            else plant.frequency_std_rad_s / (2.0 * math.pi),
            "damping_ratio": plant.damping_ratio,
            "damping_ratio_std": plant.damping_ratio_std,
            "drive_mode_shape": plant.drive_shape,
            "drive_mode_shape_std": plant.drive_shape_std,
            "bench_drive_mode_shape": facts.drive_mode_shape,
            "coupled_pole_hz": plant.coupled_pole_rad_s.imag / (2.0 * math.pi),
            "coupled_damping_ratio": -plant.coupled_pole_rad_s.real / abs(plant.coupled_pole_rad_s),
            "pole_offset_rad_s": [plant.pole_offset_rad_s().real, plant.pole_offset_rad_s().imag],
            "mass_ratio": [low, high],
            "force_per_v_n": 1.0 / plant.volts_per_newton(),
            "fit_error": plant.fit_error,
            "response_ratios": dict(tuning.response_ratios),
            "response_ratio_stds": dict(tuning.response_ratio_stds),
            "response_turns_deg": dict(tuning.response_turns_deg),
        },
        "law": chosen.law,
        "low_pass_rad_s": chosen.low_pass_rad_s,
        "gains": {k: list(v) if isinstance(v, tuple) else v for k, v in gains_of(chosen).items()},
        "why": chosen.why,
        "closed_form": {
            "k1": chosen.closed_form.law.proportional_per_s,
            "k2": chosen.closed_form.law.integral_per_s2,
            "failed": list(chosen.closed_form.failed),
        },
        "designs": [_design(design) for design in (chosen.design, *chosen.others)],
        "gain_at_other_modes": {"gain": chosen.outside[0], "frequency_hz": chosen.outside[1]},
        "slopes": list(chosen.slopes),
        "levels_m": list(tuning.levels.levels_m),
        "needed_v": list(tuning.levels.needed_v),
        "levels_why": tuning.levels.why,
        "harmonics": _harmonics(tuning.harmonics),
        "trials": [_trial(trial) for trial in tuning.trials],
        "notes": list(tuning.notes),
    }


def _trial(trial: PlanTrial) -> dict[str, JsonValue]:
    return {
        "recording": str(trial.recording),
        "accepted": trial.accepted,
        "points": len(trial.points),
        "held": list(trial.held),
        "missing": trial.missing,
        "end": trial.end,
        "tripped": trial.tripped,
    }


def _design(design: Design) -> dict[str, JsonValue]:
    return {
        "damping_ratio": design.loop.plant.damping_ratio,
        "stable": design.stable,
        "frequency_loop": asdict(design.frequency_margins),
        "response_loop": None if design.amplitude_margins is None else asdict(design.amplitude_margins),
        "settling_periods": asdict(design.settling),
        "reasons": list(design.reasons),
    }


def _harmonics(choice: HarmonicsChoice | None) -> dict[str, JsonValue] | None:
    if choice is None:
        return None
    return {
        "highest": choice.settings.highest,
        "integral": choice.settings.integral,
        "left_alone": list(choice.settings.left_alone),
        "force_per_v": {str(order): list(value) for order, value in choice.settings.force_per_v.items()},
        "sensitivity_peaks": {str(order): peak for order, peak in choice.sensitivity_peaks.items()},
        "reasons": list(choice.reasons),
    }


def lines(tuning: Tuning) -> list[str]:
    """Return lines of text on a tuning."""
    test, plant, chosen, specimen = tuning.test, tuning.plant, tuning.chosen, tuning.bench.specimen
    low, high = mass_ratios(tuning.bench, test.responses, plant)
    shape, pole = specimen.drive_mode_shape, plant.coupled_pole_rad_s
    std_hz = None if plant.frequency_std_rad_s is None else plant.frequency_std_rad_s / (2.0 * math.pi)
    out = [
        f"{specimen.name} (bench {tuning.bench.name}), tuned",
        f"multisine      {test.level_rms_v:.4g} V RMS, coherence {test.coherence[0]:.5f} (force) and "
        f"{test.coherence[1]:.5f} (drive), distortion {100.0 * test.distortion:.2g} %",
        f"structure      {plant.frequency_rad_s / (2.0 * math.pi):.3f}{_bound(std_hz)} Hz (bench "
        f"{specimen.linear_frequency_hz:g}), damping {100.0 * plant.damping_ratio:.3f}"
        f"{_bound(plant.damping_ratio_std, 100.0)} %, phi_d {plant.drive_shape:.4f}"
        f"{_bound(plant.drive_shape_std)} kg^-1/2 (bench {'none' if shape is None else format(shape, 'g')})",
        f"with exciter   {pole.imag / (2.0 * math.pi):.3f} Hz, damping {-100.0 * pole.real / abs(pole):.2f} %, mass ratio "
        + (f"{low:.3f}" if high - low < 0.2 * abs(high) else f"could not be identified ({low:.3f} to {high:.3f})")
        + f", {1.0 / plant.volts_per_newton():.3g} N/V at resonance; model within {100.0 * plant.fit_error:.2g} %",
        f"law            {chosen.law}: {chosen.why}",
        *(
            f"  {name} = {', '.join(f'{v:.5g}' for v in (value if isinstance(value, tuple) else (value,)))}"
            for name, value in gains_of(chosen).items()
        ),
    ]
    closed = chosen.closed_form
    out.append(
        f"closed form    K1 = {closed.law.proportional_per_s:.4g} 1/s, K2 = {closed.law.integral_per_s2:.4g} 1/s^2"
        + (f"; does not apply: {'; '.join(closed.failed)}" if closed.failed else "; its assumptions hold")
    )
    softening, hardening = chosen.slopes
    out.append(
        f"slopes         d ln(frequency)/d ln(amplitude) from {-softening:.3g} to {hardening:+.3g} leave the loops stable; a "
        f"cubic spring that has shifted the frequency by {100.0 * SHOWN_SHIFT:g} % has {2.0 * SHOWN_SHIFT:g}"
    )
    out += [line for design in (chosen.design, *chosen.others) for line in _design_lines(design)]
    levels_m, needed_v = tuning.levels.levels_m, tuning.levels.needed_v
    out.append(
        f"levels         {1e3 * levels_m[0]:.3g} to {1e3 * levels_m[-1]:.3g} mm in {len(levels_m)} steps, {needed_v[0]:.3g} to "
        f"{needed_v[-1]:.3g} V on the linear plant; {tuning.levels.why}"
    )
    out += [
        f"{'trial' if number == 0 else 'tried again':14} {_held(trial)}" for number, trial in enumerate(tuning.trials)
    ]
    if tuning.harmonics is not None:
        settings, found = tuning.harmonics.settings, tuning.harmonics.sensitivity_peaks
        peaks = ", ".join(f"{peak:.2f} at {order}" for order, peak in found.items()) or "unknown"
        out.append(f"harmonics      2 to {settings.highest}, integral = {settings.integral:g}, max |S| {peaks}")
        out += [f"  {reason}" for reason in tuning.harmonics.reasons]
    return [*out, *(f"note: {note}" for note in tuning.notes)]


def _held(trial: PlanTrial) -> str:
    """What a trial has held, in a line."""
    held, missing = trial.held, trial.missing
    kept = "all levels were held" if not missing else f"levels {held[0] + 1} to {held[-1] + 1} were held; {missing}"
    longer = ramp_factors(trial.ramps, [point.level for point in trial.points])
    lagged = f"; ramps lagged by up to {max(ramp.error_deg for ramp in trial.ramps):.0f} deg" if longer else ""
    return f"{kept}{'; it tripped' if trial.tripped else ''}{lagged}"


def _design_lines(design: Design) -> list[str]:
    periods = design.settling.longest
    out = [
        f"with {100.0 * design.loop.plant.damping_ratio:.3g} % damping: settles within {periods:.0f} periods (predicted)"
    ]
    for name, margins in (("frequency loop", design.frequency_margins), ("response loop", design.amplitude_margins)):
        if margins is not None:
            out.append(
                f"  {name:14} max |S| {margins.sensitivity_peak:.2f}, gain margin {margins.gain_margin:.2f}, phase margin "
                f"{margins.phase_margin_deg:.0f} deg"
            )
    return [*out, *(f"  {reason}" for reason in design.reasons)]


def _bound(std: float | None, scale: float = 1.0) -> str:
    """Return the 95 % bound of a standard error, as a text to follow a number."""
    return "" if std is None else f" +- {1.96 * scale * std:.2g}"
