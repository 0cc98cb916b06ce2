"""`safe_without_host` is measured: a process that drives is killed, and the output is looked at."""

import pytest

from rig.bench import DriverChoice
from rig.conformance import DriverContract, NotApplicable, last_output_v
from rig.drivers import make_daq
from rig.emulator.emulated import emulated
from tests.firmware.building import built
from tests.refused import refused
from tests.rig.rigs import bench_with

KILLED = "test_the_output_comes_to_0_v_without_the_host"


class OverABench(DriverContract):
    """The contract over a bench, whose output stands in a file."""

    safe_within_s = 1.0

    def __init__(self, bench, look):
        self.bench, self.look = bench, look

    def make(self):
        return make_daq(self.bench)

    def bench_for_another_process(self):
        return self.bench

    def witness(self, daq):
        return self.look()

    def skip(self, reason):
        raise NotApplicable(reason)


@pytest.fixture
def of_files(tmp_path, monkeypatch):
    """The drivers over a file as an installed package, for this process and those it starts."""
    folder = tmp_path / "site" / "outliving-1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: outliving\nVersion: 1.0\n")
    names = "\n".join(f"{name} = tests.contract.outliving:{name}" for name in ("FileDAQ", "HonestFileDAQ"))
    (folder / "entry_points.txt").write_text(f"[vibrolock.drivers]\n{names}\n")
    monkeypatch.syspath_prepend(str(folder.parent))
    output = tmp_path / "output"

    def contract(name):
        options = {**bench_with().driver.options, "output": str(output)}
        bench = bench_with({"block": 10}).model_copy(update={"driver": DriverChoice(name=name, options=options)})
        return OverABench(bench, lambda: abs(float(output.read_text() or 0)) if output.exists() else 0.0)

    return contract


def test_a_driver_that_claims_it_and_does_not_keep_it_fails(of_files):
    with refused(AssertionError, "v-are-on-the-output-s"):
        getattr(of_files("FileDAQ"), KILLED)()


def test_a_driver_that_does_not_claim_it_is_told_what_arming_asks_for(of_files):
    with refused(NotApplicable, "does-not-say-hardware-emergency-stop"):
        getattr(of_files("HonestFileDAQ"), KILLED)()


@pytest.mark.parametrize("wire", ["serial", "can"])
@pytest.mark.parametrize("target", [None, "host"], ids=["emulator", "firmware"])
def test_the_watchdog_of_a_device_on_a_wire_brings_the_output_down(target, wire, tmp_path):
    log, options = tmp_path / "log", {"watchdog_s": 0.3}
    settings = {"firmware": built(target)} if target else {}
    with emulated(bench_with({"block": 10}), wire, options=options, log_output=log, **settings) as bench:
        contract = OverABench(bench, lambda: last_output_v(log))
        contract.safe_within_s = 20.0  # of a busy machine
        getattr(contract, KILLED)()
        with make_daq(bench) as daq:
            assert daq.latched == "the device's watchdog had latched"


def test_a_watchdog_that_waits_for_longer_is_found_out(tmp_path):
    log = tmp_path / "log"
    with (
        emulated(bench_with({"block": 10}), "serial", options={"watchdog_s": 50.0}, log_output=log) as bench,
        refused(AssertionError, "after-the-process-that-drove-it"),
    ):
        getattr(OverABench(bench, lambda: last_output_v(log)), KILLED)()


def test_of_a_virtual_rig_nothing_outlives_its_process():
    contract = OverABench(bench_with(), lambda: None)
    with refused(NotApplicable, "nothing-is-left-to-look-at"):
        getattr(contract, KILLED)()


del DriverContract
