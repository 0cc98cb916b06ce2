"""The page's server: one page, its files, the feed, the stop, and figures of a folder. It can do nothing else.

Paths of requests are looked up in tables; none is ever a path in the file system.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING
from urllib.parse import parse_qs

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Scope
from starlette.websockets import WebSocket, WebSocketDisconnect

from rig.drawing import interactive
from rig.monitor.feed import Feed, Moment, Place
from rig.monitor.security import Guard, Keys
from rig.monitor.shutdown_monitor import HARDWARE
from rig.monitor.stopping import Stopping
from rig.monitor.visits import MOST_SOCKETS
from rig.system.child import ChildFailed

if TYPE_CHECKING:
    from rig.monitor.folder import Folder

PAGE = Path(__file__).parent / "page"
UPLOT = Path(interactive.__file__).parent / "uplot"
"""Scripts of others, which figures in a browser use as well."""
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".txt": "text/plain; charset=utf-8",
}
LARGEST_FORM = 1024  # bytes of a form; chosen: tokens and a number
FORM_S = 5.0  # s in which a form must come; chosen
READ_S = 3.0  # s in which a run must be read; chosen: then the stop is answered anyway
STOP = "stop"
NOT_STOPPED = f"NOT STOPPED: {HARDWARE}"
ELSEWHERE = "Or type in a terminal of the same user: rig stop"
HOW_TO_ENTER = (
    "Open the address that rig monitor or rig run --monitor has printed. Each address works once, in one browser; "
    "rig monitor prints another."
)


def application(
    feed: Feed, keys: Keys, scheme: str, hosts: frozenset[str], folder: "Folder | None", stopping: Stopping
) -> ASGIApp:
    """Return the application that serves a feed, and a folder if there is one, to those who have the keys."""
    pages = _Pages(feed, keys, scheme == "https", folder, stopping)

    @contextlib.asynccontextmanager
    async def reading(app: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(feed.run())
        try:
            yield
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task

    routes = [
        Route("/", pages.index),
        Route("/page/{name}", pages.file),
        Route("/state", pages.state),
        WebSocketRoute("/feed", pages.follow),
        Route("/stop", pages.stop, methods=["POST"]),
        Route("/stopping", pages.stopping),
        Route("/replay", pages.replay, methods=["POST"]),
        Route("/folder", pages.folder),
        Route("/folder/{n:int}/figure.png", pages.figure),
        Route("/folder/{n:int}/table.txt", pages.table),
    ]
    app = Starlette(routes=routes, lifespan=reading)
    app.add_exception_handler(HTTPException, pages.refused)
    app.add_exception_handler(Exception, pages.refused)
    return Guard(app, scheme, hosts, _refusal)


class _Pages:
    def __init__(self, feed: Feed, keys: Keys, secure: bool, folder: "Folder | None", stopping: Stopping) -> None:
        self._feed, self._keys, self._secure, self._folder, self._stopping = feed, keys, secure, folder, stopping
        files = [
            path for folder in (PAGE, UPLOT) for path in folder.iterdir() if path.suffix in TYPES and path.is_file()
        ]
        self._files = {path.name: (path.read_bytes(), TYPES[path.suffix]) for path in files}
        self._index = Template((PAGE / "index.html").read_text(encoding="utf-8"))

    async def index(self, request: Request) -> Response:
        """The page, or the door to it: an address with its token sets the cookie, once."""
        token = request.query_params.get("token")
        if token is not None and self._keys.admit(token):
            # Not a redirect: after one from elsewhere, such as from the file of --open, a strict cookie would be withheld.
            response = plain_page("Opening the page", onward="/", after_s=0)
            response.set_cookie(
                self._keys.cookie_name,
                self._keys.cookie,
                path="/",
                secure=self._secure,
                httponly=True,
                samesite="strict",
            )
            return response
        self._must_be_known(request)
        if token is not None:  # of a browser that is in already
            return plain_page("Opening the page", onward="/", after_s=0)
        moment = await self._feed.fresh()
        title = f"{moment.facts.bench} · {moment.facts.kind}" if moment.facts else "vibrolock"
        text = self._index.safe_substitute(
            action_token=self._keys.action,
            title=escape(title),
            replay="yes" if moment.view is not None and moment.view.player is not None else "no",
            folder="no" if self._folder is None else "yes",
        )
        return Response(text, media_type="text/html; charset=utf-8")

    async def file(self, request: Request) -> Response:
        found = self._files.get(request.path_params["name"])
        if found is None:
            raise HTTPException(404)
        return Response(found[0], media_type=found[1])

    async def state(self, request: Request) -> Response:
        """Everything at once, for a page whose socket is dead."""
        self._must_be_known(request)
        if not self._keys.acts(request.headers.get("x-token")):
            raise HTTPException(403)
        text = await self._feed.message(await self._feed.fresh())
        return Response(text, media_type="application/json")

    async def follow(self, socket: WebSocket) -> None:
        """Send what is new, to as many as may watch; a message "stop" asks the run to ramp down, as the form does.

        A socket is there already when others take all new connections.
        """
        if not (self._keys.known(socket.headers) and self._keys.acts(socket.query_params.get("token"))):
            await socket.close(1008)  # before it is accepted: answered with status 403
            return
        await socket.accept()
        if self._feed.clients >= MOST_SOCKETS:
            await socket.close(1013, "too many pages are open")
            return
        self._feed.clients += 1

        async def send() -> None:
            place = Place()
            while True:
                text, place = await self._feed.following(place)
                await socket.send_text(text)

        sending = asyncio.create_task(send())
        try:
            while (said := await socket.receive())["type"] != "websocket.disconnect":
                if said.get("text") == STOP:  # whatever else it says
                    self._stopping.ask(self._feed.view)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._feed.clients -= 1
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, OSError, RuntimeError):
                await sending

    async def stop(self, request: Request) -> Response:
        await self._form(request)
        view = self._feed.view
        self._stopping.ask(view)
        moment = await self._now()
        if moment is not None and moment.view is not view:  # another run has begun meanwhile
            self._stopping.ask(moment.view)
        return self._where_the_ramp_is(request, moment)

    async def stopping(self, request: Request) -> Response:
        self._must_be_known(request)
        return self._where_the_ramp_is(request, await self._now())

    async def _now(self) -> Moment | None:
        """Return what there is now; None if it cannot be read in time."""
        with contextlib.suppress(TimeoutError):
            return await asyncio.wait_for(self._feed.fresh(), READ_S)
        return None

    def _where_the_ramp_is(self, request: Request, moment: Moment | None) -> Response:
        word, heading, text = self._stopping.state(moment)
        if "application/json" in request.headers.get("accept", ""):
            return JSONResponse({"state": word, "text": f"{heading}. {text}"})
        onward = "" if word in ("none", "off", "driven") else "/stopping"
        return plain_page(heading, text, "This is no emergency stop.", kind=word, onward=onward)

    async def replay(self, request: Request) -> Response:
        player = None if self._feed.view is None else self._feed.view.player
        form = await self._form(request)
        if player is None:
            raise HTTPException(404)
        try:
            player.control(form.get("action", ""), float(form.get("value", "0")))
        except ValueError as error:
            raise HTTPException(400) from error
        return JSONResponse({"replay": "ok"})

    async def folder(self, request: Request) -> Response:
        return JSONResponse({"entries": await self._known_folder(request).entries()})

    async def figure(self, request: Request) -> Response:
        return Response(await self._of_file(request, "figure"), media_type="image/png")

    async def table(self, request: Request) -> Response:
        return Response(await self._of_file(request, "table"), media_type="text/plain; charset=utf-8")

    def _known_folder(self, request: Request) -> "Folder":
        self._must_be_known(request)
        if self._folder is None:
            raise HTTPException(404)
        return self._folder

    async def _of_file(self, request: Request, what: str) -> bytes:
        try:
            return await self._known_folder(request).made(what, request.path_params["n"])
        except KeyError:
            raise HTTPException(404) from None
        except ChildFailed as error:
            raise HTTPException(422, f"It cannot be shown: {error}.") from error

    async def _form(self, request: Request) -> dict[str, str]:
        """Return the fields of a form that comes from the page."""
        self._must_be_known(request)
        if request.headers.get("content-type", "").partition(";")[0].strip() != "application/x-www-form-urlencoded":
            raise HTTPException(415)
        body = b""
        try:
            async with asyncio.timeout(FORM_S):
                async for part in request.stream():
                    body += part
                    if len(body) > LARGEST_FORM:
                        raise HTTPException(413)
        except (TimeoutError, ClientDisconnect):
            raise HTTPException(408) from None
        try:
            fields = parse_qs(body.decode("ascii"), max_num_fields=8)
        except ValueError:
            raise HTTPException(400) from None
        if not self._keys.acts(fields.get("token", [""])[0]):
            raise HTTPException(403)
        return {name: values[0] for name, values in fields.items()}

    def _must_be_known(self, request: Request) -> None:
        if not self._keys.known(request.headers):
            raise HTTPException(403)

    async def refused(self, request: Request, error: Exception) -> Response:
        status = error.status_code if isinstance(error, HTTPException) else 500
        texts = {
            403: "This browser is not known here.",
            404: "There is no such page.",
            500: "The page's server has failed.",
        }
        told = (
            error.detail if isinstance(error, HTTPException) and status == 422 else "The request cannot be understood."
        )
        return _refusal(request.scope, status, texts.get(status, told))


def _refusal(scope: Scope, status: int, text: str) -> Response:
    """Return the answer to a request that is refused; if it was to stop, say that it did not."""
    stops = scope["path"] == "/stop"
    accepts = dict(scope["headers"]).get(b"accept", b"")
    heading = NOT_STOPPED if stops else "Not here"
    if b"application/json" in accepts:
        return JSONResponse({"state": "failed" if stops else "refused", "text": f"{heading}. {text}"}, status)
    return plain_page(
        heading, text, ELSEWHERE if stops else HOW_TO_ENTER, status=status, kind="failed" if stops else ""
    )


def plain_page(
    heading: str, *texts: str, status: int = 200, kind: str = "", onward: str = "", after_s: int = 1
) -> HTMLResponse:
    """Return a page without any script, with a heading in large letters: the way out when nothing else works, and refusals.

    ``kind`` is its class for colours: ``asked``, ``ramping``, ``off`` or ``failed``. ``onward`` is a path that the browser
    opens ``after_s`` seconds later.
    """
    refresh = f'<meta http-equiv="refresh" content="{after_s};url={escape(onward)}">' if onward else ""
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in texts if text)
    return HTMLResponse(
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'{refresh}<title>{escape(heading)}</title><link rel="icon" href="/page/icon.svg">'
        '<link rel="stylesheet" href="/page/plain.css"></head>'
        f'<body class="{escape(kind)}"><main><h1 role="status">{escape(heading)}</h1>{paragraphs}'
        '<p><a href="/">Back to the page</a></p></main></body></html>',
        status,
    )
