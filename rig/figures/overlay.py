"""Curves of several files over one another, or of one file with axes of one's own."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification import IdentificationError
from rig.drawing.curves import Curves, View
from rig.drawing.style import Figure
from rig.errors import RecordingError
from rig.figures.curves_of_files import curves_of, families_of, why_not_together
from rig.figures.overlay_page import draw_over, frequency_of
from rig.recording.arrays import kind_of
from rig.results.kinds import KINDS

SIZE_IN = (9.0, 4.2)
"""Width and height of the page, inches; chosen."""


def overlay(
    sources: Sequence[Path], labels: Sequence[str] = (), view: View | None = None
) -> tuple[tuple[float, float], Callable[[Figure], None]]:
    """Return the size (inches) of the page for the curves of some files, and the function that draws them on an empty page.

    The files are recordings of one kind, or recordings and models with the same axes (`rig.figures.curves_of_files`).
    ``labels`` are names in the legend, by default those of the files. Raises `RecordingError` if a file cannot be read, the
    files do not have the same axes, the number of labels is wrong, or a file does not hold what the view asks for, and
    `IdentificationError` if no point of a recording was accepted. A model whose curve cannot be computed is left out, and the
    title says why; if nothing else is left, its error is raised.
    """
    if labels and len(labels) != len(sources):
        raise RecordingError(f"`label`: {len(labels)} for {len(sources)} files; give one for each file, in their order")
    view = view or View()
    family = _common_family(sources)
    names = list(labels) or [path.stem for path in sources]
    if not labels and len(set(names)) < len(names):
        names = [str(path.with_suffix("")) for path in sources]
    found, failed = _computed(sources, family, view)
    drawn = [(path, name) for k, (path, name) in enumerate(zip(sources, names, strict=True)) if k not in failed]
    for (path, _), curves in zip(drawn, found, strict=True):
        if curves.panels != found[0].panels:
            axes = [", ".join(f"{panel.y.text} ({panel.y.unit})" for panel in one.panels) for one in (found[0], curves)]
            raise RecordingError(
                f"{drawn[0][0]} and {path}: have no common axes: {axes[0]} and {axes[1]}; draw them apart"
            )
        _check_limits(path, curves, view)
    names, left_out = [name for _, name in drawn], tuple(failed.values())
    return SIZE_IN, lambda page: draw_over(page, names, _without_references(found), view, family, left_out)


def _computed(sources: Sequence[Path], family: str, view: View) -> tuple[list[Curves], dict[int, str]]:
    """Return the curves of the files, and the errors of those models, by their place, of which none could be computed."""
    found, failed = [], dict[int, IdentificationError]()
    for number, path in enumerate(sources):
        try:
            found.append(curves_of(path, family, view))
        except IdentificationError as error:
            if kind_of(path) not in KINDS:
                raise
            failed[number] = error
    if not found:
        raise next(iter(failed.values()))
    return found, {number: str(error) for number, error in failed.items()}


def _common_family(sources: Sequence[Path]) -> str:
    """Return the first family of curves that all files have; raise `RecordingError` if there is none."""
    common = families_of(sources[0])
    for path in sources[1:]:
        here = families_of(path)
        left = tuple(family for family in common if family in here)
        if not left:
            raise RecordingError(why_not_together(sources[0], path))
        common = left
    return common[0]


def _without_references(found: Sequence[Curves]) -> list[Curves]:
    """Leave out what predictions hold of measurements, where a file has the measurements, and all but the first of several."""
    measured = any(trace.origin == "measured" for curves in found for trace in curves.traces)
    seen: set[str] = set()
    kept = []
    for curves in found:
        mine = {trace.level for trace in curves.traces if trace.origin == "reference"}
        hidden = mine if measured else mine & seen
        seen |= mine
        traces = (trace for trace in curves.traces if trace.origin != "reference" or trace.level not in hidden)
        kept.append(replace(curves, traces=tuple(traces)))
    return kept


def _check_limits(path: Path, curves: Curves, view: View) -> None:
    """Raise `RecordingError` if nothing of a file lies between the frequency limits."""
    if view.frequency_hz is None:
        return
    frequencies = np.concatenate([frequency_of(trace, curves.panels) for trace in curves.traces])
    frequencies = frequencies[np.isfinite(frequencies)]
    low, high = view.frequency_hz
    if not np.any((frequencies >= low) & (frequencies <= high)):
        least, most = frequencies.min(), frequencies.max()
        raise RecordingError(f"`frequency` {low:g}:{high:g}: {path} lies between {least:g} and {most:g} Hz")
