import json
import struct
import subprocess
import sys
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from rig.errors import RecordingError
from rig.recording import appending
from rig.recording.blocks import LARGEST_PAYLOAD, BlockKind
from rig.recording.conversion import finalise
from rig.recording.header import Column
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.journal_blocks import JournalBlocks
from rig.recording.journal_contents import JournalContents
from rig.recording.reader import Recording
from tests.refused import refused
from tests.rig.recording.samples import COLUMNS, ROW, all_rows, fill, header, journal, rows

HEAD = 36


def blocks_by_hand(data):
    """An independent reading of the documented layout: (kind, sequence, payload) of every block, and where each belongs."""
    found, position, part, row = [], 0, 0, 0
    while position < len(data):
        magic, version, kind, length, sequence, of_part, before, crc = struct.unpack_from("<4sHHIQIQI", data, position)
        payload = data[position + HEAD : position + HEAD + length]
        assert (magic, version) == (b"VLJB", 2)
        assert crc == zlib.crc32(data[position : position + HEAD - 4] + payload)
        if kind == 2 and (not found or found[-1] != (2, sequence - 1, payload)):
            part, row = part + 1, 0
        assert (of_part, before) == (part, row)
        row += length // ROW.itemsize if kind == 3 else 0
        found.append((kind, sequence, payload))
        position += HEAD + length
    return found


def packed_by_hand(blocks, version=2):
    """The bytes of blocks (kind, payload) with right checksums, as documented for a version."""
    data, part, row = b"", 0, 0
    for sequence, (kind, payload) in enumerate(blocks):
        if kind == 2 and (version == 1 or sequence == 0 or blocks[sequence - 1] != (kind, payload)):
            part, row = part + 1, 0
        head = struct.pack("<4sHHIQ", b"VLJB", version, kind, len(payload), sequence)
        head += struct.pack("<IQ", part, row) if version == 2 else b""
        data += head + struct.pack("<I", zlib.crc32(head + payload)) + payload
        row += len(payload) // ROW.itemsize if kind == 3 else 0
    return data


def test_the_journal_of_a_recording_lies_beside_it(tmp_path):
    assert journal_path(tmp_path / "OUT.h5") == tmp_path / "OUT.h5.journal"


def test_a_journal_has_the_documented_layout(tmp_path):
    path = journal(tmp_path / "a.journal", 250)
    found = blocks_by_hand(path.read_bytes())
    assert [kind for kind, _, _ in found] == [1, 1, 2, 2, 4, 3, 3, 3, 5, 6]
    assert [sequence for _, sequence, _ in found] == list(range(10))
    assert found[0][2] == found[1][2]
    assert found[2][2] == found[3][2]
    assert json.loads(found[0][2])["configuration"] == header().configuration
    assert json.loads(found[8][2])["harmonics"] == [1.0, 0.5]
    assert b"".join(payload for kind, _, payload in found if kind == 3) == rows(0, 250).tobytes()


def test_rows_come_back_bit_for_bit_with_nan_payloads_and_negative_zero(tmp_path):
    noise = np.random.default_rng(5).bytes(3000 * ROW.itemsize)
    written = np.frombuffer(noise, ROW).copy()
    written["locked"] = written["sample"] % 2 == 0
    written["frequency_hz"][:2] = [-0.0, np.frombuffer(b"\x01\x02\x03\x04\x05\x06\xf8\x7f", "<f8")[0]]
    with JournalWriter.create(tmp_path / "a.journal", header()) as writer:
        writer.part({})
        writer.rows(written)
    with JournalContents(tmp_path / "a.journal") as contents:
        assert all_rows(contents.parts[0]).tobytes() == written.tobytes()


def test_padded_and_big_endian_rows_are_stored_packed_and_little_endian(tmp_path):
    padded = np.dtype([(name, ROW[name].newbyteorder(">")) for name in ROW.names], align=True)
    given_rows = np.zeros(10, padded)
    for name in ROW.names:
        given_rows[name] = rows(0, 10)[name]
    with JournalWriter.create(tmp_path / "a.journal", header(row_dtype=padded)) as writer:
        assert writer.header.row_dtype == ROW
        writer.part({})
        writer.rows(given_rows)
    with JournalContents(tmp_path / "a.journal") as contents:
        assert all_rows(contents.parts[0]).tobytes() == rows(0, 10).tobytes()


