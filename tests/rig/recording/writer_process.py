"""Writes a journal until it is killed; reports on its standard output, eight bytes each, how many rows are written."""

import os
import random
import struct
import sys
from pathlib import Path

from rig.recording.journal import JournalWriter
from tests.rig.recording.samples import header, rows


def main() -> None:
    path, first, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    chance = random.Random(seed)
    # The one before may have been killed before its first row: its journal is there all the same.
    writer = JournalWriter.reopen(path) if Path(path).exists() else JournalWriter.create(path, header())
    made = rows(first, first + 200_000)
    if writer.n_rows != first:
        sys.exit(f"{writer.n_rows} rows found, {first} expected")
    writer.part({"first_sample": first})
    written = 0
    os.write(1, struct.pack("<q", first))
    while written < len(made):
        n = chance.choice((1, 10, 100, 5000))
        writer.rows(made[written : written + n])
        written = min(written + n, len(made))
        os.write(1, struct.pack("<q", first + written))


if __name__ == "__main__":
    main()
