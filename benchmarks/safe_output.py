"""How long a device stays driven after something died: ``python -m benchmarks.safe_output [--json] [--repeats N] [CASE...]``.

A backbone of the magnet beam runs over an emulated serial device at wall-clock pace, which writes down the output of every
block. In the middle of it the campaign's process or the loop's process is killed (``kill -9``), the cable is unplugged (a
relay between two pseudo-terminals is killed), Ctrl-C is pressed, or the device's emergency stop. Measured is the time from
there to the last block whose output was not 0 V. What is promised: a ramp (the bench's ``ramp_down_s``) where the loop
lives, the device's watchdog and its ramp where it does not.
"""

import argparse
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.bench import Bench, DriverChoice, load_bench
from rig.wire.device.emulator import Emulator
from rig.wire.serial.pty import open_pseudo_terminal

RUN = """
import sys
import rig
from rig.bench import Bench
bench = Bench.model_validate_json(open(sys.argv[1]).read())
with rig.run("magnet-beam/backbone", bench=bench, output=sys.argv[2]) as done:
    print(done.recording.parts[-1].end["text"])
"""
DRIVEN_V = 0.2
OPTIONS = {"watchdog_s": 0.02, "ramp_s": 0.0}
LONGEST_S = 60.0


def relay(port: str) -> None:
    """A cable: bytes between ``port`` and a new pseudo-terminal, whose name is printed, until it is killed."""
    far = os.open(port, os.O_RDWR | os.O_NOCTTY)
    near = open_pseudo_terminal()
    print(near.path, flush=True)
    while True:
        for source in select.select([far, near.descriptor], [], [])[0]:
            os.write(near.descriptor if source == far else far, os.read(source, 4096))


def child_of(process: int) -> int:
    """Number of the loop process of a campaign."""
    found = subprocess.run(
        ["pgrep", "-P", str(process), "-f", "rig.worker"], capture_output=True, text=True, check=True
    )
    return int(found.stdout.split()[0])


def volts(log: Path) -> list[tuple[float, float]]:
    """Times (s) and largest outputs (V) of the blocks so far."""
    lines = [line.split() for line in log.read_text().splitlines()]
    return [(float(line[0]), float(line[2])) for line in lines if len(line) == 3]


def wait_until_driven(log: Path, campaign: "subprocess.Popen[str]") -> None:
    """Until the output is at a level."""
    end = time.monotonic() + LONGEST_S
    while time.monotonic() < end and campaign.poll() is None:
        if log.exists() and len(found := volts(log)) > 100 and max(v for _, v in found[-100:]) > DRIVEN_V:
            return
        time.sleep(0.1)
    raise RuntimeError(f"the campaign drove nothing: {campaign.communicate()}")


def measure(case: str, bench: Bench) -> dict[str, Any]:
    """One campaign, one accident."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, bench_file = folder / "output.log", folder / "bench.json"
        with Emulator(bench, "serial", options=OPTIONS, lockstep=False, log_output=log) as emulator:
            reached = emulator.bench
            cable = None
            if case == "unplugged cable":
                command = [sys.executable, "-m", "benchmarks.safe_output", "--relay", reached.driver.options["port"]]
                cable = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
                assert cable.stdout is not None
                options = {**reached.driver.options, "port": cable.stdout.readline().strip()}
                reached = reached.model_copy(update={"driver": DriverChoice(name="serial", options=options)})
            bench_file.write_text(reached.model_dump_json())
            command = [sys.executable, "-c", RUN, str(bench_file), str(folder / "run.h5")]
            campaign = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            wait_until_driven(log, campaign)
            accidents: dict[str, Callable[[], None]] = {
                "kill -9 of the campaign": campaign.kill,
                "kill -9 of the loop": lambda: os.kill(child_of(campaign.pid), signal.SIGKILL),
                "unplugged cable": cable.kill if cable is not None else campaign.kill,
                "Ctrl-C": lambda: campaign.send_signal(signal.SIGINT),
                "emergency stop": emulator.press_emergency_stop,
            }
            began = time.monotonic()
            accidents[case]()
            time.sleep(2.0 + bench.limits.ramp_down_s)
            campaign.wait(LONGEST_S)
            said, complained = campaign.communicate()
            if cable is not None:
                cable.wait()
            after = [(at, v) for at, v in volts(log) if at > began]
            driven = [at - began for at, v in after if v > 0.0]
        return {"ms": 1e3 * max(driven, default=0.0), "said": said.strip() or complained.strip()[-200:]}


CASES = ("kill -9 of the campaign", "kill -9 of the loop", "unplugged cable", "Ctrl-C", "emergency stop")


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*", default=CASES)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--relay", metavar="PORT", help=argparse.SUPPRESS)
    wanted = parser.parse_args()
    if wanted.relay:
        relay(wanted.relay)
    bench = load_bench("magnet-beam").model_copy(update={"block": 10})
    found = {case: [measure(case, bench) for _ in range(wanted.repeats)] for case in wanted.cases}
    if wanted.json:
        json.dump(found, sys.stdout, indent=2)
        return
    print(
        f"ramp {1e3 * bench.limits.ramp_down_s:.0f} ms, watchdog {1e3 * OPTIONS['watchdog_s']:.0f} ms, then 0 V at once"
    )
    for case, runs in found.items():
        times = ", ".join(f"{run['ms']:.1f}" for run in runs)
        print(f"{case:26} {times} ms   {runs[-1]['said']}")


if __name__ == "__main__":
    main()
