"""Rigs that no preset covers: ``rig tune``, then its plan, nothing by hand, against harmonic balance of the same rig.

- ``python -m benchmarks.random_rigs draw FOLDER --seed 1 -n 12`` writes bench files ``rig-<seed>.toml``, one seed each,
- ``python -m benchmarks.random_rigs run FOLDER [-j 2] [--timeout-s 900]`` tunes and tests those that have no result yet,
- ``python -m benchmarks.random_rigs table FOLDER [--json]`` shows what came of them.

Beams of three boundaries and given modes, 8 to 400 Hz, 0.05 to 3 % damping, shakers of 0.2 to 5 times the modal mass; springs,
stops, magnets and joints that shift the frequency by 1 to 14 % over the levels; blocks of 1 to 40 samples. The bench states
frequencies up to 2 % and mode shapes up to 30 % off. Limits are those that a laboratory would set from sensors and specimen.
Damping is as reported, with the mode shape that the tune has measured; the table also has it with the true one.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

ACCELEROMETERS = ((0.102, 49.0, 0.0005), (0.0102, 490.0, 0.002), (0.00102, 4900.0, 0.02))
"""Sensitivity, V/(m/s^2); range, m/s^2; noise, m/s^2 RMS. As data sheets of 1000, 100 and 10 mV/g state them."""
LOAD_CELLS = ((0.494, 9.79, 0.00009), (0.1124, 44.5, 0.00045), (0.01124, 444.8, 0.0045), (0.00225, 2224.0, 0.022))
"""Sensitivity, V/N; range, N; noise, N RMS. As data sheets of 2.2, 10, 100 and 500 lb state them."""
BOUNDARIES = {"clamped-free": 1.875104, "pinned-pinned": math.pi, "clamped-clamped": 4.730041}
SPAN = 30.0  # highest over lowest amplitude of the range whose shift of frequency is drawn
KINDS = ("cubic", "clearance", "magnet-one-sided", "magnet-symmetric", "jenkins", "iwan")
FREQUENCY_WITHIN, DAMPING_WITHIN = 5e-4, 0.02


class Draws:
    """Random numbers of one rig."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 19])

    def flat(self, low: float, high: float) -> float:
        """A number between two, all alike."""
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        """A number between two, all ratios alike."""
        return float(np.exp(self.rng.uniform(math.log(low), math.log(high))))

    def one_of(self, choices: Any) -> Any:
        """One of several."""
        return choices[int(self.rng.integers(len(choices)))]


def drawn(seed: int) -> dict[str, Any]:
    """Return the bench of a seed as a table; what cannot be built or computed is drawn again."""
    from pydantic import ValidationError

    from simulators.analysis import NotConvergedError

    draws = Draws(seed)
    for _ in range(50):
        try:
            bench = _drawn(draws)
        except (ValidationError, NotConvergedError, ValueError, ArithmeticError, StopIteration):
            continue
        if bench is not None:
            bench["name"] = f"rig-{seed}"
            return bench
    raise RuntimeError(f"seed {seed}: no rig in 50 draws")