@pytest.mark.parametrize(("start", "stop"), [(0, None), (95, 305), (-7, None), (100, 200), (300, 100), (5, 10**9)])
def test_any_stretch_of_rows_is_read_as_a_slice(tmp_path, start, stop):
    with JournalContents(journal(tmp_path / "a.journal", 1000)) as contents:
        assert np.array_equal(contents.parts[0].rows("inputs", start, stop), rows(0, 1000)["inputs"][start:stop])


def test_a_large_array_becomes_blocks_that_a_reader_accepts(tmp_path):
    many = rows(0, 100_000)
    with JournalWriter.create(tmp_path / "a.journal", header()) as writer:
        writer.part({})
        writer.rows(many)
        assert writer.n_rows == 100_000
    sizes = [len(block.payload) for block in JournalBlocks(tmp_path / "a.journal") if block.kind is BlockKind.ROWS]
    assert len(sizes) > 1
    assert max(sizes) <= LARGEST_PAYLOAD
    assert sum(sizes) == many.nbytes


def test_what_was_written_is_readable_while_the_writer_is_still_open(tmp_path):
    with JournalWriter.create(tmp_path / "a.journal", header()) as writer:
        fill(writer, 0, 300, completed=None)
        with JournalContents(tmp_path / "a.journal") as contents:
            assert contents.parts[0].n_rows == 300
            assert contents.parts[0].end is None


def test_a_torn_tail_is_cut_off_and_the_sequence_goes_on(tmp_path):
    path = journal(tmp_path / "a.journal", 1000)
    whole = path.read_bytes()
    path.write_bytes(whole[:-5])
    with JournalWriter.reopen(path) as writer:
        assert writer.dropped.n_bytes == len(whole) - 5 - sum(HEAD + len(b[2]) for b in blocks_by_hand(whole)[:-1])
        assert "the file ends within a block" in writer.dropped.reason
        assert (writer.n_rows, writer.n_points, writer.n_parts) == (1000, 1, 1)
        fill(writer, 1000, 200)
    found = blocks_by_hand(path.read_bytes())
    assert [sequence for _, sequence, _ in found] == list(range(len(found)))
    assert not list(tmp_path.glob("*.damaged*"))
    with JournalContents(path) as contents:
        assert [part.n_rows for part in contents.parts] == [1000, 200]
        assert [part.end is None for part in contents.parts] == [True, False]


def test_damage_amid_the_file_is_told_and_what_follows_it_is_kept(tmp_path):
    path = journal(tmp_path / "a.journal", 1000)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with JournalWriter.reopen(path) as writer:
        assert writer.dropped.n_bytes == 0
        assert (writer.n_rows, writer.n_points, writer.n_parts) == (1000, 1, 1)
        fill(writer, 1000, 200)
    assert path.read_bytes()[: len(data)] == data
    with JournalContents(path) as contents:
        assert contents.damaged
        assert [part.n_rows for part in contents.parts] == [1000, 200]
        told = contents.parts[0].dropped_reason
        assert "1 block of" in told
        assert "checksum does not match (at byte" in told
        assert "which are not numbers now" in told
        assert contents.parts[1].dropped_reason == ""


@pytest.mark.parametrize("where", [0, 20, 33, 50])
def test_a_changed_byte_costs_its_block_and_nothing_else_whichever_it_is(tmp_path, original, where):
    path, position, whole = tmp_path / "a.journal", 0, blocks_by_hand(original)
    for index, (kind, _, payload) in enumerate(whole):
        data = bytearray(original)
        data[position + min(where, HEAD + len(payload) - 1)] ^= 0x40
        path.write_bytes(data)
        position += HEAD + len(payload)
        with JournalContents(path) as contents:
            last = index == len(whole) - 1
            assert contents.damaged is not last
            assert sum(part.dropped_bytes for part in contents.parts) == HEAD + len(payload)
            assert [part.n_rows for part in contents.parts] == [40, 30]
            got = np.concatenate([all_rows(part) for part in contents.parts])
            points = sum(len(part.points) for part in contents.parts)
            ends = sum(part.end is not None for part in contents.parts)
        lost = len(payload) // ROW.itemsize if kind == 3 else 0
        assert np.isnan(got["frequency_hz"]).sum() == lost
        good = np.isfinite(got["frequency_hz"])
        assert got[good].tobytes() == rows(0, 70)[good].tobytes()
        assert points == 2 - (kind == 5)
        assert ends == 2 - (kind == 6)


