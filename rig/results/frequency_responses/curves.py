"""Curves of stepped-sine measurements."""

from identification import FrequencyResponse
from rig.drawing.curves import DISPLACEMENT, FREQUENCY, LAG, ONE_AMPLITUDE, Curves, Line, Panel, Trace, View


def curves(responses: tuple[FrequencyResponse, ...], view: View) -> Curves:
    """Return amplitude and phase lag of every response, over frequency."""
    view.only(of=ONE_AMPLITUDE)
    traces = tuple(
        Trace(
            one.label or f"{one.level:g} {one.level_unit}",
            (Line(one.frequency_hz, one.amplitude_m), Line(one.frequency_hz, one.phase_lag_deg)),
        )
        for one in responses
    )
    return Curves((Panel(FREQUENCY, DISPLACEMENT), Panel(FREQUENCY, LAG)), traces, responses[0].specimen)