def _drawn(draws: Draws) -> dict[str, Any] | None:
    from simulators import VirtualRig
    from simulators.analysis import phase_resonance_backbone

    hertz, damping = draws.log(8.0, 400.0), draws.log(0.0005, 0.03)
    omega = 2.0 * math.pi * hertz
    structure = _beam(draws, hertz, damping) if draws.flat(0, 1) < 0.5 else _modes(draws, hertz, damping)
    bare = _rig(structure, _shaker(draws, 1.0, hertz), _stinger(draws, 1.0, hertz), [], [])
    shapes = {at: float(VirtualRig.model_validate(bare).shape(at)[0]) for at in ("drive", "far")}
    if abs(shapes["drive"]) < 1e-3 or abs(shapes["far"]) < 1e-3:
        return None
    mass = draws.log(0.2, 5.0) / shapes["drive"] ** 2
    exciter, stinger = _shaker(draws, mass, hertz), _stinger(draws, mass, hertz)
    highest_m = min(draws.log(3.0, 150.0) / omega**2, 0.005)
    sites = 1 if draws.flat(0, 1) < 0.7 else 2
    elements: list[dict[str, Any]] = []
    joints: list[dict[str, Any]] = []
    for _ in range(sites):
        at, kind = draws.one_of(("drive", "far")), draws.one_of(KINDS)
        shift = draws.log(0.01, 0.14) / sites
        z = highest_m * abs(shapes[at] / shapes["drive"])
        part = _nonlinear(draws, kind, at, omega**2 / shapes[at] ** 2, z, shift)
        (joints if kind in ("jenkins", "iwan") else elements).append(part)
    table = _rig(structure, exciter, stinger, elements, joints)
    rig = VirtualRig.model_validate(table)
    mode = rig.linear_modes.nearest(hertz) if not elements else 0
    found = phase_resonance_backbone(
        rig,
        amplitudes_m=list(np.geomspace(highest_m / SPAN, highest_m, 8)),
        near_hz=float(rig.linear_modes.frequency_hz[mode]),
    )
    shift = found.modal_frequency_hz[-1] / found.modal_frequency_hz[0] - 1.0
    if not 0.01 <= abs(shift) <= 0.15 or np.max(found.damping_ratio) > 0.1 or np.any(found.flags):
        return None
    return _bench(draws, table, rig, mode, found, float(shift))


def _rig(structure: Any, exciter: Any, stinger: Any, elements: list[Any], joints: list[Any]) -> dict[str, Any]:
    sensor = {"name": "force", "kind": "force", "sensitivity_v_per_unit": 0.1, "range_v": 1e6}
    moving = [
        {"name": at, "kind": "acceleration", "at": at, "sensitivity_v_per_unit": 0.01, "range_v": 1e6}
        for at in ("drive", "far")
    ]
    return {
        "structure": structure,
        "elements": elements,
        "friction": joints,
        "exciter": exciter,
        "stinger": stinger,
        "sensors": [sensor, *moving],
        "converter": {"dac_range_v": 1e6, "sample_rate_hz": 10000.0, "substeps": 4},
    }


def _beam(draws: Draws, hertz: float, damping: float) -> dict[str, Any]:
    """A steel or aluminium beam whose first mode has a frequency; its length follows."""
    boundary = draws.one_of(tuple(BOUNDARIES))
    modulus, density = draws.one_of(((210e9, 7850.0), (70e9, 2700.0)))
    thickness = draws.log(0.002, 0.015)
    speed = math.sqrt(modulus / density) * thickness / math.sqrt(12.0)
    length = BOUNDARIES[boundary] * math.sqrt(speed / (2.0 * math.pi * hertz))
    far = 1.0 if boundary == "clamped-free" else draws.flat(0.45, 0.6)
    return {
        "kind": "beam",
        "boundary": boundary,
        "length_m": length,
        "width_m": draws.log(0.02, 0.06),
        "thickness_m": thickness,
        "youngs_modulus_pa": modulus,
        "density_kg_m3": density,
        "damping_ratio": [damping, draws.log(0.0005, 0.01), draws.log(0.0005, 0.01)],
        "points_m": {"drive": draws.flat(0.3, 0.6 if far == 1.0 else 0.42) * length, "far": far * length},
    }


def _modes(draws: Draws, hertz: float, damping: float) -> dict[str, Any]:
    """Three modes, the others from 2.2 times the first on, of a modal mass of 0.1 to 20 kg at the drive point."""
    second = hertz * draws.log(2.2, 6.0)
    shape = 1.0 / math.sqrt(draws.log(0.1, 20.0))
    sizes = [shape * draws.flat(0.3, 1.2) * draws.one_of((-1.0, 1.0)) for _ in range(4)]
    return {
        "kind": "modal",
        "frequency_hz": [hertz, second, second * draws.flat(1.6, 2.8)],
        "damping_ratio": [damping, draws.log(0.0005, 0.01), draws.log(0.0005, 0.01)],
        "shapes": {"drive": [shape, *sizes[:2]], "far": [shape * draws.flat(0.6, 2.5), *sizes[2:]]},
    }