def test_where_the_beginning_of_a_part_is_lost_twice_the_other_parts_are_read_and_it_is_told(tmp_path, original):
    kinds = [kind for kind, _, _ in blocks_by_hand(original)]
    data, position = bytearray(original), 0
    for index, (_, _, payload) in enumerate(blocks_by_hand(original)):
        if kinds[index] == 2 and index > 5:
            data[position + HEAD] ^= 1
        position += HEAD + len(payload)
    path = tmp_path / "a.journal"
    path.write_bytes(data)
    with JournalContents(path) as contents:
        assert [part.n_rows for part in contents.parts] == [40]
        assert "the beginning of part 2" in contents.parts[0].dropped_reason


def test_of_a_long_part_without_its_beginning_one_line_is_told_and_the_rest_becomes_a_file(tmp_path):
    path = journal_path(tmp_path / "OUT.h5")
    with JournalWriter.create(path, header()) as writer:
        fill(writer, 0, 40)
        fill(writer, 40, 3000, block=1)
    data, position = bytearray(path.read_bytes()), 0
    for index, (kind, _, payload) in enumerate(blocks_by_hand(data[:])):
        if kind == 2 and index > 5:
            data[position + HEAD] ^= 1
        position += HEAD + len(payload)
    path.write_bytes(data)
    finalise(path, tmp_path / "OUT.h5")
    with Recording(tmp_path / "OUT.h5") as recording:
        assert recording.n_rows == 40
        told = recording.parts[0].dropped_reason
    assert told.count("the beginning of part 2 is lost") == 1
    assert "3003 blocks of" in told


def test_of_many_gaps_the_first_are_told_one_by_one_and_the_file_is_made(tmp_path):
    path = journal_path(tmp_path / "OUT.h5")
    with JournalWriter.create(path, header()) as writer:
        fill(writer, 0, 2000, block=1)
    data, position = bytearray(path.read_bytes()), 0
    for index, (kind, _, payload) in enumerate(blocks_by_hand(data[:])):
        if kind == 3 and index % 2:
            data[position + HEAD] ^= 1
        position += HEAD + len(payload)
    path.write_bytes(data)
    finalise(path, tmp_path / "OUT.h5")
    with Recording(tmp_path / "OUT.h5") as recording:
        assert np.isnan(recording.parts[0].rows("frequency_hz")).sum() == 1000
        told = recording.parts[0].dropped_reason
    assert told.count("1 block of") == 20
    assert told.endswith("and more of the kind")


def test_a_block_that_tells_of_rows_without_end_is_not_believed(tmp_path, original):
    head = struct.pack("<4sHHIQIQ", b"VLJB", 2, 4, 2, 10**6, 2, 2**60)
    path = tmp_path / "a.journal"
    path.write_bytes(original[:-70] + head + struct.pack("<I", zlib.crc32(head + b"{}")) + b"{}")
    with refused(RecordingError, "rows-before-it-are-missing"):
        JournalContents(path)


def test_a_journal_of_blocks_of_version_1_is_read_up_to_its_first_damage(tmp_path, original):
    blocks = [(kind, payload) for kind, _, payload in blocks_by_hand(original)]
    once = [block for index, block in enumerate(blocks) if block[0] > 2 or block != blocks[index - 1]]
    path = tmp_path / "a.journal"
    path.write_bytes(packed_by_hand(once, version=1))
    with JournalContents(path) as contents:
        assert not contents.damaged
        assert np.concatenate([all_rows(part) for part in contents.parts]).tobytes() == rows(0, 70).tobytes()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with JournalContents(path) as contents:
        assert contents.damaged
        assert 0 < sum(part.n_rows for part in contents.parts) < 70
        assert "checksum" in contents.parts[-1].dropped_reason


