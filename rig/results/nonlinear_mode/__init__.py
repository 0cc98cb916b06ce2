"""Nonlinear modes: modal frequency, damping and shape over the amplitude."""

from rig.results.kind import Identification, Prediction, ResultKind

KIND = ResultKind(
    name="nonlinear-mode",
    holds=("identification:NonlinearMode",),
    table="rig.results.nonlinear_mode.views:TABLE",
    draw="rig.drawing.nonlinear_mode:draw_mode",
    figure_in=(12.0, 6.4),
    curves={"backbones": "rig.results.nonlinear_mode.views:curves"},
    exchange="rig.results.nonlinear_mode.views:EXCHANGE",
    identification=Identification(
        "nonlinear-mode",
        "Nonlinear mode, from backbones, decays or stepped sines.",
        "rig.results.nonlinear_mode.options:NonlinearModeOptions",
        "rig.results.nonlinear_mode.identify:identify",
    ),
    prediction=Prediction(
        "Frequency responses at constant force, and sweeps.",
        "rig.results.nonlinear_mode.options:NonlinearModePrediction",
        "rig.results.nonlinear_mode.predict:predict",
    ),
)
