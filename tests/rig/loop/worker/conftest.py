"""The test drivers as an installed package, for this process and those it starts."""

import pytest


@pytest.fixture
def noting(tmp_path, monkeypatch):
    folder = tmp_path / "site" / "noting-1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: noting\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[vibrolock.drivers]\nnoting = tests.rig.loop.worker.drivers:NotingDAQ\n")
    monkeypatch.syspath_prepend(str(folder.parent))
    return folder.parent