@pytest.mark.skipif(sys.platform == "win32", reason="Windows removes no open file")
@pytest.mark.parametrize("gone", ["removed", "renamed", "folder removed"])
def test_a_journal_that_loses_its_name_while_it_is_written_is_noticed_and_saved(tmp_path, monkeypatch, gone):
    now = [100.0]
    monkeypatch.setattr(appending.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(appending.tempfile, "tempdir", str(tmp_path))
    folder = tmp_path / "results"
    folder.mkdir()
    path = folder / "a.journal"
    with JournalWriter.create(path, header()) as writer:
        writer.part({})
        writer.rows(rows(0, 100))
        if gone == "renamed":
            path.rename(folder / "b.journal")
        else:
            path.unlink()
        if gone == "folder removed":
            folder.rmdir()
        writer.rows(rows(100, 150))
        now[0] += 0.6
        with refused(RecordingError, "was-removed-or-renamed-while-it") as told:
            writer.rows(rows(150, 200))
        with refused(RecordingError, "closed"):
            writer.rows(rows(200, 250))
    place = {"removed": path, "renamed": folder / "b.journal"}.get(gone) or next(tmp_path.glob("vibrolock-*/a.journal"))
    assert gone == "renamed" or str(place) in str(told.value)
    with JournalContents(place) as contents:
        assert all_rows(contents.parts[0]).tobytes() == rows(0, 200).tobytes()


def test_a_tail_of_zeros_as_a_power_cut_leaves_it_is_torn(tmp_path):
    path = journal(tmp_path / "a.journal", 300)
    path.write_bytes(path.read_bytes() + bytes(5000))
    blocks = JournalBlocks(path)
    assert sum(1 for _ in blocks) == 9
    assert (blocks.tail.n_bytes, blocks.tail.torn) == (5000, True)


def test_an_interrupted_journal_is_never_overwritten(tmp_path):
    path = journal(tmp_path / "a.journal", 100)
    before = path.read_bytes()
    with refused(RecordingError, "exists-already"):
        JournalWriter.create(path, header())
    assert path.read_bytes() == before


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no advisory locks")
def test_a_journal_has_one_writer_at_a_time(tmp_path):
    with (
        JournalWriter.create(tmp_path / "a.journal", header()),
        refused(RecordingError, "being-written-by-another-process"),
    ):
        JournalWriter.reopen(tmp_path / "a.journal")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", {"says": "is-empty-its-run-was-killed"}),
        (b"hello, world", {"says": "no-block-begins-there"}),
        (b"VLJB\x01", {"says": "the-file-ends-within-block-head"}),
    ],
)
def test_what_is_no_journal_is_refused_and_left_alone(tmp_path, content, message):
    path = tmp_path / "a.journal"
    path.write_bytes(content)
    for use in (JournalBlocks, JournalWriter.reopen):
        with refused(RecordingError, **message):
            use(path)
    assert path.read_bytes() == content


def test_a_journal_of_a_later_schema_asks_for_an_update(tmp_path, monkeypatch):
    monkeypatch.setattr("rig.recording.header.SCHEMA", 4)
    path = journal(tmp_path / "a.journal", 10)
    monkeypatch.undo()
    with refused(RecordingError, "written-by-schema-this-version-reads"):
        JournalBlocks(path)


def test_a_later_block_version_asks_for_an_update(tmp_path):
    path = journal(tmp_path / "a.journal", 10)
    data = bytearray(path.read_bytes())
    for start in (index for index in range(len(data)) if data.startswith(b"VLJB", index)):
        data[start + 4] = 3
    path.write_bytes(data)
    with refused(RecordingError, "journal-version-this-version-reads-up"):
        JournalBlocks(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"columns": COLUMNS[:-1]}, {"says": "columns-describe"}),
        ({"seed": -1}, {"says": "seed-is-an-integer-from"}),
        ({"kind": ""}, {"says": "kind-is-printable-text"}),
        ({"row_dtype": np.dtype("f8")}, {"says": "has-no-fields"}),
        ({"row_dtype": np.dtype([("x", "O")]), "columns": [Column("x", "", "")]}, {"says": "field-is-object"}),
        ({"row_dtype": np.dtype([("a b", "f4")]), "columns": [Column("a b", "", "")]}, {"says": "field-name"}),
        ({"row_dtype": np.dtype([("x", "f8", (9000,))]), "columns": [Column("x", "", "")]}, {"says": "bytes-row"}),
    ],
)
def test_a_header_that_cannot_be_stored_is_refused_by_name(changes, message):
    with refused(RecordingError, **message):
        header(**changes)


