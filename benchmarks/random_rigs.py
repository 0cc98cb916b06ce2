"""Rigs that no preset covers: ``rig tune``, then its plan, nothing by hand, against harmonic balance of the same rig.

- ``python -m benchmarks.random_rigs draw FOLDER --seed 1 --n 12`` writes bench files ``rig-<seed>.toml``, one seed each,
- ``python -m benchmarks.random_rigs run FOLDER [--jobs 2] [--timeout-s 900]`` tunes and tests those that have no result yet,
- ``python -m benchmarks.random_rigs table FOLDER [--json]`` shows what came of them.

Beams of three boundaries and given modes, 8 to 400 Hz, 0.05 to 3 % damping, shakers of 0.2 to 5 times the modal mass; springs,
stops, magnets and joints that shift the frequency by 1 to 14 % over the levels; blocks of 1 to 40 samples. The bench states
frequencies up to 2 % and mode shapes up to 30 % off. Limits are those that a laboratory would set from sensors and specimen.
Damping is as reported, with the mode shape that the tune has measured; the table also has it with the true one.
"""

import json
import math
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import typer
from joblib import Parallel, delayed
from pydantic import ValidationError

import rig
from rig.analysis.subject import subject_of
from rig.arming.run_options import RunOptions
from rig.bench import Bench, load_bench
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.recorded import points_of
from rig.errors import RigError
from rig.text.console import print_json
from rig.tuning import tune
from rig.tuning.report import summary
from simulators import VirtualRig
from simulators.analysis import NotConvergedError, phase_resonance_backbone

ACCELEROMETERS = ((0.102, 49.0, 0.0005), (0.0102, 490.0, 0.002), (0.00102, 4900.0, 0.02))
"""Sensitivity, V/(m/s^2); range, m/s^2; noise, m/s^2 RMS. As data sheets of 1000, 100 and 10 mV/g state them."""
LOAD_CELLS = ((0.494, 9.79, 0.00009), (0.1124, 44.5, 0.00045), (0.01124, 444.8, 0.0045), (0.00225, 2224.0, 0.022))
"""Sensitivity, V/N; range, N; noise, N RMS. As data sheets of 2.2, 10, 100 and 500 lb state them."""
BOUNDARIES = {"clamped-free": 1.875104, "pinned-pinned": math.pi, "clamped-clamped": 4.730041}
STEPS_TO_A_POINT = 18  # of harmonic balance from a tenth of its amplitude: with six another solution was met once
SPAN = 30.0  # highest over lowest amplitude of the range whose shift of frequency is drawn
KINDS = ("cubic", "clearance", "magnet-one-sided", "magnet-symmetric", "jenkins", "iwan")
WITHIN = {"frequency_error": 5e-4, "damping_error": 0.02, "damping_error_true_shape": 0.02}
"""Bounds of the errors of a point, relative."""


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
    virtual = VirtualRig.model_validate(table)
    mode = virtual.linear_modes.nearest(hertz) if not elements else 0
    found = phase_resonance_backbone(
        virtual,
        amplitudes_m=list(np.geomspace(highest_m / SPAN, highest_m, 8)),
        near_hz=float(virtual.linear_modes.frequency_hz[mode]),
    )
    shift = found.modal_frequency_hz[-1] / found.modal_frequency_hz[0] - 1.0
    if not 0.01 <= abs(shift) <= 0.15 or np.max(found.damping_ratio) > 0.1 or np.any(found.flags):
        return None
    return _bench(draws, table, virtual, mode, found, float(shift))


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


def _bench(
    draws: Draws, table: dict[str, Any], virtual: VirtualRig, mode: int, found: Any, shift: float
) -> dict[str, Any]:
    """Return the bench around a rig: converter, sensors, limits, and what the laboratory believes of the specimen."""
    hertz = float(virtual.linear_modes.frequency_hz[mode])
    shapes = {at: float(virtual.linear_modes.at(virtual.shape(at))[mode]) for at in ("drive", "far")}
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
    table["converter"] = {"oversampling": faster, "anti_alias_hz": 0.4 * rate}
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


