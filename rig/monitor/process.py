"""The page's server as a process: its address, its way in, its end."""

import asyncio
import ipaddress
import logging
import os
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import uvicorn

from rig.errors import ConfigurationError
from rig.monitor.certificate import from_files, self_signed
from rig.monitor.connections import DoorServer, FeedConnection, WebConnection
from rig.monitor.door import BACKLOG
from rig.monitor.feed import Earlier, Feed, Look
from rig.monitor.opening import open_in_browser
from rig.monitor.security import LARGEST_HEADERS, Keys
from rig.monitor.server import application
from rig.monitor.sources import always, earlier_run
from rig.monitor.stopping import Stopping
from rig.system.privileges import lower_priority
from rig.system.stop_signals import ended_in_order

if TYPE_CHECKING:
    from rig.monitor.replay import View

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
DEFAULT_PORTS = {"http": 80, "https": 443}
LARGEST_MESSAGE = 1024  # bytes of a message from the page; chosen: it says "stop" alone
GRACE_S = 2  # s for connections to end in order; chosen
LINGER_S = 60.0
"""Time after which a server whose run is over ends, once nobody watches any more."""


@dataclass(frozen=True, kw_only=True)
class Address:
    """Where the page is to be found.

    Raises:
        ConfigurationError: for a port that is none, every address at once, or a key without its certificate.
    """

    bind: str = "127.0.0.1"
    """Address or name of this machine; other than loopback only with TLS."""
    port: int = 0
    """Port; 0 for one that is free."""
    certificate: Path | None = None
    """File of a certificate (PEM)."""
    key: Path | None = None
    """File of its key, if that is not in the same."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise ConfigurationError(field="port", value=self.port, allowed="0 to 65535, 0 for a free one")
        if self.key is not None and self.certificate is None:
            raise ConfigurationError("wants `certificate` as well", field="key", value=self.key)
        if not self.bind or (self._number is not None and self._number.is_unspecified):
            raise ConfigurationError(
                field="bind", value=self.bind, allowed="one address of this machine, not all at once"
            )

    @property
    def _number(self) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
        try:
            return ipaddress.ip_address(self.bind)
        except ValueError:
            return None

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return self.bind == "localhost" or (self._number is not None and self._number.is_loopback)

    @property
    def host(self) -> str:
        """The address as it stands in a URL."""
        return f"[{self.bind}]" if ":" in self.bind else self.bind.lower()

    def listen(self) -> socket.socket:
        """Return a socket that listens.

        Raises:
            ConfigurationError: the port is taken, or the address is none of this machine.
        """
        try:
            found = socket.getaddrinfo(self.bind, self.port, type=socket.SOCK_STREAM)
            family, kind, protocol, _, address = found[0]
            listening = socket.socket(family, kind, protocol)
        except (OSError, UnicodeError) as error:
            raise ConfigurationError(
                f"is not an address of this machine ({error})", field="bind", value=self.bind
            ) from error
        try:
            if os.name == "posix":  # a port that was closed just now may be used again; elsewhere this means any port
                listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(address)
            listening.listen(BACKLOG)
        except OSError as error:
            listening.close()
            where = f"`bind` = {self.bind}, `port` = {self.port}"
            raise ConfigurationError(f"{where}: cannot be used ({error.strerror}); 0 chooses a free `port`") from error
        return listening

    def secured(self) -> tuple[ssl.SSLContext, str] | None:
        """Return TLS and the certificate's fingerprint; None where the page stays on this machine and no file is given."""
        if self.certificate is not None:
            return from_files(self.certificate, self.key)
        return None if self.loopback else self_signed(self.bind)


