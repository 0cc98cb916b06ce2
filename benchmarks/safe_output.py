"""How long a device stays driven after something died: ``python -m benchmarks.safe_output [--firmware PROGRAM] [CASE...]``.

A tone is held on the magnet beam over an emulated serial device at wall-clock pace, which writes down the output of every
block. In the middle of it the campaign's process or the loop's process is killed (``kill -9``), the cable is unplugged (a
relay between two pseudo-terminals is killed) or flooded (the relay passes on nothing but garbage), Ctrl-C is pressed, or the
device's emergency stop. Measured is the time from there to the last block whose output was not 0 V, and by the device's clock
the blocks from there to that one; this clock stands still while the device's process is not scheduled. What is promised: a ramp
(the bench's ``ramp_down_s``) where the loop lives, the device's watchdog and its ramp where it does not.

Looked at besides: what the recording says, whether any process of the campaign is left, and whether the same device takes
the next run. A run that the watchdog ends before the accident, on a machine that stalls for longer than ``--watchdog-ms``,
is counted and begun anew.
"""

import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.frame import show
from rig.bench import Bench, DriverChoice, load_bench
from rig.drivers import make_daq
from rig.emulator.emulated import Emulator
from rig.errors import RigError
from rig.recording.conversion import finalise
from rig.recording.journal import journal_path
from rig.recording.reader import Recording
from rig.wire.serial.port import open_pseudo_terminal

RUN = """
import sys
import rig
from rig.bench import Bench
from rig.campaigns.plans import load_plan
bench = Bench.model_validate_json(open(sys.argv[1]).read())
plan = load_plan("magnet-beam/backbone").model_copy(update={"levels_v": (0.6,), "record_periods": 2000})
rig.run(plan, bench=bench, output=sys.argv[2]).close()
"""
DRIVEN_V = 0.1
"""Output above which the rig counts as driven, V: a sixth of the level."""
TAIL_BYTES = 4000
"""Bytes at the end of the log that are read while the run goes on."""
LONGEST_S = 60.0
"""Longest wait for a level, and for the end of a campaign, s; chosen."""
TRIES = 5
"""Runs that may end before their accident."""
PRIORITY = 70  # of the cable: it is no program of the campaign's, and a real one takes no time


class EndedEarlyError(Exception):
    """The campaign was over before the accident."""


def relay(port: str) -> None:
    """A cable: bytes between ``port`` and a new pseudo-terminal, whose name is printed, until it is killed.

    From SIGUSR1 on it passes on nothing, and floods the device with garbage.
    """
    flooded = False

    def flood(_number: int, _frame: object) -> None:
        nonlocal flooded
        flooded = True

    signal.signal(signal.SIGUSR1, flood)
    far = os.open(port, os.O_RDWR | os.O_NOCTTY)
    near = open_pseudo_terminal()
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    print(near.path, flush=True)
    while not flooded:
        for source in select.select([far, near.descriptor], [], [])[0]:
            passed = os.read(source, 4096)
            if not passed:  # the device is gone
                return
            os.write(near.descriptor if source == far else far, passed)
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # garbage takes no processor from the device
    while True:
        os.write(far, os.urandom(4096))


def child_of(process: int) -> int:
    """Number of the loop process of a campaign."""
    found = subprocess.run(
        ["pgrep", "-P", str(process), "-f", "rig.loop.worker"], capture_output=True, text=True, check=False
    )
    if not found.stdout:
        raise EndedEarlyError
    return int(found.stdout.split()[0])


