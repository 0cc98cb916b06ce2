"""Gives the page's address to a browser through a file that only the user can read: a command line is seen by everybody."""

import os
import secrets
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from html import escape
from pathlib import Path

from rig.errors import RecordingError
from rig.live.place import base_folder

__all__ = ["open_in_browser"]

PREFIX = "open-"
READ_S = 60.0
"""Time after which a browser has read the file, or never will."""


def open_in_browser(url: str, say: Callable[[str], None]) -> Path | None:
    """Open an address in the user's browser; return the file through which it goes, which is to be removed afterwards.

    Where that cannot be done, ``say`` is told so, and None is returned.
    """
    try:
        path = _written(url)
    except (OSError, RecordingError) as error:
        say(f"no browser is opened, as there is no room for the file that tells it the address ({_reason(error)})")
        return None
    threading.Thread(target=_open, args=(path.as_uri(), say), name="browser", daemon=True).start()
    return path


def _written(url: str) -> Path:
    folder = base_folder()
    for left in folder.glob(f"{PREFIX}*.html"):  # of servers that were killed
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > READ_S:
                left.unlink()
    path = folder / f"{PREFIX}{secrets.token_hex(8)}.html"
    text = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>vibrolock</title>'
        f'<meta http-equiv="refresh" content="0;url={escape(url)}"></head><body></body></html>'
    ).encode()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(text)
    except OSError:
        path.unlink(missing_ok=True)
        raise
    return path


def _open(uri: str, say: Callable[[str], None]) -> None:
    try:
        opened = webbrowser.open(uri)
    except (webbrowser.Error, OSError):
        opened = False
    if not opened:
        say("no browser could be opened here")


def _reason(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)