def carried_out(bench_path: Path, folder: Path) -> dict[str, Any]:
    """Tune a bench, carry out the plan, and compare every point with harmonic balance."""
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
        end = run.recording.parts[-1].end
        points = points_of(run.recording)
        out |= {"run_s": time.perf_counter() - began, "end": end}
    out["levels"] = len(tuned.levels.levels_m)
    out |= true_curve(tuned.bench, tuned.levels.levels_m)
    out["points"] = [compared(tuned.bench, point) for point in points]
    return out


def true_curve(bench: Bench, levels_m: Any) -> dict[str, Any]:
    """The linear mode, and which of the plan's levels harmonic balance finds within the bench's limits."""
    subject = subject_of(bench)
    modes, mode = subject.rig.linear_modes, subject.mode
    linear = {
        "true_hz": float(modes.frequency_hz[mode]),
        "true_damping": float(modes.damping_ratio[mode]),
        "true_shape": float(modes.drive_shape[mode]),
    }
    try:
        levels = phase_resonance_backbone(subject.rig, amplitudes_m=list(levels_m), near_hz=subject.frequency_hz)
    except NotConvergedError as error:
        return linear | {"within": [], "truth_failed": str(error)}
    exact = {
        "level_frequency_hz": levels.frequency_hz,
        "level_damping": levels.damping_ratio,
        "level_v": levels.voltage_v,
        "level_n": levels.force_n,
    }
    within = [bool(x) for x in subject.within(levels)]
    return linear | {"within": within} | {name: values.tolist() for name, values in exact.items()}


def compared(bench: Bench, point: Point[Any]) -> dict[str, Any]:
    """What is said of a point, and, if it was accepted, its errors against harmonic balance."""
    out: dict[str, Any] = {
        "number": point.number,
        "level": point.level,
        "quality": str(point.quality),
        "reason": point.reason,
    }
    if not point.accepted:
        return out
    assert point.vibration is not None
    assert point.modal is not None
    subject = subject_of(bench)
    shape = float(subject.rig.linear_modes.drive_shape[subject.mode])
    amplitude = float(point.vibration.amplitude_m)
    out["amplitude_m"] = amplitude
    try:
        path = list(np.geomspace(0.1 * amplitude, amplitude, STEPS_TO_A_POINT))
        exact = phase_resonance_backbone(subject.rig, amplitudes_m=path, near_hz=subject.frequency_hz)
    except NotConvergedError as error:
        return out | {"truth_failed": str(error)}
    reported = float(point.modal.damping_ratio or math.nan)
    used = point.modal.drive_mode_shape or float(bench.specimen.drive_mode_shape or math.nan)
    true = float(exact.damping_ratio[-1])
    return out | {
        "frequency_error": float(point.modal.modal_frequency_hz) / float(exact.modal_frequency_hz[-1]) - 1.0,
        "damping_error": reported / true - 1.0,
        "damping_error_true_shape": reported * (shape / used) ** 2 / true - 1.0,
    }


app = typer.Typer(help=__doc__)


@app.command()
def draw(folder: Path, seed: int = 1, n: int = 12) -> None:
    """Write ``n`` bench files, one seed each from ``seed`` on."""
    folder.mkdir(parents=True, exist_ok=True)
    for one in range(seed, seed + n):
        path = folder / f"rig-{one}.toml"
        if not path.exists():
            path.write_text(tomli_w.dumps(drawn(one)), encoding="utf-8")


ONE = """
import sys
from pathlib import Path
from benchmarks.random_rigs import write_result
write_result(Path(sys.argv[1]))
"""


def write_result(bench: Path) -> None:
    """Tune and test one bench, and write what came of it beside it."""
    found = carried_out(bench, bench.parent)
    bench.with_suffix(".json").write_text(json.dumps(found, default=float), encoding="utf-8")