def _shaker(draws: Draws, mass_kg: float, hertz: float) -> dict[str, Any]:
    """A shaker of an armature's mass; suspension, damping and coil in proportions of real ones."""
    own = 2.0 * math.pi * min(draws.log(5.0, 40.0), 1.5 * hertz)
    resistance = draws.flat(0.5, 3.0)
    return {
        "amplifier": "current" if draws.flat(0, 1) < 0.3 else "voltage",
        "armature_mass_kg": mass_kg,
        "suspension_stiffness_n_m": mass_kg * own**2,
        "suspension_damping_n_s_m": 2.0 * draws.flat(0.05, 0.2) * own * mass_kg,
        "force_factor_n_a": math.sqrt(mass_kg * draws.log(30.0, 150.0) * resistance),
        "resistance_ohm": resistance,
        "inductance_h": resistance * draws.log(5e-5, 2e-4),
    }


def _stinger(draws: Draws, mass_kg: float, hertz: float) -> dict[str, Any]:
    stiffness = mass_kg * (2.0 * math.pi * max(hertz * draws.flat(8.0, 20.0), 200.0)) ** 2
    return {"at": "drive", "stiffness_n_m": stiffness, "damping_n_s_m": 0.02 * math.sqrt(stiffness * mass_kg)}


def _nonlinear(draws: Draws, kind: str, at: str, modal_n_m: float, z: float, shift: float) -> dict[str, Any]:
    """A part whose equivalent stiffness at the amplitude z (m) shifts a mode of stiffness ``modal_n_m`` at its point."""
    wave = np.cos(2.0 * np.pi * (np.arange(720) + 0.5) / 720)

    def equivalent(force: Any) -> float:  # stiffness of the describing function
        return float(2.0 * np.mean(force * wave) / z)

    hardening = (1.0 + shift) ** 2 - 1.0
    if kind == "cubic":
        sign = draws.one_of((1.0, 1.0, -1.0))
        change = hardening if sign > 0.0 else 1.0 - (1.0 - shift) ** 2
        return {"kind": kind, "at": at, "stiffness_n_m3": sign * change * modal_n_m / (0.75 * z**2)}
    if kind == "clearance":
        gap = z / draws.log(1.3, 6.0)
        ways = {"other_gap_m": gap} if draws.flat(0, 1) < 0.5 else {}
        pressed = np.maximum(z * wave - gap, 0.0) - (np.maximum(-z * wave - gap, 0.0) if ways else 0.0)
        stiffness = hardening * modal_n_m / equivalent(pressed)
        return {"kind": kind, "at": at, "gap_m": gap, **ways, "contact_stiffness_n_m": stiffness}
    if kind.startswith("magnet"):
        gap = z / draws.flat(0.2, 0.6)
        other = gap + z * wave if kind == "magnet-symmetric" else np.full_like(wave, gap)
        linear = (8.0 if kind == "magnet-symmetric" else 4.0) / gap**5
        rise = equivalent((gap - z * wave) ** -4.0 - other**-4.0) - linear - hardening * linear
        if rise <= 0.0:
            raise ValueError("gap: this magnet cannot shift the frequency so far")
        return {"kind": kind, "at": at, "strength_n_m4": hardening * modal_n_m / rise, "gap_m": gap}
    stuck = modal_n_m * (1.0 - (1.0 - min(shift * draws.flat(1.2, 2.0), 0.25)) ** 2)
    if kind == "jenkins":
        slips = np.geomspace(draws.flat(0.03, 0.2), draws.flat(0.5, 1.2), 10) * z
        return {"kind": kind, "at": at, "stiffness": [stuck / 10.0] * 10, "slip": [float(slip) for slip in slips]}
    return {
        "kind": kind,
        "at": at,
        "stiffness_n_m": stuck,
        "phi_max_m": z * draws.flat(0.8, 3.0),
        "chi": draws.flat(-0.7, 0.3),
        "beta": draws.flat(0.05, 1.0),
        "n_element": 12,
    }


