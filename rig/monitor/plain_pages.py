"""Pages without any script: the way out when nothing else works, and refusals."""

from html import escape

from starlette.responses import HTMLResponse

HARDWARE = "USE THE HARDWARE STOP"


def plain_page(
    heading: str, *texts: str, status: int = 200, kind: str = "", onward: str = "", after_s: int = 1
) -> HTMLResponse:
    """Return a page with a heading in large letters.

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
