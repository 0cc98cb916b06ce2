"""Results in memory as tables: HTML for notebooks, text for terminals. Both show what ``rig show`` prints of such a file."""

from collections.abc import Callable, Iterable
from typing import Any

from rig.recording.reader import Recording
from rig.results.kinds import as_kept, kind_of_file_for
from rig.show import result_tables
from rig.text.console import PrintedTable, collected, print_table

_MOST_ROWS = 20
"""Of longer tables, rows evenly apart are shown."""

_TEMPLATE = """\
<div class="vibrolock-result">
{%- for block in blocks %}
{%- if block.headings is defined %}
<table>
<thead><tr>{% for cell in block.headings %}<th>{{ cell }}</th>{% endfor %}</tr></thead>
<tbody>
{%- for row in block.rows %}
<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{%- endfor %}
</tbody>
</table>
{%- else %}
<p>{% for line in block %}{{ line }}{% if not loop.last %}<br>{% endif %}{% endfor %}</p>
{%- endif %}
{%- endfor %}
</div>
"""


def as_html(thing: Any) -> str | None:
    """Return a result as HTML without any style of its own; None if there is no table for its type."""
    from jinja2 import Environment

    blocks = _blocks(thing)
    if blocks is None:
        return None
    parts: list[PrintedTable | list[str]] = []
    for block in blocks:
        if isinstance(block, PrintedTable):
            parts.append(block)
        elif parts and isinstance(parts[-1], list):  # further lines of a paragraph
            parts[-1].append(block)
        else:
            parts.append([block])
    return Environment(autoescape=True).from_string(_TEMPLATE).render(blocks=parts)


def as_text(thing: Any) -> str | None:
    """Return a result as lines of text; None if there is no table for its type."""
    import contextlib
    import io

    blocks = _blocks(thing)
    if blocks is None:
        return None
    with contextlib.redirect_stdout(io.StringIO()) as text:
        for block in blocks:
            if isinstance(block, PrintedTable):
                print_table(block.headings, block.rows)
            else:
                print(block)
    return text.getvalue().rstrip("\n")


def _blocks(thing: Any) -> list[str | PrintedTable] | None:
    """Return the lines and tables of a result; None if there are none for its type."""
    say = _say_of(thing)
    if say is None:
        return None
    with collected() as blocks:
        say()
    return [_thinned(block) if isinstance(block, PrintedTable) else block for block in blocks]


def _say_of(thing: Any) -> Callable[[], None] | None:
    """Return what prints a result; None if there is nothing for its type."""
    recording = getattr(thing, "recording", thing)  # of a run
    if isinstance(recording, Recording):
        return lambda: result_tables.say_recording(recording)
    for one in type(thing).__mro__:
        if one.__name__ in result_tables.SAY:
            return lambda: result_tables.SAY[one.__name__](thing)
    if callable(getattr(thing, "say", None)):  # of an analysis
        return lambda: thing.say()
    kind = kind_of_file_for(thing)
    if kind is None or isinstance(thing, tuple):
        return None
    kept = as_kept(kind, thing)

    def say_kept() -> None:
        summary = kind.summarise(kept)
        print(f"{kind.name.replace('-', ' ')} of {summary.get('specimen') or 'an unnamed specimen'}")
        kind.say(summary)
        _say_notes(summary.get("notes", ()))

    return say_kept


def _say_notes(notes: Iterable[str]) -> None:
    for note in notes:
        print(f"note: {note}")


def _thinned(table: PrintedTable) -> PrintedTable:
    """Return a table with `_MOST_ROWS` rows at most, the first and the last among them."""
    count = len(table.rows)
    if count <= _MOST_ROWS:
        return table
    kept = sorted({round(k * (count - 1) / (_MOST_ROWS - 1)) for k in range(_MOST_ROWS)})
    return PrintedTable(table.headings, tuple(table.rows[k] for k in kept))