def _bench(draws: Draws, table: dict[str, Any], rig: Any, mode: int, found: Any, shift: float) -> dict[str, Any]:
    """Return the bench around a rig: converter, sensors, limits, and what the laboratory believes of the specimen."""
    hertz = float(rig.linear_modes.frequency_hz[mode])
    shapes = {at: float(rig.linear_modes.at(rig.shape(at))[mode]) for at in ("drive", "far")}
    ratio = abs(shapes["far"] / shapes["drive"])
    highest_hz = hertz * max(1.0 + shift, 1.0)
    rate = next(
        rate for rate in (1000.0, 2000.0, 5000.0, 10000.0, 20000.0) if rate >= highest_hz * draws.flat(30.0, 60.0)
    )
    block = int(min(draws.log(1.0, 40.99), max(0.5 * rate / hertz, 1.0)))
    top_m, top_n, top_v = float(found.amplitude_m[-1]), float(np.max(found.force_n)), float(np.max(found.voltage_v))
    top_m_s2 = top_m * (2.0 * math.pi * highest_hz) ** 2
    peak_n = float(np.max(np.abs(found.force_harmonics_n[:, 1:]).sum(axis=1)))
    cell = next(cell for cell in LOAD_CELLS if cell[1] >= draws.flat(5.0, 12.0) * max(top_n, peak_n / 2.0))
    meters = [
        next(meter for meter in ACCELEROMETERS if meter[1] >= draws.flat(4.0, 8.0) * part * top_m_s2)
        for part in (1.0, ratio)
    ]
    far = max(ratio, 1.0)
    voltage = draws.log(0.1, 2.0)  # at the highest amplitude
    table["exciter"]["amplifier_gain"] = top_v / voltage
    faster = int(max(2.0, math.ceil(5000.0 / rate)))
    table["converter"] = {
        "oversampling": faster,
        "substeps": 2 * faster,
        "anti_alias_hz": 0.4 * rate,
    }
    sheets = dict(zip(("force", "drive", "far"), (cell, *meters), strict=True))
    for sensor in table["sensors"]:
        sensitivity, reach, noise = sheets[sensor["name"]]
        sensor |= {"sensitivity_v_per_unit": sensitivity, "range_v": sensitivity * reach, "noise_rms": noise}
    believed = {at: abs(shape) * draws.flat(0.7, 1.3) for at, shape in shapes.items()}
    units = {"force": "N", "drive": "m/s^2", "far": "m/s^2"}
    roles = {"force": "force", "drive": "drive", "far": "response"}
    channels = [
        {"name": name, "role": roles[name], "unit": units[name], "sensitivity_v_per_unit": sheet[0]}
        | {"range_v": sheet[0] * sheet[1], "noise_rms": sheet[2]}
        | ({"mode_shape": believed["far"]} if name == "far" else {})
        for name, sheet in sheets.items()
    ]
    limits = {
        "voltage_v": min(voltage * draws.flat(2.0, 6.0), 9.5),
        "force_n": min(0.75 * cell[1], max(top_n, peak_n / 2.0) * draws.log(4.0, 30.0)),
        "acceleration_m_s2": min(0.75 * meters[0][1], 0.75 * meters[1][1], far * top_m_s2 * draws.flat(3.0, 6.0)),
        "displacement_m": far * top_m * draws.flat(2.4, 4.5),
        "frequency_hz": [0.3 * hertz, 4.0 * hertz],
    }
    return {
        "name": "",
        "description": f"drawn: {_words(table)}; {hertz:.4g} Hz, {100.0 * found.damping_ratio[0]:.3g} to "
        f"{100.0 * np.max(found.damping_ratio):.3g} %, {100.0 * shift:+.2f} %, shaker "
        f"{table['exciter']['armature_mass_kg'] * shapes['drive'] ** 2:.2g} modal masses, block {block}",
        "sample_rate_hz": rate,
        "block": block,
        "output_range_v": 10.0,
        "driver": {"name": "virtual", "options": table},
        "specimen": {
            "name": "drawn",
            "linear_frequency_hz": hertz * draws.flat(0.98, 1.02),
            "drive_mode_shape": believed["drive"],
        },
        "limits": limits,
        "channels": channels,
    }


