"""Figure of a response-controlled test: all levels, and the force surface through them if there are enough levels."""

from identification import ForceSurface, IdentificationError, force_surface
from rig.campaigns.evaluation.figure import describe
from rig.campaigns.evaluation.frequency_responses import recorded_frequency_responses
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
    draw_force_surface(page, responses, surface, text=describe(recording, "response-controlled test"))
