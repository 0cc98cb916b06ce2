"""TOML files of users: whatever stands in them, they are read at once or refused in one clear line."""

import os
import time

import pytest

from rig.arming.bench_memory import memory_of, memory_path
from rig.bench import load_bench
from rig.bench.configuration import read_toml
from rig.campaigns.plans import load_plan, plan_from
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from rig.exchange.reading import import_file, read_mapping
from rig.wire.can.layout import compile_layout
from tests.refused import refused


def refusal(use, *arguments):
    """The line that an answer within two seconds of CPU time consists of, without marks around keys."""
    began = time.process_time()
    with pytest.raises(ConfigurationError) as caught:
        use(*arguments)
    assert time.process_time() - began < 2.0
    line = str(caught.value)
    assert line.isprintable()
    assert len(line) < 1000
    return line.replace("`", "")


@pytest.mark.parametrize("read", [read_toml, load_plan, load_bench, read_mapping, compile_layout])
def test_a_fifo_a_device_and_a_folder_are_refused_without_waiting(tmp_path, read):
    os.mkfifo(tmp_path / "fifo.toml")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "device.toml").symlink_to("/dev/zero")
    for name, kind in (("fifo", "FIFO"), ("folder", "folder"), ("device", "device")):
        assert f"{name}.toml: is a {kind}" in refusal(read, tmp_path / f"{name}.toml")


def test_a_table_or_universal_file_that_is_a_fifo_is_refused_without_waiting(tmp_path):
    from rig.exchange.child_reading import ImportFailed

    for name in ("fifo.csv", "fifo.uff"):
        os.mkfifo(tmp_path / name)
        with refused(ImportFailed, "is-allowed-is-regular-file"):
            import_file(tmp_path / name)


def test_a_bench_memory_that_is_a_fifo_counts_as_a_trip(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    bench = load_bench("magnet-beam")
    memory_path(bench).parent.mkdir(parents=True)
    os.mkfifo(memory_path(bench))
    trip = memory_of(bench).trip
    assert trip is not None
    assert "is a FIFO" in trip.text


def test_a_file_of_more_than_a_megabyte_is_refused_by_its_size(tmp_path):
    with (tmp_path / "large.toml").open("wb") as stream:
        stream.truncate(100_000_000)
    assert "has 100000000 bytes" in refusal(read_toml, tmp_path / "large.toml")


def test_a_name_that_no_file_can_have_is_refused(tmp_path):
    assert "is not the name of a file" in refusal(load_plan, "a\0b.toml")
    assert "File name too long" in refusal(load_plan, f"{'a' * 300}.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"a = " + b"[" * 50_000 + b"]" * 50_000, "is nested too deeply"),
        (b"a = " + b"{a=" * 5_000 + b"1" + b"}" * 5_000, "is nested too deeply"),
        (b"a = " + b"[" * 40 + b"]" * 40, "is nested too deeply; allowed: up to 16 levels"),
        (b"[" + b".".join([b"a"] * 40) + b"]", "is nested too deeply; allowed: up to 16 levels"),
        (b".".join([b"a"] * 400_000) + b" = 1", "line 1: a key has too many parts; allowed: up to 100"),
        (b"a = " + b"9" * 5_000, "is not TOML: Exceeds the limit"),
        (b"a = 0x" + b"f" * 5_000, "a = '20000 bits'; allowed: up to 9223372036854775807"),
        (b"a = 1e300", "a = 1e+300; allowed: 0, or a size from 1e-30 to 1e+30"),
        (b"[b]\na = [1.0, 5e-324]", "b.a[1] = 4.94066e-324; allowed: 0"),
        (b"a = nan", "a = nan; allowed: a finite number"),
        (b"a = '\xff'", "is not UTF-8 text (byte 5: invalid start byte)"),
        (b"a = '\0'", "is not TOML"),
        (b'a = "\\u001b[31m"', r"a = '\x1b[31m'; allowed: printable text, without control characters"),
        (b'"\\u0000" = 1', r"holds the key '\x00'"),
        (b"k" * 5_000 + b" = 1", "... (5000 characters); allowed: printable names of up to 200 characters"),
    ],
)
def test_what_no_table_may_hold_is_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "file.toml").write_bytes(text)
    line = refusal(read_toml, tmp_path / "file.toml")
    assert "file.toml: " in line
    assert said in line


@pytest.mark.parametrize("value", [{}, [], 1, True, [{}]])
@pytest.mark.parametrize("key", ["kind", "bench", "controller", "levels_v"])
def test_a_discriminator_of_another_type_is_refused(key, value):
    table = load_plan("magnet-beam/backbone").model_dump(mode="json", exclude_none=True)
    assert key in refusal(plan_from, {**table, key: value}, "plan.toml")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ("base = {}", "base = {}; allowed:"),
        ("base = 'magnet-beam'\ndriver = 'virtual'", "driver = 'virtual'; allowed:"),
        ("base = 'magnet-beam'\ndriver.name = {}", "driver.name = {}; allowed:"),
        ("base = 'magnet-beam'\ndriver.options.structure = 1", "structure = 1; allowed:"),
        ("base = 'magnet-beam'\ndriver.options.structure.kind = {}", "structure.kind = '{}'; allowed: 'beam'"),
        ("base = 'magnet-beam'\ndriver.options.structure.length_m = 1e29", "driver.options: "),
        ("base = 'magnet-beam'\ndriver.options.structure.thickness_m = 1e-29", "cannot be computed with these numbers"),
        ("base = 'magnet-beam'\ndriver.options.specimen = {}", "specimen"),
    ],
)
def test_a_rig_of_wrong_types_or_that_cannot_be_computed_is_refused(tmp_path, changes, said):
    (tmp_path / "bench.toml").write_text(f"{changes}\n")
    assert said in refusal(lambda: make_daq(load_bench(tmp_path / "bench.toml")))


def test_a_line_names_a_few_of_many_faults_and_says_how_many_there_are():
    table = {"kind": "backbone", "bench": "b", "levels_v": ["x"] * 9_000, "controller": {}}
    line = refusal(plan_from, table, "plan.toml")
    assert line.startswith("plan.toml: levels_v[0] = 'x'; allowed: a number in V; levels_v[1]")
    assert line.endswith("; and 8997 more")


def test_a_long_value_is_shortened_and_what_is_allowed_stays():
    table = {"kind": "backbone", "bench": "b", "levels_v": [1.0], "repeats": "a" * 9_000, "controller": []}
    line = refusal(plan_from, table, "plan.toml")
    assert f"repeats = '{'a' * 30}'... (9000 characters); allowed: a valid integer" in line