def _words(table: dict[str, Any]) -> str:
    parts = [part["kind"] for key in ("elements", "friction") for part in table[key]]
    structure = table["structure"]
    return " and ".join([structure.get("boundary", "modes"), *parts])


def toml(table: dict[str, Any], path: tuple[str, ...] = ()) -> str:
    """Return a table of numbers, texts, lists and tables as TOML."""
    plain = {key: value for key, value in table.items() if not _is_table(value)}
    lines = [f"[{'.'.join(path)}]"] if path and plain else []
    lines += [f"{key} = {_value(value)}" for key, value in plain.items()]
    text = "\n".join(lines) + "\n" if lines else ""
    for key, value in table.items():
        if isinstance(value, dict):
            text += "\n" + toml(value, (*path, key))
        elif _is_table(value):
            for entry in value:
                inside = "\n".join(f"{name} = {_value(one)}" for name, one in entry.items())
                text += f"\n[[{'.'.join((*path, key))}]]\n{inside}\n"
    return text


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def _value(value: Any) -> str:
    return json.dumps(value)


def carried_out(bench_path: Path, folder: Path) -> dict[str, Any]:
    """Tune a bench, carry out the plan, and compare every point with harmonic balance."""
    import rig
    from rig.arming.run_options import RunOptions
    from rig.errors import RigError
    from rig.tuning import tune
    from rig.tuning.report import summary

    out: dict[str, Any] = {"rig": bench_path.stem}
    seed, name = int(bench_path.stem.split("-")[-1]), bench_path.stem
    began = time.perf_counter()
    try:
        tuned = tune(bench_path, folder / f"{name}-tune.h5", options=RunOptions(seed=seed, overwrite=True))
    except RigError as error:
        return out | {"refused": str(error), "tune_s": time.perf_counter() - began}
    plan = folder / f"{name}-plan.toml"
    plan.write_text(tuned.plan_toml, encoding="utf-8")
    found = summary(tuned)
    out |= {
        "tune_s": time.perf_counter() - began,
        "plant": found["plant"],
        "test": found["test"],
        "notes": found["notes"],
    }
    began = time.perf_counter()
    try:
        run = rig.run(plan, output=folder / f"{name}.h5", seed=seed + 1, overwrite=True)
    except RigError as error:
        return out | {"not_run": str(error)}
    with run:
        from rig.campaigns.evaluation.recorded import points_of

        end = run.recording.parts[-1].end
        points = points_of(run.recording)
        out |= {"run_s": time.perf_counter() - began, "end": end}
    out["levels"] = len(tuned.levels.levels_m)
    out |= _truth(tuned.bench, tuned.levels.levels_m)
    out["points"] = [_compared(tuned.bench, point) for point in points]
    return out


def _truth(bench: Any, levels_m: Any) -> dict[str, Any]:
    """The linear mode, and which of the plan's levels harmonic balance finds within the bench's limits."""
    from rig.analysis.subject import subject_of
    from simulators.analysis import NotConvergedError, phase_resonance_backbone

    subject = subject_of(bench)
    modes, mode = subject.rig.linear_modes, subject.mode
    try:
        levels = phase_resonance_backbone(subject.rig, amplitudes_m=list(levels_m), near_hz=subject.frequency_hz)
        exact = {
            "within": [bool(x) for x in subject.within(levels)],
            "level_frequency_hz": [float(x) for x in levels.frequency_hz],
            "level_damping": [float(x) for x in levels.damping_ratio],
            "level_v": [float(x) for x in levels.voltage_v],
            "level_n": [float(x) for x in levels.force_n],
        }
    except NotConvergedError as error:
        exact = {"within": [], "truth_failed": str(error)}
    linear = {
        "true_hz": float(modes.frequency_hz[mode]),
        "true_damping": float(modes.damping_ratio[mode]),
        "true_shape": float(modes.drive_shape[mode]),
    }
    return linear | exact


