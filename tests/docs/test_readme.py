"""The README's commands for a bench, as they stand there and with their defaults, on a virtual bench in the device's place."""

from pathlib import Path

import pytest

from tests.docs.pages import ROOT, blocks, rig_commands

ON_A_BENCH = next(
    block for block in blocks(ROOT / "README.md") if block.not_run == "needs the device" and block.language == "bash"
)


@pytest.mark.slow
def test_check_rehearsal_and_run_of_the_readme_go_through_with_their_defaults(command):
    Path("bench.toml").write_text('base = "magnet-beam"\n')
    printed = [command(*words).succeeded() for words in rig_commands(ON_A_BENCH)]
    assert [words[0] for words in rig_commands(ON_A_BENCH)] == ["doctor", "check", "rehearse", "run"]
    assert "rehearsed on " in printed[2].out
    assert all(Path(f"{name}.h5").exists() for name in ("check", "rehearsal", "backbone"))
