"""The test that the output comes to 0 V by the device's own means once its host is dead."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from rig.bench import Bench
from rig.conformance.looking import POLL_S, STILL, OutputReading, OutputSteps, loopback_of

KILLING_TEST = "test_the_output_comes_to_0_v_without_the_host"
NOTHING_TO_LOOK_AT = "nothing is left to look at once the process is dead: no witness (override witness), no loopback"

REOPENED = (
    "the loopback reads 0 V once the device is opened again, which may itself have brought it there. Override witness "
    "(voltmeter, second DAQ)"
)


def last_output_v(log: Path) -> float:
    """The last output in an emulator's log (``rig emulate --log-output``), V: a witness that is not the driver."""
    lines = log.read_text(encoding="ascii").rpartition("\n")[0].splitlines()
    return abs(float(lines[-1].split()[2])) if lines else 0.0


class WithoutHostTests(OutputSteps):
    """A host that is killed."""

    safe_within_s = 5.0
    """Time that a device has to bring its output to 0 V once its host is dead, s."""

    def test_the_output_comes_to_0_v_without_the_host(self) -> None:
        """A driver that says ``safe_without_host`` is driven in a process of its own, which is killed."""
        with self.make() as daq:
            capabilities, column = daq.capabilities, loopback_of(daq)
        if not capabilities.safe_without_host:
            self.skip(
                "the driver does not say that it is safe without the host: [arming] asks for a hardware emergency stop"
            )
        bench = self.bench_for_another_process()
        if bench is None:
            self.unproven(
                "the contract has no bench that another process could open (override bench_for_another_process)"
            )
        if self.witness(None) is None and capabilities.virtual:
            self.skip(NOTHING_TO_LOOK_AT)
        if self.witness(None) is None and column is None:
            self.unproven(NOTHING_TO_LOOK_AT)
        self._drive_and_kill(bench)
        seen = self._waited_for_0_v()
        assert seen.volts <= STILL * self.amplitude_v, (
            f"{seen.volts:g} V are on the output {self.safe_within_s:g} s after the process that drove it was killed"
        )
        if seen.after_restart:
            self.unproven(REOPENED)

    def _waited_for_0_v(self) -> OutputReading:
        """Output once it is at 0 V or the time is over; without a witness it is read from the loopback of a new driver."""
        end = time.monotonic() + self.safe_within_s
        while time.monotonic() < end:
            seen = self.witness(None)
            if seen is not None and seen <= STILL * self.amplitude_v:
                return OutputReading(seen, after_restart=False)
            time.sleep(POLL_S)
        seen = self.witness(None)
        if seen is not None:
            return OutputReading(seen, after_restart=False)
        with self.make_visible() as daq:
            return OutputReading(self.reading_before_new_output(daq), after_restart=True)

    def _drive_and_kill(self, bench: Bench) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or str(Path.cwd()) for path in sys.path)}
        command = [sys.executable, "-P", "-m", "rig.conformance.driving"]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen(command, text=True, env=environment, **pipes) as process:  # type: ignore[call-overload]
            try:
                told = {"bench": bench.model_dump(mode="json"), "amplitude_v": self.amplitude_v}
                process.stdin.write(json.dumps(told) + "\n")
                process.stdin.flush()
                assert process.stdout.readline().strip() == "driven", "the other process could not drive the bench"
                seen = self.witness(None)
                assert seen is None or seen > STILL * self.amplitude_v, "the witness sees nothing of what is driven"
            finally:
                process.kill()
