"""MAT files are read by a child process; what it finds comes back as SciPy gives it."""

import base64
import zlib

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import HealthCheck, given, settings, strategies as st

from rig.exchange import child_reading
from rig.exchange.child_reading import ImportFailed
from rig.exchange.child_values import read_values, write_values
from rig.exchange.file_data import ChannelFacts, FileData
from rig.exchange.mat import read_mat
from rig.system.child import ChildFailed
from tests.refused import refused

THINGS = {
    "numbers": np.arange(12.0).reshape(3, 4),
    "complex": np.array([[1 + 2j, 3.0]]),
    "small": np.arange(5, dtype=np.int16),
    "number": 2.5,
    "truth": np.array([True, False]),
    "empty": np.zeros((0, 3)),
    "text": "µm/s²",
    "cells": np.array([1.0, "a", np.arange(3)], dtype=object),
    "table": {"x": 1, "inner": {"names": np.array(["left", "right"])}},
    "rows": np.array([(1.0, "a"), (2.0, "b")], dtype=[("x", object), ("name", object)]),
}


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "things.mat"
    scipy.io.savemat(path, THINGS)
    return path


def test_what_the_child_reads_is_what_scipy_reads(path):
    same(read_mat(path).values, scipy.io.loadmat(str(path), simplify_cells=True))


def same(found, wanted):
    assert type(found) is type(wanted)
    if isinstance(wanted, dict):
        assert list(found) == list(wanted)
        for key in wanted:
            same(found[key], wanted[key])
    elif isinstance(wanted, list) or (isinstance(wanted, np.ndarray) and wanted.dtype == object):
        assert getattr(found, "shape", ()) == getattr(wanted, "shape", ())
        for one, other in zip(found, wanted, strict=True):
            same(one, other)
    elif isinstance(wanted, np.ndarray):
        assert (found.dtype, found.shape, found.flags.writeable) == (wanted.dtype, wanted.shape, True)
        np.testing.assert_array_equal(found, wanted)
    else:
        assert found == wanted


def test_what_is_no_number_or_text_becomes_the_name_of_its_type(tmp_path):
    scipy.io.savemat(tmp_path / "sparse.mat", {"x": scipy.sparse.csc_matrix(np.eye(3)), "y": 1.0})
    found = read_mat(tmp_path / "sparse.mat").values
    assert found["x"].startswith("<csc_")
    assert found["y"] == 1.0


json_like = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(json_like)
def test_nested_values_come_back_as_they_were(tmp_path, value):
    write_values(value, tmp_path)
    same(read_values(tmp_path), value)


def test_what_a_reader_says_of_its_channels_comes_back(tmp_path):
    facts = {"F": ChannelFacts(name="Force", unit="N", scale=2.0, offset=-1.0, sample_rate_hz=1e3, start_s=0.5)}
    write_values(FileData(values={"F": np.arange(3.0)}, channels=facts, sample_rate_hz=1e3), tmp_path)
    found = read_values(tmp_path)
    assert isinstance(found, FileData)
    assert (found.channels, found.sample_rate_hz, found.unit("F")) == (facts, 1e3, "N")
    same(found.values, {"F": np.arange(3.0)})


CRASHES_SCIPY = (
    rb"c-r%I4DoSvQZUssQ1EpO(M`+DNmU5QNi0drFUqx2D9A6)tk6+#E=o--Nlj76&$ChpF3nT$%P&(fGEy)!vobWYGBr>zGB7e@A"
    rb"OkRZ`tkv(1|VhwVh$(`0<2IzBM@_eX-0-bAk7KH0T>2-u!k}nAQT6b7J$+sP+9^?%Rp%bD6QlGa>oKjggcn9xPuYuj$*Jl3s"
    rb"?;!)XfzPc?`)wnh(sz?H^_+W<+wm2Zle$r$P1`Alc7?#UCt4_6q=cC8-r9VE-fOW5lA52}vBJ-U3NIAI|WC03I}RiE$?*iaR"
    rb"0k&j$@Jc=&SQj;AVUdf`9{UsOJW0{})jFhu"
)
"""A byte of a small MAT file was changed; SciPy 1.17 ends its process by SIGSEGV over it."""


def test_a_file_that_crashes_scipy_is_refused_in_one_line(tmp_path):
    (tmp_path / "broken.mat").write_bytes(zlib.decompress(base64.b85decode(CRASHES_SCIPY)))
    with refused(ImportFailed, "broken-mat-is-no-file-or"):
        read_mat(tmp_path / "broken.mat")


@pytest.mark.parametrize("how", ["crashed (SIGSEGV)", "took more than 60 s"])
def test_a_file_that_ends_its_reader_is_one_line(path, monkeypatch, how):
    def ended(*_args, **_kwargs):
        raise ChildFailed(how)

    monkeypatch.setattr(child_reading, "ask_child", ended)
    with pytest.raises(ImportFailed) as caught:
        read_mat(path)
    assert str(caught.value) == f"{path}: is no MAT file, or a damaged one (reading it {how})"


@pytest.mark.parametrize("seed", range(8))
def test_changed_bytes_give_one_line_or_values(path, seed):
    data, random = bytearray(path.read_bytes()), np.random.default_rng(seed)
    data[int(random.integers(128, len(data)))] = int(random.choice([0, 6, 255]))
    path.write_bytes(data)
    line = f"{path}: "
    try:
        assert isinstance(read_mat(path), FileData)
    except ImportFailed as error:
        line = str(error)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
