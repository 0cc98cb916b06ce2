"""Options of predictions by models that are simulated."""

from pathlib import Path
from typing import Annotated

from rig.results.options import Option
from rig.results.predictions.options import Levels, Planned, PredictionOptions, Sweeps


class SimulatedPrediction(PredictionOptions):
    """Options of predictions by a PNLSS or structured model. By default a model driven by a force holds a pure sine."""

    voltages_v: Annotated[
        Levels, Option(flag="--voltage-response", metavar="VOLT", allowed="is any number above 0, V")
    ] = ()
    """Predict the frequency response at this constant voltage (peak), of its input or of the exciter; may be repeated."""
    sweeps: Sweeps = ()
    """Predict the sweeps of this recording; may be repeated."""
    multisines: Annotated[tuple[Path, ...], Option(flag="--multisine")] = ()
    """Simulate the realisations of this recording; may be repeated."""
    planned: Planned = ()
    """Predict the sweeps of this plan, yet to be made; may be repeated."""
    planned_multisines: Annotated[tuple[str, ...], Option(flag="--planned-multisine", metavar="PLAN")] = ()
    """Simulate the multisines of this plan, yet to be made; may be repeated."""
    constants: Annotated[tuple[str, ...], Option(flag="--constant", metavar="NAME=VALUE")] = ()
    """Hold this input at a value; may be repeated. That of --constant-input holds by itself."""
    exciter: Path | None = None
    """Exciter model that drives a model whose input is the force, with the harmonics that it makes."""
    trust_code: bool = False
    """Import the functions that the model names."""