def test_a_header_that_is_not_json_leaves_no_file(tmp_path):
    with refused(RecordingError, "header-cannot-be-written-as"):
        JournalWriter.create(tmp_path / "a.journal", header(configuration={"driver": object()}))
    assert not list(tmp_path.iterdir())


def test_misuse_of_the_writer_is_refused_and_leaves_the_journal_as_it_was(tmp_path):
    path = tmp_path / "a.journal"
    with JournalWriter.create(path, header()) as writer:
        with refused(RecordingError, "outside-any-part"):
            writer.rows(rows(0, 1))
        writer.part({})
        size = path.stat().st_size
        with refused(RecordingError, "wanted"):
            writer.rows(np.zeros(3, [("sample", "<u4")]))
        with refused(RecordingError, "wanted"):
            writer.rows(rows(0, 4).reshape(2, 2))
        with refused(RecordingError, "event-cannot-be-written-as"):
            writer.event({"what": {1, 2}})
        assert path.stat().st_size == size
    with refused(RecordingError, "closed"):
        writer.event({})
    writer.close()


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False) | st.text(st.characters()),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(event=st.dictionaries(st.text(max_size=5), JSON, max_size=4))
def test_every_json_object_comes_back_as_it_was(tmp_path, event):
    path = tmp_path / "a.journal"
    path.unlink(missing_ok=True)
    with JournalWriter.create(path, header()) as writer:
        writer.part(event)
        writer.event(event)
    with JournalContents(path) as contents:
        assert contents.parts[0].information == event
        assert contents.parts[0].events == [event]


def test_numpy_values_and_lone_surrogates_are_written_as_json(tmp_path):
    with JournalWriter.create(tmp_path / "a.journal", header()) as writer:
        writer.part({"file": "\udcff"})
        writer.point({"x": np.float32(0.5), "n": np.int64(3), "ok": np.bool_(True), "v": np.arange(2)})
    with JournalContents(tmp_path / "a.journal") as contents:
        assert contents.parts[0].information == {"file": "\udcff"}
        assert contents.parts[0].points == [{"x": 0.5, "n": 3, "ok": True, "v": [0, 1]}]


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    path = tmp_path_factory.mktemp("original") / "a.journal"
    with JournalWriter.create(path, header()) as writer:
        fill(writer, 0, 40, block=7, completed=False)
        fill(writer, 40, 30, block=11)
    return path.read_bytes()


MUTATIONS = st.lists(
    st.one_of(
        st.tuples(st.just("flip"), st.integers(0, 10**6), st.integers(1, 255)),
        st.tuples(st.just("cut"), st.integers(0, 10**6), st.integers(0, 500)),
        st.tuples(st.just("insert"), st.integers(0, 10**6), st.binary(min_size=1, max_size=60)),
        st.tuples(st.just("repeat"), st.integers(0, 10**6), st.integers(1, 500)),
        st.tuples(st.just("truncate"), st.integers(0, 10**6), st.just(0)),
    ),
    min_size=1,
    max_size=3,
)


def mutated(data, mutations):
    data = bytearray(data)
    for what, where, how in mutations:
        at = where % (len(data) + 1)
        if what == "flip" and at < len(data):
            data[at] ^= how
        elif what == "cut":
            del data[at : at + how]
        elif what == "insert":
            data[at:at] = how
        elif what == "repeat":
            data[at:at] = data[at : at + how]
        elif what == "truncate":
            del data[at:]
    return bytes(data)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutations=MUTATIONS)