@dataclass
class PageServer:
    """A server that listens; ``run`` serves until it is told to end."""

    look: Look
    address: Address = field(default_factory=Address)
    earlier: Earlier | None = None
    folder: Path | None = None
    alone: Callable[[], bool] = lambda: False
    """Whether whoever started the server has gone, so that it ends by itself: at once where there never was a run, else some
    time after the run."""

    stopping: Stopping = field(default_factory=Stopping)
    """Leaves requests to stop."""

    def __post_init__(self) -> None:
        self.keys = Keys()
        secured = self.address.secured()
        self.fingerprint = secured[1] if secured else ""
        self.socket = self.address.listen()
        self.port = int(self.socket.getsockname()[1])
        self.scheme = "https" if secured else "http"
        names = (self.address.host, *LOOPBACK) if self.address.loopback else (self.address.host,)
        left_out = self.port == DEFAULT_PORTS[self.scheme]  # by browsers
        self.hosts = frozenset(name if left_out else f"{name}:{self.port}" for name in names)
        self.feed = Feed(self.look, self.earlier)
        folder = None
        if self.folder is not None:
            from rig.monitor.folder import Folder  # the page of a single run starts without it

            folder = Folder(self.folder)
        config = uvicorn.Config(
            application(self.feed, self.keys, self.scheme, self.hosts, folder, self.stopping),
            http=WebConnection,
            ws=FeedConnection,
            loop="asyncio",
            lifespan="on",
            log_config=None,
            access_log=False,
            proxy_headers=False,
            server_header=False,
            ws_max_size=LARGEST_MESSAGE,
            ws_per_message_deflate=False,
            h11_max_incomplete_event_size=LARGEST_HEADERS,
            timeout_graceful_shutdown=GRACE_S,
        )
        config.load()
        self._server = DoorServer(config, self.keys, secured[0] if secured else None)
        for name in ("uvicorn", "asyncio"):  # what clients do wrong is no news for a terminal, which might be held
            logging.getLogger(name).setLevel(logging.CRITICAL)

    @property
    def url(self) -> str:
        """The address with its token, for one browser."""
        return f"{self.scheme}://{self.address.host}:{self.port}/?token={self.keys.entry}"

    def run(self) -> None:
        """Serve until a signal comes or `end` is called; then close what was chosen to be shown."""
        try:
            asyncio.run(self._serve())
        finally:
            self.feed.close()
            getattr(self.look, "close", lambda: None)()

    def end(self) -> None:
        """Let the server end; may be called by any thread."""
        self._server.should_exit = True

    async def _serve(self) -> None:
        watch = asyncio.create_task(self._end_when_nobody_is_left())
        try:
            await self._server.serve([self.socket])
        finally:
            watch.cancel()

    async def _end_when_nobody_is_left(self) -> None:
        while True:
            await asyncio.sleep(1.0)
            view = self.feed.view
            if not self.alone() or (view is not None and view.connected) or self.feed.clients:
                self.feed.last_seen_s = time.monotonic()
            elif view is None or time.monotonic() - self.feed.last_seen_s > LINGER_S:
                self.end()


@dataclass(frozen=True, kw_only=True)
class Serving:
    """How a page is served."""

    address: Address = field(default_factory=Address)
    over: Path | None = None
    """Recording whose points are drawn under those of the run."""
    open_browser: bool = False


def serve(show: "View | Look", serving: Serving | None = None, *, folder: Path | None = None) -> None:
    """Serve the page of a view, or of what is chosen time and again, until Ctrl-C; say where it is.

    Raises:
        ConfigurationError: the address cannot be used.
        RecordingError: the recording to compare with cannot be read.
        Terminated: another signal than Ctrl-C came; the server has ended in order.
    """
    lower_priority()
    serving = serving or Serving()
    look = show if callable(show) else always(show)
    earlier = None if serving.over is None else earlier_run(serving.over)
    server = PageServer(look, serving.address, earlier, folder)
    with suppress(KeyboardInterrupt), ended_in_order(), _way_in(server, serving.open_browser):
        server.run()


@contextmanager
def _way_in(server: PageServer, open_browser: bool) -> Iterator[None]:
    """Print the address, and once it is used, the next; give it to the browser, if asked for."""
    if server.fingerprint:
        _say(f"SHA-256 fingerprint of the certificate: {server.fingerprint}")
    _say(f"the page is at {server.url}")
    file = open_in_browser(server.url, _say) if open_browser else None

    def used() -> None:
        if file is not None:
            file.unlink(missing_ok=True)
        line = f"for another browser: {server.url}"
        threading.Thread(
            target=_say, args=(line,), daemon=True
        ).start()  # a terminal that is held must not hold the page

    server.keys.on_entry = used
    try:
        yield
    finally:
        if file is not None:
            file.unlink(missing_ok=True)


def _say(line: str) -> None:
    with suppress(OSError):  # the reader of the output has gone
        print(line, flush=True)
