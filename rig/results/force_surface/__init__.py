"""Force surfaces: force over displacement and phase."""

from rig.results.kind import Identification, Prediction, ResultKind

KIND = ResultKind(
    name="force-surface",
    holds=("rig.results.force_surface.model:MeasuredSurface",),
    storage="rig.results.force_surface.model:STORAGE",
    table="rig.results.force_surface.table:TABLE",
    draw="rig.drawing.force_surface:draw_measured_surface",
    figure_in=(11.0, 7.0),
    exported="rig.results.force_surface.model:exported",
    identification=Identification(
        "force-surface",
        "Force over displacement and phase, from held levels.",
        "rig.results.force_surface.options:ForceSurfaceOptions",
        "rig.results.force_surface.identify:identify",
    ),
    prediction=Prediction(
        "Frequency responses at constant force.",
        "rig.results.force_surface.options:ForceSurfacePrediction",
        "rig.results.force_surface.predict:predict",
    ),
)
