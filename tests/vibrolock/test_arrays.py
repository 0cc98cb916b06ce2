"""Rows are copied as bytes with the same content as field by field."""

import numpy as np

from vibrolock.arrays import undivided

ROW = np.dtype([("count", "u1"), ("value", "f8"), ("factor", "c8")])


def test_rows_are_copied_with_every_field():
    rows, copied = np.zeros(5, ROW), np.zeros(5, ROW)
    rows["count"], rows["value"], rows["factor"] = np.arange(5), np.nan, 1j * np.arange(5)
    undivided(copied)[1:] = undivided(rows)[:-1]
    assert copied[0] == np.zeros((), ROW)
    assert copied[1:].tobytes() == rows[:-1].tobytes()


def test_numbers_in_rows_are_one_element_a_row():
    assert undivided(np.arange(6, dtype=np.float32).reshape(3, 2)).shape == (3,)
    assert undivided(np.zeros((0, 4), np.float32)).shape == (0,)
