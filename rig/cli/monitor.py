"""``rig monitor``: a page on which a run can be watched and stopped."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rig.cli.run_options import with_options

if TYPE_CHECKING:
    from rig.monitor.process import Serving

Port = Annotated[int, typer.Option(help="Port of the page; a free one if left out.", min=0, max=65535)]
Bind = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Address of this machine that others can reach; by TLS only.")
]
Certificate = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Certificate for TLS (PEM); made for the occasion if left out.")
]
Key = Annotated[Path | None, typer.Option(metavar="FILE", help="Key of the certificate, if it is in another file.")]
Over = Annotated[Path | None, typer.Option(metavar="FILE", help="Recording whose points are drawn under the run's.")]
Open = Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")]


def of_a_page(
    port: Port = 0,
    bind: Bind = "127.0.0.1",
    certificate: Certificate = None,
    key: Key = None,
    over: Over = None,
    open_: Open = False,
) -> "Serving":
    """Return the options of a command that serves the page."""
    from rig.monitor.process import Address, Serving

    address = Address(bind=bind, port=port, certificate=certificate, key=key)
    return Serving(address=address, over=over, open_browser=open_)


@with_options(of_a_page)
def monitor(
    *,
    what: Annotated[
        Path | None, typer.Argument(metavar="[FILE|FOLDER]", help="Recording or folder; the youngest run if left out.")
    ] = None,
    options: "Serving",
) -> None:
    """Watch a run on a page in the browser, with a stop button; with a folder, also what is in it."""
    from rig.monitor.process import serve
    from rig.monitor.sources import chosen

    serve(chosen(what), options, folder=what if what is not None and what.is_dir() else None)