def _compared(bench: Any, point: Any) -> dict[str, Any]:
    from rig.analysis.subject import subject_of
    from simulators.analysis import NotConvergedError, phase_resonance_backbone

    out: dict[str, Any] = {
        "number": point.number,
        "level": point.level,
        "quality": str(point.quality),
        "reason": point.reason,
        "settle_periods": point.settle_periods if hasattr(point, "settle_periods") else None,
    }
    if not point.accepted:
        return out
    subject = subject_of(bench)
    shape = float(subject.rig.linear_modes.drive_shape[subject.mode])
    amplitude = float(point.vibration.amplitude_m)
    out |= {"amplitude_m": amplitude}
    try:
        path = list(np.geomspace(0.1 * amplitude, amplitude, 6))
        exact = phase_resonance_backbone(subject.rig, amplitudes_m=path, near_hz=subject.frequency_hz)
    except NotConvergedError as error:
        return out | {"truth_failed": str(error)}
    reported = float(point.modal.damping_ratio)
    used = point.modal.drive_mode_shape or float(bench.specimen.drive_mode_shape)
    true = float(exact.damping_ratio[-1])
    return out | {
        "frequency_error": float(point.modal.modal_frequency_hz) / float(exact.modal_frequency_hz[-1]) - 1.0,
        "damping_error": reported / true - 1.0,
        "damping_error_true_shape": reported * (shape / used) ** 2 / true - 1.0,
    }


