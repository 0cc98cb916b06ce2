"""Spoilt files of every kind are refused, read as they were, or what is lost is told; the long run is a command."""

from collections import Counter

import pytest

from tests.reliability.mutations.files import (
    FILE_KINDS,
    SpoiltFile,
    contents_of,
    judge_file,
    originals,
    spoilt_files,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    found = originals(folder)
    assert set(found) == set(FILE_KINDS)
    return found, contents_of(found, folder)


@pytest.mark.slow
def test_no_spoilt_file_is_read_with_other_content_unless_that_is_told(tmp_path, whole):
    data, content = whole
    outcomes = Counter()
    for spoilt in spoilt_files(120, 1, data):
        verdict = judge_file(spoilt, tmp_path, content)
        assert verdict.outcome != "misbehaved", (spoilt.kind, spoilt.mutation, verdict.text)
        outcomes[verdict.outcome] += 1
    assert outcomes["refused"] > 30
    assert outcomes["told"] > 6


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_what_is_not_spoilt_is_identical(tmp_path, whole, kind):
    data, content = whole
    assert judge_file(SpoiltFile(kind, "", data[kind]), tmp_path, content).outcome == "identical"


def test_content_that_changes_without_a_word_is_found_out(tmp_path, whole):
    data, content = whole
    other = content | {"journal": "what it was"}
    assert judge_file(SpoiltFile("journal", "", data["journal"]), tmp_path, other).outcome == "misbehaved"
