"""Gives the page's address to a browser through a file that only the user can read: a command line is seen by everybody."""

import os
import re
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

PREFIX = "open-"
HEAD = '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>vibrolock</title>'
_FILE = re.compile(rf"{PREFIX}[0-9a-f]{{16}}\.html")
READ_S = 60.0
"""Time after which a browser has read the file, or never will."""


def open_in_browser(url: str, say: Callable[[str], None]) -> Path | None:
    """Open an address in the user's browser; return the file through which it goes, which is to be removed afterwards.

    Where that cannot be done, ``say`` is told so, and None is returned.
    """
    try:
        path = _written(url)
    except (OSError, RecordingError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        say(f"no browser is opened, as there is no room for the file that tells it the address ({reason})")
        return None
    threading.Thread(target=_open, args=(path.as_uri(), say), name="browser", daemon=True).start()
    return path


def _written(url: str) -> Path:
    folder = base_folder()
    _remove_old(folder)
    path = folder / f"{PREFIX}{secrets.token_hex(8)}.html"
    text = f'{HEAD}<meta http-equiv="refresh" content="0;url={escape(url)}"></head><body></body></html>'.encode()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(text)
    except OSError:
        path.unlink(missing_ok=True)
        raise
    return path


def _remove_old(folder: Path) -> None:
    """Remove the files of servers that were killed, known by name and content."""
    for left in folder.iterdir():
        with suppress(OSError):
            if _FILE.fullmatch(left.name) and time.time() - left.lstat().st_mtime > READ_S:
                with left.open("rb") as stream:
                    ours = stream.read(len(HEAD)) == HEAD.encode()
                if ours:
                    left.unlink()


def _open(uri: str, say: Callable[[str], None]) -> None:
    try:
        opened = webbrowser.open(uri)
    except (webbrowser.Error, OSError):
        opened = False
    if not opened:
        say("no browser could be opened here")
