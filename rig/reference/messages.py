"""The messages that end or spoil a run: reasons for the end of a run, qualities of points, errors.

Each has a name in small letters with hyphens, such as ``lost-lock`` or ``daq-timeout``, which is that of its page.
"""

from collections.abc import Iterator

from rig.reference.entry import Entry
from rig.text.message_pages import page_of

PAGES = "reference/messages"
"""Folder of their pages on the site."""


def message_entries() -> Iterator[Entry]:
    """Yield an entry for every message, found by its name and its text; a reason that is also a quality has one entry."""
    lines: dict[str, list[tuple[str, str]]] = {}
    for name, what, text in _messages():
        lines.setdefault(name, []).append((what, text))
    for name, texts in lines.items():
        words = (name, *(text.rstrip(".") for _, text in texts))
        line = "; ".join(f"{what}: {text}" for what, text in texts)
        yield Entry("message", name, tuple(dict.fromkeys(words)), line, f"{PAGES}/{name}")


def _messages() -> Iterator[tuple[str, str, str]]:
    """Yield name, kind and text of each."""
    from rig import errors
    from rig.campaigns.evaluation.point import Quality
    from rig.tick.safety.layout import EndReason
    from vibrolock.described import attribute_docstrings

    for reason in EndReason:
        if reason not in (EndReason.NONE, EndReason.COMPLETED):
            yield page_of(reason.name), "end of a run", reason.text
    texts = attribute_docstrings(Quality.__module__)["Quality"]
    for quality in Quality:
        if quality is not Quality.GOOD:
            yield quality.value, "quality of a point", texts[quality.name]
    for name in errors.__all__:
        error = getattr(errors, name)
        if isinstance(error, type) and error not in (errors.RigError, errors.DaqError):
            line = " ".join(str(error.__doc__).partition("\n\n")[0].split())
            yield page_of(name), "error", line
