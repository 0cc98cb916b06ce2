"""Measurement of rows: times and settings at 0 V; resolution and time to 0 V where nothing physical moves; the suite."""

import os
import platform
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import vibrolock
from rig.bench import Bench, DriverChoice
from rig.conformance.run import check_driver
from rig.drivers import make_daq
from rig.errors import RigError
from rig.loop.doctor import examine_bench, measure_bench
from rig.loop.recommendation import Settings
from rig.loop.worker.examination import with_settings
from rig.loop.worker.probe import smallest_steps_v
from studies.matrix.rows import Row, Verified
from studies.matrix.transports import Transport, transports

MEASURED_S = 1.5
"""Length of the second examination, with the recommended settings, s; chosen."""
DRIVE_V = 0.05
"""Voltage by which a device that moves nothing is driven: as much as the conformance suite."""
DRIVE_S = 0.4
"""For how long, s; chosen."""
LONGEST_LOOK_S = 5.0
"""Longest wait for 0 V, s: longer than any watchdog that is set here."""
POLL_S = 0.02
"""Time between two looks at the log, s; chosen."""
SUITE_WATCHDOG_S = 1.0
"""Watchdog while the suite runs and 0 V is waited for, where the device waits for the host: it looks for 5 s."""


def matrix_rows(bench: Bench, firmware: Sequence[Path] = (), *, verify: bool = False) -> Iterator[Row]:
    """Measure every way to run a virtual bench on this machine, one row after the other; ``verify``: also run the suite."""
    for transport in transports(firmware):
        with tempfile.TemporaryDirectory(prefix="rig-matrix-") as folder:
            yield _row(transport, bench, Path(folder) / "output.log", verify)


def device_row(bench: Bench, facts: Mapping[str, Any]) -> Row:
    """Return the row of a bench's device from the report of `rig.loop.doctor.examine_bench`; nothing else is done with it."""
    identity = facts.get("identity", {})
    name = " ".join(filter(None, (facts["driver"], identity.get("model", ""))))
    row = row_from(name, bench, facts)
    return row if row.watchdog_s is None else row.model_copy(update={"to_0v": "reported"})


def machine() -> str:
    """Return system and processor of this machine."""
    return f"{platform.system()} {platform.release()}, {os.cpu_count() or 1} x {_processor()}"


def row_from(way: str, bench: Bench, facts: Mapping[str, Any]) -> Row:
    """Return a row with what stands in the report of an examination."""
    identity, advice = facts.get("identity", {}), facts.get("recommendation", {})
    known: dict[str, Any] = {
        **_here(),
        "way": way,
        "bench": bench.name,
        "driver": bench.driver.name,
        "device": " ".join(filter(None, (identity.get("model"), identity.get("firmware")))),
        "failure": facts.get("failure", facts.get("latched", "")),
    }
    if "block_us" not in facts:
        return Row(**known)
    settings = advice.get("settings", {})
    known |= {name: facts[name] for name in ("sample_rate_hz", "reached_hz", "block", "queue_blocks")}
    known |= {name: facts[name] for name in ("blocks", "held_blocks", "lost_blocks")}
    known |= {name: settings.get(name) for name in ("largest_rate_hz", "watchdog_s")}
    known["latency_ms"] = _digits(1e3 * facts["latency_samples"] / bench.sample_rate_hz)
    known["block_p50_ms"] = _digits(1e-3 * facts["block_us"]["p50"])
    if "late_us" in facts:
        known |= {f"late_{name}_ms": _digits(1e-3 * facts["late_us"][name]) for name in ("p99_9", "largest")}
    if "round_trip_p50_us" in facts["statistics"]:
        known["round_trip_p50_ms"] = _digits(1e-3 * facts["statistics"]["round_trip_p50_us"])
    known["resolution_mv"] = _millivolts(facts["smallest_step_v"])
    return Row(**known)


def _row(transport: Transport, bench: Bench, log: Path, verify: bool) -> Row:
    """Measure one transport; what fails stands in the row."""
    row = Row(way=transport.name, bench=bench.name, driver=transport.wire or "virtual", **_here())
    try:
        with transport.opened(bench, log) as reached:
            row = row_from(transport.name, *_with_settings_that_hold(reached))
            reached = _waiting(reached, transport)
            if verify:
                row = row.model_copy(update={"verified": _verified(reached, log)})
            return row.model_copy(update=_driven(reached, log))
    except RigError as error:
        return row.model_copy(update={"failure": f"{type(error).__name__}: {error}"})


