"""The page of the fault matrix has the matrix's rows."""

from dataclasses import replace

import pytest

from tests.docs.pages import ROOT
from tests.reliability.faults.matrix import CASES
from tests.reliability.faults.observing import observe
from tests.reliability.faults.page import BEGIN, END, TABLES, rows_of, written

PAGE = ROOT / "docs" / "reference" / "fault-matrix.md"


@pytest.mark.parametrize("heading", TABLES)
def test_the_page_has_a_row_for_every_fault_of_the_matrix_and_no_other(heading):
    device, columns = TABLES[heading]
    wanted = {case.fault.name for case in CASES if case.device == device and case.levels in columns}
    assert rows_of(PAGE.read_text(encoding="utf-8"), heading) == wanted


def test_a_cell_says_what_was_seen_and_marks_what_keeps_no_bound():
    case = next(case for case in CASES if case.name == "force-nan-middle, N logarithmic, virtual")
    seen = observe(*case)
    empty = f"before\n{BEGIN}\n{END}\nafter\n"
    good = written(empty, {case: seen})
    bad = written(good, {case: replace(seen, output_v=9.5, healthy_output_v=1.0)})
    assert good.startswith("before\n")
    assert good.endswith("\nafter\n")
    assert "non finite input, 0 / 502 ms |" in good
    assert "9.50, " in bad
    assert bad.count("**(!)** |") == 1
    assert good.count("**(!)** |") == 0
