"""The way to the page's server: whoever has no key cannot keep out those who have one.

A connection is a stranger until a request on it has shown the browser's cookie or the token of the address. Internet addresses
tell nobody apart: on one machine all have the same. At first a connection waits as a bare socket, until its first message has
come whole: the headers of a request, or what begins a TLS handshake. That costs a descriptor, no handshake and no buffers, so
that many can wait, which keeps them from coming anew. Then a request with a key is served at once, and everybody else in turn.

Where too many wait, the oldest is dropped, of those whose message is not whole or of those in the queue, whichever are more:
neither crowd can push out the other.
"""

import asyncio
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress

from rig.monitor.security import LARGEST, Keys, is_whole
from rig.monitor.visits import Visit, Visits, capacity

BACKLOG = 1024
"""Connections that the system keeps until they are accepted."""
AT_ONCE = 16
"""Connections that are accepted, or have their turn, before the others are looked after."""
POLL_S = 0.02
"""Shortest time after which a message that has begun is looked at again."""
HANDSHAKE_S = 5.0
"""Time in which a TLS handshake must be over."""
MESSAGE_S = 10.0
"""Time in which the first message must have come."""
RETRY_S = 0.1
"""Time between two tries to accept where the system has no room for another connection."""


class Door:
    """Accepts connections at a socket that listens, and opens each in its turn: by TLS, if there is a context for it."""

    def __init__(
        self,
        listening: socket.socket,
        tls: ssl.SSLContext | None,
        keys: Keys,
        connect: Callable[[Visit], asyncio.Protocol],
    ) -> None:
        self._listening, self._tls, self._keys, self._connect = listening, tls, keys, connect
        self._most = capacity()
        self._unfinished: dict[socket.socket, float] = {}
        self._queue: dict[socket.socket, float] = {}
        self._timers: dict[Callable[[], None], asyncio.TimerHandle] = {}
        self.visits = Visits(self._most.strangers)
        self.visits.on_room = self._next

    async def accept(self) -> None:
        """Accept connections until cancelled; then those that wait are closed."""
        loop = asyncio.get_running_loop()
        self._listening.setblocking(False)
        accepted = 0
        try:
            while True:
                try:
                    self._take((await loop.sock_accept(self._listening))[0])
                except ConnectionAbortedError:
                    pass
                except (OSError, RuntimeError):  # descriptors or memory are used up; whatever it is, accepting goes on
                    self._drop_one()
                    await asyncio.sleep(RETRY_S)
                accepted += 1
                if accepted % AT_ONCE == 0:
                    await asyncio.sleep(0)
        finally:
            self.visits.on_room = lambda: None
            for timer in self._timers.values():
                timer.cancel()
            while self._drop_one():
                pass

    def _take(self, connection: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        if len(self._unfinished) + len(self._queue) >= self._most.waiting:
            self._drop_one()
        self._unfinished[connection] = loop.time()
        self._in(MESSAGE_S, self._drop_late)
        try:
            loop.add_reader(connection, self._look, connection)
        except NotImplementedError:  # Windows: its turn comes unheard
            self._line_up(connection)

    def _look(self, connection: socket.socket) -> None:
        """Look at what has come, without taking it."""
        if connection not in self._unfinished:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(connection)
        come, closed = b"", False
        try:
            come = connection.recv(LARGEST, socket.MSG_PEEK)
            closed = not come
        except BlockingIOError:
            pass
        except OSError:
            closed = True
        if closed:
            self._drop(connection, self._unfinished)
        elif not is_whole(come, self._tls is not None):
            waited_s = loop.time() - self._unfinished[connection]
            loop.call_later(max(POLL_S, waited_s / 2.0), self._look, connection)  # a reader would be called without end
        elif self._tls is None and self._keys.shown_by(come):
            del self._unfinished[connection]
            self._open(connection, self.visits.known_at_once())
        else:
            self._line_up(connection)

    def _line_up(self, connection: socket.socket) -> None:
        self._queue[connection] = self._unfinished.pop(connection)
        self._in(0.0, self._next)

    def _next(self) -> None:
        """Open as many as have room, in the order in which they were whole."""
        now_s = asyncio.get_running_loop().time()
        for connection in list(self._queue)[:AT_ONCE]:
            wait_s = self.visits.until_room_s(now_s)
            if wait_s > 0.0:
                self._in(wait_s, self._next)
                return
            del self._queue[connection]
            self._open(connection, self.visits.begin(now_s))
        if self._queue:
            self._in(0.0, self._next)

    def _open(self, connection: socket.socket, visit: Visit) -> None:
        loop = asyncio.get_running_loop()
        handshake_s = None if self._tls is None else HANDSHAKE_S
        opening = loop.connect_accepted_socket(
            lambda: self._connect(visit), connection, ssl=self._tls, ssl_handshake_timeout=handshake_s
        )
        handshake = loop.create_task(opening)
        visit.shakes_hands(handshake)
        handshake.add_done_callback(lambda done: connection.close() if done.cancelled() or done.exception() else None)

    def _drop_late(self) -> None:
        """Drop those whose message has not come in time."""
        now_s = asyncio.get_running_loop().time()
        while self._unfinished:
            connection, began_s = next(iter(self._unfinished.items()))
            if began_s + MESSAGE_S > now_s:
                self._in(began_s + MESSAGE_S - now_s, self._drop_late)
                return
            self._drop(connection, self._unfinished)

    def _drop_one(self) -> bool:
        """Drop the connection that has waited longest, of those that are more; return whether there was one."""
        waiting = self._unfinished if len(self._unfinished) >= len(self._queue) else self._queue
        if not waiting:
            return False
        self._drop(next(iter(waiting)), waiting)
        return True

    @staticmethod
    def _drop(connection: socket.socket, waiting: dict[socket.socket, float]) -> None:
        del waiting[connection]
        with suppress(NotImplementedError):
            asyncio.get_running_loop().remove_reader(connection)
        connection.close()

    def _in(self, seconds: float, do: Callable[[], None]) -> None:
        """Do something later, unless it is to be done anyway."""
        if do not in self._timers:
            self._timers[do] = asyncio.get_running_loop().call_later(seconds, self._due, do)

    def _due(self, do: Callable[[], None]) -> None:
        del self._timers[do]
        do()
