"""The health check on the virtual rigs as they are, and with cables and sensors that are not as the bench has them."""

import json

import numpy as np
import pytest

from rig.arming.run_options import RunOptions
from rig.check.findings import Finding
from rig.check.report import print_summary, summary
from rig.check.resolution import resolution_findings
from rig.check.run import check
from rig.errors import RecordingError
from rig.recording.reader import Recording
from simulators import VirtualRig
from tests.refused import refused
from tests.rig.check.rewired import constant, flipped, noise_only, rewire, scaled, swapped
from tests.rig.rigs import bench_with

BLOCK = {"block": 50}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A check of the magnet beam as it is."""
    return check(bench_with(BLOCK), tmp_path_factory.mktemp("sound") / "sound.h5", RunOptions(seed=1))


def checked(tmp_path, monkeypatch, rewiring, name="magnet-beam", **options):
    rewire(monkeypatch, rewiring)
    return check(bench_with(BLOCK, name), tmp_path / "check.h5", RunOptions(seed=2, overwrite=True), **options)


def finding(found, name, channel) -> Finding:
    return next(f for f in found.findings if (f.name, f.channel) == (name, channel))


@pytest.mark.parametrize("name", ["magnet-beam", "magnet-beam-symmetric", "friction-beam"])
def test_nothing_is_wrong_with_the_shipped_benches(name, tmp_path):
    found = check(bench_with({"block": 50}, name), tmp_path / "check.h5", RunOptions(seed=7))
    assert [f for f in found.findings if f.verdict in ("warn", "fail") and f.name != "limits"] == []
    # The multisines of the paper leave the friction beam no room between its limits and its sensors' ranges.
    said = [f.text.split(" = ")[0] for f in found.findings if f.name == "limits"]
    assert said == (["`limits.force_n`", "`limits.acceleration_m_s2`"] if name == "friction-beam" else [])


def test_the_mode_is_that_of_the_rig(sound):
    modes = VirtualRig.shipped("magnet-beam").linear_modes
    mode = modes.nearest(24.0)
    assert sound.mode.frequency_hz == pytest.approx(modes.frequency_hz[mode], rel=1e-3)
    assert sound.mode.damping_ratio == pytest.approx(modes.damping_ratio[mode], rel=0.05)
    assert sound.mode.residue[0].real == pytest.approx(modes.drive_shape[mode] ** 2, rel=0.02)


def test_the_check_stays_far_below_the_limits(sound):
    with Recording(sound.recording) as recording:
        rows = recording.parts[-1].read(0, recording.parts[-1].n_rows)
    limits = sound.bench.limits
    assert 0.0 < np.abs(rows["output_v"]).max() < 0.01 * limits.voltage_v
    assert np.abs(rows["inputs"][:, 0]).max() < 0.01 * limits.force_n


def test_nothing_is_put_out_while_the_noise_is_listened_to(sound):
    with Recording(sound.recording) as recording:
        silent = recording.parts[0].read(0, round(2.9 * sound.bench.sample_rate_hz))
        driven = recording.parts[0].read(round(4.0 * sound.bench.sample_rate_hz), recording.parts[0].n_rows)
    assert not silent["output_v"].any()
    assert driven["output_v"].any()


@pytest.mark.parametrize("channel", ["drive", "acc_drive", "acc_magnet", "force"])
def test_a_sensor_that_is_turned_round_is_named(channel, tmp_path, monkeypatch):
    found = checked(tmp_path, monkeypatch, flipped(channel))
    assert finding(found, "polarity", channel).verdict == "fail"
    others = {"drive", "acc_drive", "acc_magnet", "force"} - {channel}
    assert {finding(found, "polarity", other).verdict for other in others} == {"ok"}


@pytest.mark.parametrize("pair", [("drive", "acc_magnet"), ("acc_drive", "acc_magnet"), ("drive", "acc_drive")])
def test_two_swapped_accelerometers_are_named(pair, tmp_path, monkeypatch):
    found = checked(tmp_path, monkeypatch, swapped(*pair))
    assert found.failed == tuple(f"place {channel}" for channel in pair)
    assert pair[1] in finding(found, "place", pair[0]).text


def test_a_load_cell_in_the_accelerometers_place_fails(tmp_path, monkeypatch):
    found = checked(tmp_path, monkeypatch, swapped("force", "drive"))
    assert finding(found, "power", "drive").verdict == "fail"
    assert "force and drive swapped" in finding(found, "frequency", "").text


@pytest.mark.parametrize("channel", ["force", "drive", "acc_magnet"])
@pytest.mark.parametrize("dead", [noise_only, constant])
def test_a_dead_channel_is_named_and_no_other(dead, channel, tmp_path, monkeypatch):
    assert checked(tmp_path, monkeypatch, dead(channel)).failed == (f"life {channel}",)


def test_a_dead_channel_does_not_raise_the_level(tmp_path, monkeypatch, sound):
    assert checked(tmp_path, monkeypatch, noise_only("acc_magnet")).level_rms_v == sound.level_rms_v


def test_a_load_cell_of_half_the_sensitivity_shows_in_every_size(tmp_path, monkeypatch):
    found = checked(tmp_path, monkeypatch, scaled("force", 0.5))
    assert finding(found, "size", "drive").value == pytest.approx(2.0, rel=0.03)
    assert found.failed == ("size drive", "size acc_drive", "size acc_magnet")


def test_two_sensors_that_move_alike_are_told_apart_by_nobody_without_a_reference(tmp_path, monkeypatch):
    found = checked(tmp_path, monkeypatch, swapped("acc_left", "acc_right"), "friction-beam")
    assert finding(found, "place", "acc_right").verdict == "not tested"


def test_against_a_reference_gains_are_compared_and_turned_drives_seen(tmp_path, monkeypatch, sound):
    found = checked(tmp_path, monkeypatch, None, reference=sound.recording)
    assert {f.verdict for f in found.findings if f.name == "gain"} == {"ok"}

    def turned(volts, bench):
        volts *= -1.2

    found = checked(tmp_path, monkeypatch, turned, reference=sound.recording)
    assert {f.channel for f in found.findings if f.name == "polarity" and f.verdict == "fail"} == {
        channel.name for channel in found.bench.channels
    }
    assert all(f.value == pytest.approx(1.2, rel=0.01) for f in found.findings if f.name == "gain")


def test_a_bench_without_shapes_says_what_it_cannot_tell(tmp_path, monkeypatch, sound):
    channels = [{**c, "mode_shape": None} for c in bench_with().model_dump()["channels"]]
    rewire(monkeypatch, swapped("acc_drive", "acc_magnet"))
    bench = bench_with({**BLOCK, "channels": channels})
    found = check(bench, tmp_path / "blind.h5")
    assert finding(found, "place", "acc_magnet").verdict == "not tested"
    assert not found.failed
    found = check(bench, tmp_path / "seeing.h5", reference=sound.recording)
    assert {"place acc_drive", "place acc_magnet"} <= set(found.failed)


def test_a_late_channel_is_told_in_samples(tmp_path, monkeypatch):
    kept = np.zeros(8)

    def late(volts, bench):
        column = np.concatenate([kept, volts[:, 3]])
        volts[:, 3], kept[:] = column[: len(volts)], column[len(volts) :]

    found = checked(tmp_path, monkeypatch, late)
    skew = finding(found, "skew", "acc_magnet")
    assert skew.verdict == "warn"
    assert "+8" in skew.text or "+7.9" in skew.text or "+7.8" in skew.text
    assert finding(found, "skew", "drive").verdict == "ok"


def test_only_the_recording_of_a_check_is_a_reference(tmp_path):
    (tmp_path / "other.h5").write_bytes(b"no recording")
    with refused(RecordingError, "other"):
        check(bench_with(BLOCK), tmp_path / "check.h5", reference=tmp_path / "other.h5")
    assert not (tmp_path / "check.h5").exists()


def test_a_reference_of_another_bench_is_refused_before_anything_moves(tmp_path, sound):
    with refused(RecordingError, "is-a-check-of-the-bench"):
        check("friction-beam", tmp_path / "check.h5", reference=sound.recording)
    assert not (tmp_path / "check.h5").exists()


def test_a_level_is_played_alone_and_below_one_step_it_is_said_what_would_do(tmp_path):
    bench = bench_with({**BLOCK, "output_resolution_v": 0.004})
    found = check(bench, tmp_path / "check.h5", level_rms_v=0.002)
    assert found.level_rms_v == 0.002
    with Recording(found.recording) as recording:
        assert len(recording.parts) == 1
    said = finding(found, "resolution", "")
    assert said.value == pytest.approx(0.5)
    assert "--level 0.016, 3 more bits, or 8 times less gain" in said.text
    assert not [f for f in check(bench_with(BLOCK), tmp_path / "fine.h5").findings if f.name == "resolution"]


@pytest.mark.parametrize(
    ("rms_steps", "said"), [(0.5, "8 times the gain of its conditioner, 3 more bits"), (0.1, "hardly shows")]
)
def test_a_channel_below_one_step_is_told_by_how_much_gain_or_how_many_bits_would_do(rms_steps, said):
    bench = bench_with()
    rows = np.zeros(1000, [("inputs", "f4", len(bench.channels))])
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(1000) / 100.0)
    for index, channel in enumerate(bench.channels):
        steps = rms_steps if channel.role == "force" else 50.0
        rows["inputs"][:, index] = wave * np.hypot(steps * channel.resolution_in_unit, channel.noise_rms)
    (found,) = resolution_findings(bench, 1.0, rows)
    assert (found.channel, found.verdict) == ("force", "warn")
    assert found.value == pytest.approx(rms_steps, rel=1e-3)
    assert said in found.text


def test_the_table_names_what_to_do(tmp_path, monkeypatch, capsys):
    print_summary(summary(checked(tmp_path, monkeypatch, flipped("acc_magnet"))))
    out = capsys.readouterr().out
    assert "fail: polarity acc_magnet: reversed: turn the sign of its sensitivity" in out
    assert "failed: " in out.splitlines()[-1]


def test_the_command_writes_json_and_a_figure_and_ends_with_one_where_it_fails(command, tmp_path, monkeypatch):
    rewire(monkeypatch, noise_only("drive"))
    (tmp_path / "b.toml").write_text('base = "magnet-beam"\nblock = 50\n')
    done = command("check --bench b.toml -o c.h5 --figure c.png --json")
    assert done.status == 1
    assert json.loads(done.out)["failed"] == ["life drive"]
    assert (tmp_path / "c.png").stat().st_size > 10_000


def test_show_and_plot_know_a_check(command, sound, tmp_path):
    shown = command("show", sound.recording, "--json").succeeded()
    assert json.loads(shown.out)["verdict"] == "passed"
    command("plot", sound.recording, "-o", "c.pdf").succeeded()
    assert (tmp_path / "c.pdf").stat().st_size > 10_000
