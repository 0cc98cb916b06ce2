"""Strangers who reach the page's port: ``python -m tests.rig.monitor.crowd KIND NUMBER PORT``. They have no token.

Each connects, says what its kind says, and connects anew as soon as it is dropped, until the process is ended. Once each has
connected at least once, a line says so.
"""

import asyncio
import resource
import socket
import ssl
import sys
from contextlib import suppress

HELLO = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"
"""The first bytes of a TLS handshake of 512 bytes."""
SAID = {
    "silent": b"",
    "half a greeting": HELLO,
    "a byte": b"G",
    "half a request": b"GET / HTTP/1.1\r\nHost: x\r\nX-Slow: ",
    "a request": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
    "greeted": b"",
}
"""What each kind says. Those who have "greeted" shake hands by TLS to the end, and then say nothing."""


def trusting_all() -> ssl.SSLContext:
    """TLS of somebody who does not care with whom."""
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


async def stranger(kind: str, port: int, tls: ssl.SSLContext | None, was_there: asyncio.Event) -> None:
    """Connect again and again."""
    while True:
        with suppress(OSError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=tls)
            was_there.set()
            writer.write(SAID[kind])
            await reader.read()
            writer.transport.abort()
        await asyncio.sleep(0)


async def crowd(kind: str, number: int, port: int) -> None:
    """So many strangers at once."""
    tls = trusting_all() if kind == "greeted" else None
    events = [asyncio.Event() for _ in range(number)]
    tasks = [asyncio.create_task(stranger(kind, port, tls, event)) for event in events]
    for event in events:
        await event.wait()
    print("all there", flush=True)
    await asyncio.gather(*tasks)


if __name__ == "__main__":
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 16384), hard))
    socket.setdefaulttimeout(None)
    asyncio.run(crowd(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