def _with_settings_that_hold(bench: Bench) -> tuple[Bench, Mapping[str, Any]]:
    """Return the bench with the settings that are recommended here, and the report of `rig.loop.doctor` with them."""
    facts = examine_bench(bench)
    with make_daq(bench) as daq:  # the settings that the bench had may have ended with the watchdog
        if daq.capabilities.virtual:
            daq.clear()
    advice = facts.get("recommendation", {})
    if not advice.get("differs"):
        return bench, facts
    told = advice["settings"]
    settings = Settings(told["block"], told["queue_blocks"], told.get("watchdog_s"))
    better = with_settings(bench, settings, bench.sample_rate_hz)
    return better, {**measure_bench(better, seconds=MEASURED_S), "recommendation": advice}


def _waiting(bench: Bench, transport: Transport) -> Bench:
    """Return the bench with a watchdog that the suite can see act: where the device waits for the host, it is a minute."""
    if transport.wire is None or not transport.lockstep:
        return bench
    options = {**bench.driver.options, "watchdog_s": SUITE_WATCHDOG_S}
    return bench.model_copy(update={"driver": DriverChoice(name=bench.driver.name, options=options)})


def _verified(bench: Bench, log: Path) -> Verified:
    """Run the conformance suite, with the log of the outputs as its witness."""
    found = list(check_driver(bench, log if log.exists() else None))
    outcomes = [finding.outcome for finding in found]
    return Verified(
        utc=_utc(),
        passed=outcomes.count("passed"),
        failed=outcomes.count("failed"),
        not_applicable=outcomes.count("not applicable") + outcomes.count("unproven"),
        failures=tuple(f"{one.test}: {one.detail}" for one in found if one.outcome == "failed"),
    )


def _driven(bench: Bench, log: Path) -> dict[str, Any]:
    """Drive a device that moves nothing by 0.05 V, then leave it alone; return resolution, watchdog and time to 0 V."""
    with make_daq(bench) as daq:
        daq.clear()
        daq.start(bench.block)
        voltages = np.full(bench.block, DRIVE_V)
        readings = [daq.exchange(voltages) for _ in range(round(DRIVE_S * bench.sample_rate_hz / bench.block))]
        sent_s = time.monotonic()
        readings.append(daq.exchange(voltages))
        steps_v = smallest_steps_v([channel.name for channel in daq.channels], np.vstack(readings))
        for channel in daq.channels:
            if channel.loopback:  # it reads nothing but the voltage that is held
                steps_v.pop(channel.name, None)
        out: dict[str, Any] = {"resolution_mv": _millivolts(steps_v)}
        if daq.adjustable is None:
            return out | {"to_0v": "ends with its process"}
        out |= {"watchdog_s": daq.adjustable.watchdog_s, "to_0v": "reported"}
        zero_s = _seen_at_0_v(log)
        return out if zero_s is None else out | {"to_0v": "measured", "to_0v_s": round(zero_s - sent_s, 4)}


def _seen_at_0_v(log: Path) -> float | None:
    """Wait for 0 V in a log of outputs (`rig.emulator.plant.LoggedPlant`); return when it was put out (monotonic clock), s."""
    end = time.monotonic() + LONGEST_LOOK_S
    while log.exists() and time.monotonic() < end:
        time.sleep(POLL_S)
        lines = [line.split() for line in log.read_text(encoding="ascii").rpartition("\n")[0].splitlines()]
        driven = max((number for number, line in enumerate(lines) if float(line[2]) > 0.0), default=len(lines))
        if driven + 1 < len(lines):
            return float(lines[driven + 1][0])
    return None


def _here() -> dict[str, str]:
    return {"utc": _utc(), "version": vibrolock.__version__, "machine": machine()}


def _processor() -> str:
    """Return the processor's model where the system tells it, else its architecture."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text(encoding="utf-8", errors="replace").splitlines() if facts.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()


def _millivolts(steps_v: dict[str, float]) -> dict[str, float]:
    return {name: _digits(1e3 * step) for name, step in steps_v.items()}


def _digits(value: float) -> float:
    return float(f"{value:.5g}")


def _utc() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