@app.command()
def run(folder: Path, jobs: int = 1, timeout_s: float = 900.0) -> None:
    """Tune and test every bench that has no result yet, each in a process of its own."""

    def one(bench: Path) -> None:
        try:
            command = [sys.executable, "-c", ONE, str(bench)]
            done = subprocess.run(command, timeout=timeout_s, capture_output=True, text=True, check=False)
            failed = done.stderr.strip().splitlines()[-1] if done.returncode else ""
        except subprocess.TimeoutExpired:
            failed = f"not ended within {timeout_s:g} s"
        if failed:
            bench.with_suffix(".json").write_text(json.dumps({"rig": bench.stem, "failed": failed}), encoding="utf-8")

    wanted = [path for path in _of_rigs(folder, "toml") if not path.with_suffix(".json").exists()]
    Parallel(n_jobs=jobs, backend="threading")(delayed(one)(bench) for bench in wanted)


def _of_rigs(folder: Path, ending: str) -> list[Path]:
    """Files of rigs, by seed."""
    found = [path for path in folder.glob(f"rig-*.{ending}") if path.stem.removeprefix("rig-").isdigit()]
    return sorted(found, key=lambda path: int(path.stem.removeprefix("rig-")))


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


def results(folder: Path) -> dict[str, Any]:
    """Return results, one entry per rig, and what they come to."""
    rigs = [json.loads(path.read_text(encoding="utf-8")) for path in _of_rigs(folder, "json")]
    points = [point for found in rigs for point in found.get("points", []) if "frequency_error" in point]
    return {
        "rigs": rigs,
        "outcomes": dict(Counter(outcome(found) for found in rigs)),
        "points": len(points),
        "errors": {name: _spread([abs(point[name]) for point in points], bound) for name, bound in WITHIN.items()},
    }


def _spread(values: list[float], bound: float) -> dict[str, float]:
    if not values:
        return {"median": math.nan, "largest": math.nan, "within": math.nan, "bound": bound}
    inside = sum(value <= bound for value in values) / len(values)
    return {"median": statistics.median(values), "largest": max(values), "within": inside, "bound": bound}


@app.command()
def table(folder: Path, json: bool = False) -> None:
    """Show what came of the rigs, and of points that were not accepted."""
    found = results(folder)
    if json:
        print_json(found)
        return
    for one in found["rigs"]:
        words = load_bench(folder / f"{one['rig']}.toml").description.removeprefix("drawn: ")
        print(f"{one['rig']}: {outcome(one)}; {words}")
        for line in _lines(one):
            print(f"    {line}")
    print(found["outcomes"], f"{len(found['rigs'])} rigs, {found['points']} points accepted")
    for name, values in found["errors"].items():
        print(f"{name}: " + ", ".join(f"{key} {value:.3%}" for key, value in values.items()))


def _lines(one: dict[str, Any]) -> Iterator[str]:
    for key in ("refused", "failed", "not_run"):
        if key in one:
            yield one[key]
            return
    plant, shifts = one["plant"], one.get("level_frequency_hz", [math.nan])
    yield (
        f"tune {plant['frequency_hz'] / one['true_hz'] - 1.0:+.2%}, damping {100.0 * plant['damping_ratio']:.3g} of "
        f"{100.0 * one['true_damping']:.3g} %, phi {plant['drive_mode_shape'] / one['true_shape'] - 1.0:+.1%}, fit "
        f"{plant['fit_error']:.2%}, distortion {one['test']['distortion']:.2%}; {one['tune_s']:.0f} s + "
        f"{one['run_s']:.0f} s; levels shift {shifts[-1] / shifts[0] - 1.0:+.2%}, within "
        f"{sum(one['within'])} of {one['levels']}"
    )
    if one["end"] and one["end"]["reason"] != "completed":
        yield f"end: {one['end']['text']}"
    good = [point for point in one["points"] if "frequency_error" in point]
    for point in one["points"]:
        if point not in good:
            yield f"{point['number']} {point['level']:.3g} {point['quality']} {point['reason'][:200]}"
    if good:
        worst = [max(abs(point[name]) for point in good) for name in WITHIN]
        yield f"worst f {worst[0]:.4%}, D {worst[1]:.1%}, with true phi {worst[2]:.2%}"


if __name__ == "__main__":
    app()
