"""A JSON document is printed as Python's own encoder prints it."""

import contextlib
import io
import json
import math

from hypothesis import given, strategies as st

from rig.text.console import print_json

PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
KEYS = st.text() | st.integers() | st.booleans() | st.none()
VALUES = st.recursive(
    PLAIN, lambda some: st.lists(some) | st.tuples(some, some) | st.dictionaries(KEYS, some), max_leaves=20
)


@given(st.dictionaries(st.text(), VALUES))
def test_a_document_is_that_of_the_encoder_of_python(document):
    assert printed(document) == json.dumps(document, indent=2)


def test_numbers_that_are_not_finite_are_null_at_every_depth():
    found = json.loads(printed({"a": math.nan, "b": [math.inf, (1.0, -math.inf)], "c": {"d": math.nan}}))
    assert found == {"a": None, "b": [None, [1.0, None]], "c": {"d": None}}


def printed(document):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        print_json(document)
    return out.getvalue().removesuffix("\n")
