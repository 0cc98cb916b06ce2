"""`rig doctor --daq` and `--matrix` as a person sees them; what they measure is tested beside rig.loop and studies.matrix."""

import json

import pytest

from rig.emulator.emulated import emulated
from studies.matrix.rows import read_rows, write_rows
from tests.rig.rigs import bench_with
from tests.studies.matrix.test_rows import THEIRS, row

FOUND = {
    "driver": "serial",
    "block": 1,
    "remarks": ["outputs were held in 23 of 4968 blocks: they came too late", "4895 of 5000 samples a second"],
    "examined_s": 4.3,
    "recommendation": {
        "settings": {"block": 1, "queue_blocks": 32, "watchdog_s": 0.12, "largest_rate_hz": 5000.0},
        "differs": {"queue_blocks": 32, "watchdog_s": 0.12},
        "reasons": {"block": "it computes", "queue_blocks": "lasts 6.4 ms", "largest_rate_hz": "the device"},
        "delay_s": 0.0066,
        "tried": [
            {
                "block": 1,
                "queue_blocks": 32,
                "sample_rate_hz": 5000.0,
                "blocks": 5000,
                "held_blocks": 0,
                "lost_blocks": 0,
            }
            | {"reached_hz": 4999.9},
            {"block": 1, "queue_blocks": 1, "sample_rate_hz": 9000.0, "failure": "DaqRefused: no"},
        ],
        "bench_lines": ["[driver.options]", "queue_blocks = 32", "watchdog_s = 0.12"],
    },
}


def test_settings_stand_with_unit_and_reason_and_lines_for_the_bench_behind(command, monkeypatch):
    monkeypatch.setattr("rig.loop.doctor.examine_bench", lambda bench, seconds: FOUND | {"seconds": seconds})
    status, out, _ = command("doctor --daq magnet-beam --seconds 7")
    assert status == 0
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "remarks outputs were held in 23 of 4968 blocks: they came too late; 4895 of 5000 samples a second" in lines
    assert "examined s 4.3" in lines
    assert "seconds 7.0" in lines
    assert "queue blocks 32 blocks lasts 6.4 ms" in lines
    assert "watchdog s 0.12 s" in lines
    assert "delay of the loop 6.6 ms" in lines
    assert (
        "tried, at 0 V block 1, queue_blocks 32, sample_rate_hz 5000: 0 of 5000 blocks held, 0 lost, 4999.9 Hz reached"
        in lines
    )
    assert "tried, at 0 V block 1, queue_blocks 1, sample_rate_hz 9000: DaqRefused: no" in lines
    assert lines[-4:] == ["for the bench file", "[driver.options]", "queue_blocks = 32", "watchdog_s = 0.12"]


def test_a_device_in_software_is_examined_in_a_process_of_its_own_and_its_row_is_written(command, tmp_path):
    """Over an emulator by the clock: the numbers are the machine's, what is there is not."""
    with emulated(bench_with({"block": 100}), "serial", lockstep=False) as bench:
        options = bench.driver.options
        text = f'base = "magnet-beam"\nblock = 100\n[driver]\nname = "serial"\noptions.port = "{options["port"]}"\n'
        (tmp_path / "bench.toml").write_text(text)
        status, out, _ = command("doctor --daq bench.toml --json -o row.toml")
    assert status == 0
    facts = json.loads(out)
    assert {"late_us", "driver_us", "queue_blocks", "held_blocks", "counters", "statistics"} <= set(facts)
    advice = facts["recommendation"]
    assert set(advice["settings"]) == {"block", "queue_blocks", "watchdog_s", "largest_rate_hz"}
    assert set(advice["reasons"]) == set(advice["settings"])
    assert advice["settings"]["largest_rate_hz"] <= 5000.0
    assert advice["tried"]
    (measured,) = read_rows(tmp_path / "row.toml")
    assert measured.device == "vibrolock emulator 1.0"
    assert (measured.block, measured.to_0v, measured.verified) == (100, "reported", None)


def test_rows_of_others_are_shown_beside_those_that_are_measured_and_are_not_written(command, monkeypatch, tmp_path):
    asked = []

    def measured(bench, firmware, *, verify):
        asked.append((bench.name, firmware, verify))
        return iter([row("virtual"), row("serial")])

    monkeypatch.setattr("studies.matrix.command.matrix_rows", measured)
    write_rows(tmp_path / "theirs.json", [row("a board", **THEIRS)])
    status, out, err = command("doctor --matrix theirs.json --firmware fw.elf --verify -o ours.toml")
    assert status == 0
    assert all(name in out for name in ("virtual", "serial", "a board", "bench their-beam"))
    assert err.splitlines() == ["measured: virtual", "measured: serial"]
    assert [one.way for one in read_rows(tmp_path / "ours.toml")] == ["virtual", "serial"]
    assert [(name, [path.name for path in firmware], verify) for name, firmware, verify in asked] == [
        ("magnet-beam", ["fw.elf"], True)
    ]
    status, out, _ = command("doctor --matrix theirs.json --json")
    assert [one["way"] for one in json.loads(out)["row"]] == ["virtual", "serial", "a board"]


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("doctor theirs.toml", "theirs.toml: allowed with --matrix alone"),
        ("doctor --verify", "--verify: allowed with --matrix alone"),
        ("doctor --firmware fw.elf", "fw.elf: allowed with --matrix alone"),
        ("doctor -o row.toml", "-o row.toml: allowed with --matrix or --daq"),
        ("doctor --matrix -o row.csv", "allowed is a file .toml or .json"),
        ("doctor --matrix nothing.toml", "nothing.toml: cannot be read as rows"),
    ],
)
def test_what_has_no_effect_or_cannot_be_read_is_refused_before_anything_is_measured(command, monkeypatch, line, named):
    monkeypatch.setattr("studies.matrix.command.matrix_rows", lambda *arguments, **keys: pytest.fail("was measured"))
    status, _, err = command(line)
    assert status == 1
    assert named in " ".join(err.split())
