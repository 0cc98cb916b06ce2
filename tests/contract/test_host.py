"""What tells whether this machine was late, and what an emulator's log tells of the output."""

import pytest

from rig.conformance import host, last_output_v
from rig.conformance.host import HostWatch


@pytest.fixture
def pressure(tmp_path, monkeypatch):
    """The file in which the system tells how long processes have waited."""
    path = tmp_path / "cpu"
    monkeypatch.setattr(host, "PRESSURE", path)

    def waited(seconds):
        path.write_text(
            f"some avg10=0.00 avg60=0.00 avg300=0.00 total={round(1e6 * seconds)}\nfull avg10=0.00 total=0\n"
        )

    return waited


def test_a_nap_that_ended_late_counts_near_the_time_at_which_it_was_and_three_times(pressure):
    watch = HostWatch()
    watch._late.append((10.0, 10.05))
    assert watch.late_s(10.12, 10.13) == pytest.approx(0.15)
    assert watch.late_s(11.0, 12.0) == 0.0


def test_what_processes_waited_for_a_processor_counts_as_it_is(pressure):
    pressure(5.0)
    watch = HostWatch()
    at = watch._waited[0][0]
    pressure(5.2)
    assert watch.late_s(at + 1.0, at + 2.0) == pytest.approx(0.2)


def test_a_system_that_does_not_tell_is_judged_by_naps_alone(pressure):
    watch = HostWatch()
    at = watch._waited[0][0]
    assert watch.late_s(at + 1.0, at + 2.0) == 0.0


def test_a_thread_that_keeps_the_interpreter_makes_the_host_late():
    with HostWatch() as watch:
        began = watch._waited[0][0]
        sorted(range(3_000_000), key=int.__neg__)
        assert watch.late_s(began, began + 60.0) > 0.0


def test_a_machine_that_stalls_without_a_device_is_found(monkeypatch):
    times = iter([0.0, 0.001, 0.002, 0.04, 0.041])
    monkeypatch.setattr(host.time, "perf_counter", lambda: next(times))
    assert HostWatch.stalls_alone(0.025, 1.0)


def test_a_machine_that_does_not_stall_is_watched_for_as_long_as_asked(monkeypatch):
    times = iter([0.01 * k for k in range(102)])
    monkeypatch.setattr(host.time, "perf_counter", lambda: next(times))
    assert not HostWatch.stalls_alone(0.025, 1.0)
    assert next(times) > 1.0


def test_the_last_output_of_a_log_has_no_sign(tmp_path):
    log = tmp_path / "log"
    log.write_text("0.1 5 0.02\n0.2 6 -0.05\n")
    assert last_output_v(log) == 0.05
