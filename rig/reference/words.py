"""Words, and what each leads to: from the list that is written with the site, or from the code where there is no site."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rig.errors import RecordingError
from rig.reference.entry import Entry

WORDS_FILE = "words.json"
"""Name of the list of words, beside the pages of the site."""


@dataclass(frozen=True)
class Hit:
    """Something that a word leads to."""

    what: str
    """Kind of what is found, such as ``key`` or ``command``."""
    title: str
    """Its full name."""
    line: str
    """What it is, in one line."""
    facts: str
    """What else is known of it; empty for nothing."""
    url: str
    """Its page and the place on it, relative to the site; empty if there is no page."""


Words = dict[str, list[Hit]]


def words_of(entries: Iterable[tuple[Entry, str]]) -> Words:
    """Return what each word leads to, from entries with their addresses."""
    words: Words = {}
    for entry, url in entries:
        hit = Hit(entry.what, entry.title, entry.line, entry.facts, url)
        for word in dict.fromkeys(_plain(word) for word in entry.words):
            words.setdefault(word, []).append(hit)
    return dict(sorted(words.items()))


def known_words(group: Any) -> Words:
    """Return the words of the code; ``group`` is the command line, as ``typer.main.get_command`` returns it."""
    from rig.reference.commands import command_entries
    from rig.reference.keys import key_entries
    from rig.reference.messages import message_entries
    from rig.reference.names import name_entries

    entries = (*command_entries(group), *key_entries(), *message_entries(), *name_entries())
    return words_of((entry, "") for entry in entries)


def site() -> Path | None:
    """Return the folder of the site inside this package; None if it was not built."""
    folder = Path(__file__).parents[1] / "site"
    return folder if (folder / WORDS_FILE).is_file() else None


def write_words(words: Words, folder: Path) -> None:
    """Write the list of words beside the pages."""
    table = {word: [asdict(hit) for hit in hits] for word, hits in words.items()}
    (folder / WORDS_FILE).write_text(json.dumps(table, ensure_ascii=False), encoding="utf-8")


def read_words(folder: Path) -> Words:
    """Return the list of words of a site. Raises `RecordingError` if it is damaged."""
    path = folder / WORDS_FILE
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        return {word: [Hit(**hit) for hit in hits] for word, hits in table.items()}
    except (ValueError, TypeError, AttributeError):
        raise RecordingError(f"{path}: not a list of words; build the site again") from None


def found(words: Words, word: str) -> list[Hit]:
    """Return what a word leads to; upper and lower case count as alike, and hyphens, underscores and spaces do."""
    return list(dict.fromkeys(words.get(_plain(word), [])))


def closest(words: Words, word: str, count: int = 5) -> list[str]:
    """Return full names of what is nearest to a word that is not known: it contains the word, or is spelled alike."""
    wanted = _plain(word)
    inside = sorted((known for known in words if wanted in known and "." not in known), key=len)
    near = dict.fromkeys([*inside, *get_close_matches(wanted, words, count)])
    return list(dict.fromkeys(words[known][0].title for known in near))[:count]


def _plain(word: str) -> str:
    return word.lower().replace("_", "-").replace(" ", "-")