def is_there(process: int) -> bool:
    """Whether a process still runs."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def volts(text: str) -> list[tuple[float, int, float]]:
    """Times (s), first samples and largest outputs (V) of the blocks in a piece of the log."""
    lines = [line.split() for line in text.splitlines()]
    return [(float(line[0]), int(line[1]), float(line[2])) for line in lines if len(line) == 3]


def last_volts(log: Path) -> list[tuple[float, int, float]]:
    """The same of the last blocks."""
    with log.open("rb") as file:
        file.seek(max(0, log.stat().st_size - TAIL_BYTES))
        return volts(file.read().decode("ascii").partition("\n")[2])


def wait_until_driven(log: Path, campaign: "subprocess.Popen[str]") -> None:
    """Until the output has been at a level for half a second."""
    end = time.monotonic() + LONGEST_S
    since = float("inf")
    while time.monotonic() < end:
        if campaign.poll() is not None:
            raise EndedEarlyError
        driven = log.exists() and max((v for _, _, v in last_volts(log)), default=0.0) > DRIVEN_V
        since = min(since, time.monotonic()) if driven else float("inf")
        if time.monotonic() - since > 0.5:
            return
        time.sleep(0.05)
    raise RuntimeError(f"nothing was driven within {LONGEST_S:g} s")


def plugged(stack: ExitStack, bench: Bench) -> tuple[Bench, "subprocess.Popen[str]"]:
    """A cable in between, and the bench at its other end."""
    code = "import sys; from benchmarks.safe_output import relay; relay(sys.argv[1])"
    command = [sys.executable, "-c", code, bench.driver.options["port"]]
    cable = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
    stack.callback(cable.kill)
    assert cable.stdout is not None
    options = {**bench.driver.options, "port": cable.stdout.readline().strip()}
    return bench.model_copy(update={"driver": DriverChoice(name="serial", options=options)}), cable


def recorded(output: Path) -> str:
    """Why the recording says the run has ended; read from its journal where the campaign could not finish it."""
    try:
        if not output.exists():
            finalise(journal_path(output), output)
            kept = "journal: "
        else:
            kept = ""
        with Recording(output) as recording:
            part = recording.parts[-1]
            return f"{kept}{part.n_rows} rows, {(part.end or {}).get('text', 'no end')}"
    except RigError as error:
        return f"UNREADABLE: {error}"


def started_again(bench: Bench) -> str:
    """Whether the device takes a next run, and what it says of the last one."""
    options = {**bench.driver.options, "watchdog_s": 2.0, "timeout_s": 2.0}
    again = bench.model_copy(update={"driver": DriverChoice(name="serial", options=options)})
    try:
        with make_daq(again, 0) as daq:
            daq.clear()
            daq.start(again.block)
            for _ in range(50):
                daq.exchange(np.zeros(again.block))
            return "; ".join(("starts", *daq.remarks))
    except RigError as error:
        return f"DOES NOT START: {error}"


def accident(case: str, bench: Bench, options: dict[str, float], firmware: str | None) -> dict[str, Any]:
    """One campaign, one accident."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        log, bench_file, output = folder / "output.log", folder / "bench.json", folder / "run.h5"
        emulator = stack.enter_context(
            Emulator(bench, "serial", options=options, lockstep=False, log_output=log, firmware=firmware)
        )
        reached, cable = plugged(stack, emulator.bench) if case in CABLE else (emulator.bench, None)
        bench_file.write_text(reached.model_dump_json())
        command = [sys.executable, "-c", RUN, str(bench_file), str(output)]
        campaign = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        stack.callback(campaign.kill)
        wait_until_driven(log, campaign)
        loop = child_of(campaign.pid)
        actions: dict[str, Callable[[], None]] = {
            "kill -9 of the campaign": campaign.kill,
            "kill -9 of the loop": lambda: os.kill(loop, signal.SIGKILL),
            "unplugged cable": cable.kill if cable is not None else campaign.kill,
            "flooded cable": lambda: cable.send_signal(signal.SIGUSR1) if cable is not None else None,
            "Ctrl-C": lambda: campaign.send_signal(signal.SIGINT),
            "emergency stop": emulator.press_emergency_stop,
        }
        began = time.monotonic()
        actions[case]()
        complained = campaign.communicate(timeout=LONGEST_S)[1].strip()
        time.sleep(max(0.0, began + 1.0 + bench.limits.ramp_down_s - time.monotonic()))
        if cable is not None:
            cable.kill()
        driven = [(at, first) for at, first, v in volts(log.read_text()) if at > began and v > 0.0] or [(began, 0)]
        return {
            "ms": 1e3 * (driven[-1][0] - began),
            "by_its_clock_ms": 1e3 * (driven[-1][1] - driven[0][1] + bench.block) / bench.sample_rate_hz,
            "recorded": recorded(output),
            "said": complained[-300:],
            "next_run": started_again(emulator.bench),
            "loop_left": is_there(loop),
        }


def measure(case: str, bench: Bench, options: dict[str, float], firmware: str | None = None) -> dict[str, Any]:
    """An accident that happens; how many runs ended before theirs is said with it."""
    before = set(Path("/dev/shm").glob("*"))
    for early in range(TRIES):
        try:
            found = accident(case, bench, options, firmware)
        except EndedEarlyError:
            print(f"{case}: ended before the accident, begun anew", file=sys.stderr)
            continue
        left = sorted(str(path) for path in set(Path("/dev/shm").glob("*vibrolock*")) - before)
        return {**found, "shared_memory_left": left, "ended_early": early}
    raise SystemExit(f"{case}: {TRIES} runs ended before the accident; try a longer --watchdog-ms")


CABLE = ("unplugged cable", "flooded cable")
CASES = ("kill -9 of the campaign", "kill -9 of the loop", *CABLE, "Ctrl-C", "emergency stop")


def main(
    cases: Annotated[list[str] | None, typer.Argument()] = None,
    repeats: int = 3,
    watchdog_ms: float = 20.0,
    ramp_ms: float = 0.0,
    firmware: str | None = None,
    json: bool = False,
) -> None:
    """Measure each case so many times.

    ``watchdog_ms`` and ``ramp_ms`` are the device's; a ramp of 0 drops the output. ``firmware`` is run in the emulator's place.
    """
    bench = load_bench("magnet-beam").model_copy(update={"block": 10})
    options = {"watchdog_s": 1e-3 * watchdog_ms, "ramp_s": 1e-3 * ramp_ms}
    found: dict[str, Any] = {}
    for case in cases or CASES:
        for number in range(repeats):
            found[f"{case}, {number + 1}"] = measure(case, bench, options, firmware)
    show(found, json)


if __name__ == "__main__":
    typer.run(main)
