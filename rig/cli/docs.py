"""``rig docs``: the page of a command, a key, a message or a public name."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

BUILD = (
    "the documentation site is not built here; in a clone of the repository: "
    "pip install -e '.[docs]' && sphinx-build -W docs rig/site"
)


def docs(
    context: typer.Context,
    word: Annotated[
        list[str] | None,
        typer.Argument(help="Command, key, message, public name or title of a page; default: the home page."),
    ] = None,
) -> None:
    """Open the page of a command, key, message or public name; without the site, print what is known of it."""
    from rig.errors import ConfigurationError
    from rig.reference.words import closest, found, known_words, read_words, site

    asked, folder = " ".join(word or ()).strip(), site()
    if not asked:
        if folder is None:
            raise ConfigurationError(BUILD)
        print(_address(folder, "index.html"))
        _open(folder, "index.html")
        return
    words = read_words(folder) if folder else known_words(context.find_root().command)
    hits = found(words, asked)
    if not hits:
        near = ", ".join(closest(words, asked))
        raise ConfigurationError(
            f"nothing of this name{(f'; closest: {near}' if near else '')}", field="WORD", value=asked
        )
    for hit in hits:
        print(f"{hit.title} ({hit.what}): {hit.line}")
        for more in (hit.facts, _address(folder, hit.url) if folder and hit.url else ""):
            if more:
                print(f"    {more}")
    if folder is None:
        print(BUILD, file=sys.stderr)
    elif len(hits) > 1:
        print(f"rig docs {hits[0].title} opens the first")
    elif hits[0].url:
        _open(folder, hits[0].url)


def _open(folder: Path, url: str) -> None:
    """Open a page in a browser, where there is a screen for one."""
    import webbrowser

    here = "SSH_CONNECTION" not in os.environ and (
        sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    )
    if here:
        webbrowser.open(_address(folder, url))


def _address(folder: Path, url: str) -> str:
    page, hash_, place = url.partition("#")
    return f"{(folder / page).as_uri()}{hash_}{place}"
