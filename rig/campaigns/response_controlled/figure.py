"""Figure of a response-controlled test: all levels, and the force surface through them if there are enough levels."""

from identification import ForceSurface, IdentificationError, force_surface
from rig.campaigns.evaluation.figure import describe, notes_of
from rig.campaigns.evaluation.frequency_responses import passes_of, recorded_frequency_responses
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.force_surface import draw_force_surface
from rig.drawing.style import Figure
from rig.recording.reader import Recording


def draw(page: Figure, recording: Recording) -> None:
    """Draw all levels, and the force surface through them if there are enough levels."""
    responses = recorded_frequency_responses(recording)
    try:
        surface: ForceSurface | None = force_surface(responses)
    except IdentificationError:
        surface = None
    notes = [notes_of(some) for _, some in passes_of(points_of(recording))]
    text = describe(recording, "response-controlled test")
    draw_force_surface(page, responses, surface, text=text, notes=notes)
