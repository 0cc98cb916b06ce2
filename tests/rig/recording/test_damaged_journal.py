"""A journal with changed bytes: what is lost is told, what is not lost stays, and only what is missing is measured again."""

import json

import numpy as np
import pytest

import rig
from rig.arming.run_options import Silent
from rig.recording.blocks import BlockKind
from rig.recording.journal import journal_path
from rig.recording.journal_blocks import JournalBlocks
from rig.recording.reader import Recording
from tests.rig.campaigns.running.test_runs import plan_with

PLAN = plan_with(levels_v=(0.4, 0.8))


class Listening(Silent):
    def __init__(self):
        self.told = []

    def remark(self, text):
        self.told.append(text)


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """A recording of two points that is still a journal."""
    output = tmp_path / "run.h5"
    with monkeypatch.context() as patch:
        patch.setattr("rig.campaigns.running.runner.finalise", lambda *_: None)
        rig.run(PLAN, output=output, seed=3).close()
    return output


def damage(output, kind, which):
    """Change one bit in the payload of the block of a kind."""
    blocks = [block for block in JournalBlocks(journal_path(output)) if block.kind is kind]
    data = bytearray(journal_path(output).read_bytes())
    data[blocks[which].offset + len(blocks[which].payload) // 2] ^= 4
    journal_path(output).write_bytes(data)
    return blocks[which]


def test_a_lost_block_of_rows_costs_its_rows_and_no_point(command, recorded):
    with Recording(recorded) as recording:
        n_rows, points = recording.n_rows, recording.points
        before = recording.parts[0].read(0, n_rows)
    block = damage(recorded, BlockKind.ROWS, 4)
    lost = len(block.payload) // before.dtype.itemsize
    with Recording(recorded) as recording:
        assert recording.points == points
        after = recording.parts[0].read(0, n_rows)
    missing = np.isnan(after["theta_rad"])
    assert np.array_equal(np.flatnonzero(missing), np.arange(block.row, block.row + lost))
    assert after[~missing].tobytes() == before[~missing].tobytes()
    told = f"rows {block.row} to {block.row + lost - 1}, which are not numbers now"
    for options in ([], ["--json"]):
        shown = command("show", recorded, *options).succeeded().out
        assert told in shown
    assert json.loads(shown)["parts"][0]["bytes_lost"] == 36 + len(block.payload)
    with rig.resume(recorded) as run:
        assert run.complete
        assert len(run.recording.parts) == 1
        assert told in run.recording.parts[0].dropped_reason


def test_a_lost_point_is_told_and_measured_again_alone(recorded, capsys):
    damage(recorded, BlockKind.POINT, 0)
    with Recording(recorded) as recording:
        assert [point["number"] for point in recording.points] == [1]
        kept = recording.points[0]
    progress = Listening()
    with rig.resume(recorded, progress=progress) as run:
        assert run.complete
        assert [(point["number"], point["part"]) for point in run.recording.points] == [(1, 0), (0, 1)]
        assert run.recording.points[0] == kept
    assert "1 block of" in progress.told[0]
    assert "measured again" in progress.told[0]
    assert progress.told[-1].startswith("the journal was damaged and is kept as run.h5.journal.damaged")
