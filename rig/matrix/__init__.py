"""Ways to run a test, side by side: what each was measured to do, and what was verified of it (``rig doctor --matrix``)."""

from rig.matrix.rows import Row, Verified, read_rows, write_rows

__all__ = ["Row", "Verified", "read_rows", "write_rows"]
