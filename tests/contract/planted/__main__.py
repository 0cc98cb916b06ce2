"""Write the table of planted faults into its page: ``python -m tests.contract.planted docs/reference/daq-contract.md``."""

import sys
from pathlib import Path

from tests.contract.planted.table import written

if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(written(page.read_text(encoding="utf-8")), encoding="utf-8")
