"""The first message of a connection, as far as it has come: whether it is whole, and whether a request shows a key."""

import re
from urllib.parse import parse_qs

from starlette.datastructures import Headers

from rig.monitor.security import Keys

LARGEST_HEADERS = 16384  # bytes of the headers of a request; chosen
RECORD_HEAD, LARGEST_RECORD = 5, 16384  # bytes of a record of TLS (RFC 8446, 5.1)
HANDSHAKE = 22
"""Type of a record of TLS (RFC 8446, 5.1): type, version, length, and what it holds."""
LARGEST = RECORD_HEAD + LARGEST_RECORD
HEADERS_END = re.compile(rb"\n\r?\n")


def is_whole(come: bytes, tls: bool) -> bool:
    """Return whether what has come is a message, or can no longer become one that is allowed."""
    if not tls:
        return len(come) >= LARGEST_HEADERS or HEADERS_END.search(come) is not None
    if len(come) < RECORD_HEAD:
        return False
    length = int.from_bytes(come[3:RECORD_HEAD], "big")
    return come[0] != HANDSHAKE or length > LARGEST_RECORD or len(come) >= RECORD_HEAD + length


def shows_key(request: bytes, keys: Keys) -> bool:
    """Return whether a request has the cookie or the token of the address."""
    first, *lines = request.splitlines()
    pairs = (line.partition(b":") for line in lines)
    headers = Headers(raw=[(name.strip().lower(), value.strip()) for name, _, value in pairs])
    target = first.split(b" ")[1:2] or [b""]
    return keys.known(headers) or with_token(target[0].partition(b"?")[2], keys)


def with_token(query: bytes, keys: Keys) -> bool:
    """Return whether a query has the token of the address."""
    return keys.opens(parse_qs(query.decode("latin-1")).get("token", [""])[0])
