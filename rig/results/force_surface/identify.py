"""Build force surfaces from levels of held displacement."""

from collections.abc import Sequence
from pathlib import Path

from identification.common import one_specimen
from rig.results.force_surface.model import MeasuredSurface
from rig.results.force_surface.options import ForceSurfaceOptions
from rig.results.kind import Progress
from rig.results.measured import stepped_sines


def identify(paths: Sequence[Path], options: ForceSurfaceOptions, progress: Progress | None = None) -> MeasuredSurface:
    """Build a force surface from levels of held displacement, taking all files together."""
    measured, missing = stepped_sines(paths)
    one_specimen(**{response.label: response.specimen for response in measured})
    found = MeasuredSurface(tuple(measured), missing)
    found.surface  # noqa: B018 refused here, not when the file is read
    return found
