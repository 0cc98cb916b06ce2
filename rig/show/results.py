"""Results in memory as tables: HTML for notebooks, text for terminals. Both show what ``rig show`` prints of such a file."""

from collections.abc import Callable
from functools import partial

from rig.recording.reader import Recording
from rig.results.kind import ResultKind
from rig.results.kinds import kind_of_result
from rig.show.summary import summarise_recording
from rig.show.tables import print_findings, print_points
from rig.text.console import PrintedTable, collected, print_table
from vibrolock.printable import printable_strings

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


def as_html(thing: object) -> str | None:
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


def as_text(thing: object) -> str | None:
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


def _blocks(thing: object) -> list[str | PrintedTable] | None:
    recording = getattr(thing, "recording", thing)  # of a run
    kind = kind_of_result(thing)
    say: Callable[[], None] | None
    if isinstance(recording, Recording):
        say = partial(_say_recording, recording)
    elif kind is None:
        say = getattr(thing, "print_summary", None)  # of an analysis
    else:
        say = None if isinstance(thing, tuple) else partial(_say_kept, kind, thing)
    if say is None:
        return None
    with collected() as blocks:
        say()
    return [_thinned(block) if isinstance(block, PrintedTable) else block for block in blocks]


def _say_kept(kind: ResultKind, thing: object) -> None:
    summary = kind.summarise(kind.as_kept(thing))
    if not kind.stored:
        kind.say(summary)
        return
    print(f"{kind.name.replace('-', ' ')} of {summary.get('specimen') or 'an unnamed specimen'}")
    kind.say(summary)
    for note in summary.get("notes", ()):
        print(f"note: {note}")


def _say_recording(recording: Recording) -> None:
    found = printable_strings(summarise_recording(recording))
    ended = found["parts"][-1]["ended"] if found["parts"] else "nothing recorded"
    print(f"{found['kind']} of {found['specimen']} (bench {found['bench']}): {ended or 'cut short'}")
    print_points(found["kind"], found["points"])
    print_findings(found)


def _thinned(table: PrintedTable) -> PrintedTable:
    count = len(table.rows)
    if count <= _MOST_ROWS:
        return table
    kept = sorted({round(k * (count - 1) / (_MOST_ROWS - 1)) for k in range(_MOST_ROWS)})
    return PrintedTable(table.headings, tuple(table.rows[k] for k in kept))
