"""Messages for property tests."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rig.wire.messages import (
    LARGEST_PIECE,
    ROW_BYTES,
    Answer,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Readback,
    Record,
    Request,
    Rows,
    Samples,
    State,
    Stream,
)

U8, U16, U32, U64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))

streams = st.builds(
    Stream,
    n_channels=st.integers(1, 8),
    block=st.integers(1, 20),
    rate_hz=st.just(1000.0),
    bits=st.sampled_from([16, 32]),
    loop=st.booleans(),
)
pieces = st.builds(Record, U8, U32, st.binary(min_size=1, max_size=LARGEST_PIECE))
states = st.builds(State, U64, st.lists(pieces, max_size=3).map(tuple))


def blocks(stream: Stream, version: int) -> st.SearchStrategy[Message]:
    """Blocks from a device: of samples, or of rows where it runs the loop."""
    if not (stream.loop and version > 1):
        return st.builds(Samples, U64, counts(stream, stream.block, stream.n_channels), U16, U32, U64, U16)
    floats = st.floats(width=32, allow_nan=False)
    readings = arrays(np.float32, (stream.block, stream.n_channels), elements=floats)
    return st.builds(Rows, U64, readings, arrays(np.uint8, (stream.block, ROW_BYTES)), U16, U32, U64, U16)


def counts(stream: Stream, *shape: int) -> st.SearchStrategy[np.ndarray]:
    dtype = np.dtype(f"int{stream.bits}")
    return arrays(dtype, shape, elements=st.integers(np.iinfo(dtype).min, np.iinfo(dtype).max))


def messages(stream: Stream, version: int) -> st.SearchStrategy[Message]:
    later = (U32, U32) if version > 1 else (st.just(0), st.just(0))
    of_version_2 = [st.builds(Readback, U64, counts(stream, stream.block), U16)] if version > 1 else []
    of_version_2 += [pieces, states] if version > 1 and stream.loop else []
    return st.one_of(
        *of_version_2,
        st.builds(Request, U8, U8, U8, U8, U32),
        st.builds(Answer, U8, U8, U8, U8, U32),
        blocks(stream, version),
        st.builds(Output, U64, counts(stream, stream.block), U16, *later),
        st.builds(Heartbeat, U8, U16, U8, U32, U32),
        st.builds(EmergencyStop, U8),
    )


def same(ours: Message, theirs: Message) -> bool:
    if type(ours) is not type(theirs):
        return False
    pairs = zip(ours, theirs, strict=True)
    return all(a.dtype == b.dtype and np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)
