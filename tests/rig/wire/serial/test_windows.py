"""A system without termios and without the signals of Unix: one clear line, and everything else works."""

import subprocess
import sys

import pytest

WITHOUT = """
import signal, sys
import can, serial, serial.tools.list_ports, threadpoolctl  # which have code of their own for such a system
import rig.bench, rig.drivers, rig.loop.doctor
from tests.rig.rigs import bench_with
for name in ("SIGHUP", "SIGUSR1", "SIGQUIT"):
    delattr(signal, name)
for name in ("termios", "tty", "pty", "fcntl", "resource"):
    sys.modules[name] = None
sys.platform = "win32"
"""
OPENING = """
from rig.bench import DriverChoice
from rig.drivers import make_daq
from rig.errors import DaqRefused
driver = DriverChoice(name={name!r}, options={options!r})
try:
    make_daq(bench_with().model_copy(update={{"driver": driver}})).open()
except DaqRefused as error:
    print(error)
"""
EMULATING = """
from rig.errors import DaqRefused
from rig.emulator.emulated import Emulator
from rig.emulator.process import run_emulator
from rig.emulator.settings import EmulatorSettings
try:
    run_emulator(EmulatorSettings(wire="serial", bench=bench_with()), print)
except DaqRefused as error:
    print(error)
"""


def said(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", WITHOUT + code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("name", "options"),
    [("serial", {"port": "COM3"}), ("can", {"interface": "slcan", "channel": "COM3"})],
)
def test_a_serial_port_is_refused_in_one_line_that_names_it_and_the_way_out(name: str, options: dict[str, str]) -> None:
    lines = said(OPENING.format(name=name, options=options)).splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("port 'COM3': serial ports are driven on Linux and macOS only")
    assert "python-can" in lines[0]


def test_an_emulator_on_a_pseudo_terminal_is_refused_and_the_ports_can_still_be_listed() -> None:
    out = said(EMULATING + "from rig.wire.serial.port import port_names\nprint(type(port_names()).__name__)")
    assert out.splitlines()[0].startswith("this system has no pseudo-terminals")
    assert out.splitlines()[1] == "list"