def draw(folder: Path, first: int, count: int) -> None:
    """Write benches."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(first, first + count):
        path = folder / f"rig-{seed}.toml"
        if not path.exists():
            path.write_text(toml(drawn(seed)), encoding="utf-8")


def carry_out_all(folder: Path, jobs: int, timeout_s: float, only: list[str]) -> None:
    """Carry out the benches that have no result yet, each in a process of its own."""
    from joblib import Parallel, delayed

    def one(bench: Path) -> None:
        result = bench.with_suffix(".json")
        command = [sys.executable, "-m", "benchmarks.random_rigs", "one", str(bench)]
        try:
            done = subprocess.run(command, timeout=timeout_s, capture_output=True, text=True, check=False)
            failed = done.stderr.strip().splitlines()[-1] if done.returncode else ""
        except subprocess.TimeoutExpired:
            failed = f"not ended within {timeout_s:g} s"
        if failed:
            result.write_text(json.dumps({"rig": bench.stem, "failed": failed}), encoding="utf-8")

    wanted = sorted(folder.glob("rig-*.toml"), key=lambda path: (len(path.stem), path.stem))
    benches = [path for path in wanted if path.stem.removeprefix("rig-").isdigit()]
    benches = [path for path in benches if not path.with_suffix(".json").exists() and (not only or path.stem in only)]
    Parallel(n_jobs=jobs, backend="threading")(delayed(one)(bench) for bench in benches)


def outcome(found: dict[str, Any]) -> str:
    """What came of a rig, in a word or two."""
    for key in ("failed", "refused", "not_run"):
        if key in found:
            return {"failed": "failed", "refused": "tune refused", "not_run": "plan refused"}[key]
    accepted = sum("amplitude_m" in point for point in found["points"])
    if accepted == found["levels"]:
        return "all accepted"
    end = found["end"] or {"reason": "none"}
    return "some refused" if end["reason"] == "completed" else f"ended: {end['reason']}"


def table(folder: Path) -> dict[str, Any]:
    """Return results, one entry per rig, and what they come to."""
    paths = sorted(folder.glob("rig-*.json"), key=lambda path: (len(path.stem), path.stem))
    rigs = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    points = [point for found in rigs for point in found.get("points", []) if "frequency_error" in point]
    return {
        "rigs": rigs,
        "outcomes": dict(Counter(outcome(found) for found in rigs)),
        "points": len(points),
        "errors": {
            name: _spread([abs(point[name]) for point in points], bound)
            for name, bound in (
                ("frequency_error", FREQUENCY_WITHIN),
                ("damping_error", DAMPING_WITHIN),
                ("damping_error_true_shape", DAMPING_WITHIN),
            )
        },
    }


def _spread(values: list[float], bound: float) -> dict[str, float]:
    if not values:
        return {"median": math.nan, "largest": math.nan, "within": math.nan}
    inside = sum(value <= bound for value in values) / len(values)
    return {"median": statistics.median(values), "largest": max(values), "within": inside, "bound": bound}


def show(folder: Path, verbose: bool) -> None:
    """Print the table."""
    found = table(folder)
    for one in found["rigs"]:
        bench = folder / f"{one['rig']}.toml"
        words = next((line for line in bench.read_text().splitlines() if line.startswith("description")), "")
        print(f"{one['rig']}: {outcome(one)}; {words.removeprefix('description = ')[8:-1]}")
        if "refused" in one or "failed" in one or "not_run" in one:
            print("   ", one.get("refused", one.get("failed", one.get("not_run"))))
            continue
        plant = one["plant"]
        shifts = one.get("level_frequency_hz", [math.nan])
        print(
            f"    tune {plant['frequency_hz'] / one['true_hz'] - 1.0:+.2%}, damping {100.0 * plant['damping_ratio']:.3g} of "
            f"{100.0 * one['true_damping']:.3g} %, phi {plant['drive_mode_shape'] / one['true_shape'] - 1.0:+.1%}, fit "
            f"{plant['fit_error']:.2%}, distortion {one['test']['distortion']:.2%}; "
            f"{one['tune_s']:.0f} s + {one['run_s']:.0f} s; levels shift "
            f"{shifts[-1] / shifts[0] - 1.0:+.2%}, within {sum(one['within'])} of {one['levels']}"
        )
        end = one["end"]
        if end and end["reason"] != "completed":
            print(f"    end: {end['text']}")
        for point in one["points"]:
            if "frequency_error" in point and not verbose:
                continue
            errors = (
                f"f {point['frequency_error']:+.4%}, D {point['damping_error']:+.1%}, with true phi "
                f"{point['damping_error_true_shape']:+.2%}"
                if "frequency_error" in point
                else ""
            )
            print(f"    {point['number']} {point['level']:.3g} {point['quality']} {point['reason'][:200]} {errors}")
        worst = [point for point in one["points"] if "frequency_error" in point]
        if worst:
            print(
                f"    worst f {max(abs(p['frequency_error']) for p in worst):.4%}, D "
                f"{max(abs(p['damping_error']) for p in worst):.1%}, with true phi "
                f"{max(abs(p['damping_error_true_shape']) for p in worst):.2%}"
            )
    print(found["outcomes"], f"{len(found['rigs'])} rigs, {found['points']} points accepted")
    for name, values in found["errors"].items():
        print(f"{name}: " + ", ".join(f"{key} {value:.3%}" for key, value in values.items()))


def main() -> None:
    """Entry."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    drawing = commands.add_parser("draw", help="write bench files")
    drawing.add_argument("--seed", type=int, default=1)
    drawing.add_argument("-n", type=int, default=12)
    running = commands.add_parser("run", help="tune and test every bench without a result")
    running.add_argument("-j", "--jobs", type=int, default=1, choices=(1, 2))
    running.add_argument("--timeout-s", type=float, default=900.0)
    running.add_argument("--only", action="append", default=[])
    showing = commands.add_parser("table", help="show the results")
    showing.add_argument("--json", action="store_true")
    showing.add_argument("-v", "--verbose", action="store_true")
    for command in (drawing, running, showing):
        command.add_argument("folder", type=Path)
    one = commands.add_parser("one", help="tune and test one bench")
    one.add_argument("bench", type=Path)
    asked = parser.parse_args()
    if asked.command == "draw":
        draw(asked.folder, asked.seed, asked.n)
    elif asked.command == "run":
        carry_out_all(asked.folder, asked.jobs, asked.timeout_s, asked.only)
    elif asked.command == "one":
        result = carried_out(asked.bench, asked.bench.parent)
        asked.bench.with_suffix(".json").write_text(json.dumps(result, default=float), encoding="utf-8")
    elif asked.json:
        print(json.dumps(table(asked.folder)))
    else:
        show(asked.folder, asked.verbose)


if __name__ == "__main__":
    main()
