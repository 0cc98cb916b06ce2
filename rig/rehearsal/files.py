"""Plans and benches as TOML: an improved plan with the remedies that were tried, and a twin as a bench."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap

import tomli_w

from rig.bench import Bench
from rig.rehearsal.remedies import Improvement
from rig.system.whole_file import whole_file


def write_bench(bench: Bench, path: Path, comments: Sequence[str] = ()) -> None:
    """Write a bench that `rig.bench.load_bench` reads. Raises `RecordingError` if the file cannot be written."""
    _write(path, bench.model_dump(mode="json", exclude_none=True), comments)


def write_plan(improvement: Improvement, path: Path, comments: Sequence[str]) -> None:
    """Write an improved plan, the keys that were given and those that were changed. Raises `RecordingError` as above."""
    table = improvement.plan.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    tried = [
        f"{'taken' if one.taken else 'tried'}: {one.name}, ends well {100 * one.ends_well[0]:.3g} -> "
        f"{100 * one.ends_well[1]:.3g} %, trips {100 * one.trips[0]:.3g} -> {100 * one.trips[1]:.3g} % ({one.draws} twins)"
        for one in improvement.effects
    ]
    _write(path, {"kind": improvement.plan.kind, **table}, [*comments, *tried])


def _write(path: Path, table: Mapping[str, object], comments: Sequence[str]) -> None:
    lines = [line for text in comments for line in wrap(text, 118, initial_indent="# ", subsequent_indent="#   ")]
    with whole_file(path) as part:
        part.write_text("\n".join([*lines, tomli_w.dumps(dict(table))]), encoding="utf-8")