def test_of_a_damaged_journal_whole_blocks_are_recovered_in_their_places_and_nothing_else(
    tmp_path, original, mutations
):
    data = mutated(original, mutations)
    same = [a == b for a, b in zip(original, data, strict=False)]
    intact = same.index(False) if False in same else len(same)
    whole = blocks_by_hand(original)
    path = tmp_path / "a.journal"
    path.write_bytes(data)
    try:
        blocks = JournalBlocks(path)
        found = [(int(block.kind), block.sequence, block.payload) for block in blocks]
        contents = JournalContents(path)
    except RecordingError:
        assert intact < sum(HEAD + len(whole[i][2]) for i in range(3))  # neither the header nor a part is there
        return
    with contents:
        assert set(found) <= set(whole)
        assert [sequence for _, sequence, _ in found] == sorted({sequence for _, sequence, _ in found})
        position = 0
        for block in whole:
            position += HEAD + len(block[2])
            assert position > intact or block in [whole[0], *found]
        for part in contents.parts:
            first, got = part.information["first_sample"], all_rows(part)
            good = np.isfinite(got["frequency_hz"])
            assert got[good].tobytes() == rows(first, first + part.n_rows)[good].tobytes()
        n_rows = sum(part.n_rows for part in contents.parts)
    with JournalWriter.reopen(path) as writer:
        assert writer.n_rows == n_rows
        fill(writer, 70, 5)
    with JournalContents(path) as after:
        assert sum(part.n_rows for part in after.parts) == n_rows + 5


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kind=st.integers(0, 9), payload=st.binary(max_size=80), at=st.integers(0, 15), version=st.integers(1, 2))
def test_blocks_with_a_right_checksum_and_wrong_content_are_passed_over_without_a_crash(
    tmp_path, original, kind, payload, at, version
):
    blocks = [(kind, content) for kind, _, content in blocks_by_hand(original)]
    at %= len(blocks)
    blocks.insert(at, (kind, payload))
    path = tmp_path / "a.journal"
    path.write_bytes(packed_by_hand(blocks, version))
    try:
        with JournalContents(path) as contents:
            assert contents.n_blocks <= len(blocks)
            assert contents.size + contents.tail.n_bytes == path.stat().st_size
    except RecordingError:
        assert at < 4 or kind == 1  # what stands before the first rows, or another header


def test_deeply_nested_json_is_a_bad_block_and_no_crash(tmp_path, original):
    deep = b'{"a":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
    blocks = [(kind, payload) for kind, _, payload in blocks_by_hand(original)]
    path = tmp_path / "a.journal"
    path.write_bytes(packed_by_hand([*blocks, (BlockKind.PART, deep)]))
    found = JournalBlocks(path)
    assert len(list(found)) == len(blocks) - 1
    assert "cannot be read" in found.tail.reason


def test_a_journal_of_any_length_is_read_in_little_memory(tmp_path):
    path, piece = tmp_path / "a.journal", rows(0, 20_000)
    with JournalWriter.create(path, header()) as writer:
        writer.part({})
        for _ in range(50):
            writer.rows(piece)
        writer.end({})
    assert path.stat().st_size > 30e6
    tracemalloc.start()
    try:
        with JournalContents(path) as contents:
            assert contents.parts[0].n_rows == 1_000_000
            contents.parts[0].rows("locked")
            peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 6e6


def test_an_absurd_length_is_not_believed(tmp_path):
    path = journal(tmp_path / "a.journal", 10)
    whole = path.read_bytes()
    head = struct.pack("<4sHHIQIQI", b"VLJB", 2, 3, 2 * LARGEST_PAYLOAD, 8, 1, 10, 0)
    with path.open("ab") as stream:
        stream.write(head)
        stream.truncate(len(whole) + 3 * LARGEST_PAYLOAD)
    blocks = JournalBlocks(path)
    assert [block.sequence for block in blocks] == [1, 2, 3, 4, 5, 6, 7]
    assert "a length of 33554432 bytes" in blocks.tail.reason


def test_the_disk_is_synchronised_at_most_every_half_second_and_at_every_end(tmp_path, monkeypatch):
    now, synced = [100.0], []
    monkeypatch.setattr(appending.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(appending, "_fdatasync", lambda descriptor: synced.append(now[0]))
    with JournalWriter.create(tmp_path / "a.journal", header()) as writer:
        synced.clear()
        writer.part({})
        for _ in range(200):
            now[0] += 0.01
            writer.rows(rows(0, 50))
        assert len(synced) == 4
        assert min(np.diff(synced)) >= 0.5 - 1e-9
        writer.end({})
        assert synced[-1] == now[0]


def test_the_journal_does_not_import_h5py():
    code = "import sys, rig.recording.journal; sys.exit('h5py' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
