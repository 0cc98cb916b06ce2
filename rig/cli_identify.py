"""``rig identify`` and ``rig predict``: from recordings to models, from models to predictions."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli_options import Json, Output, Overwrite, keep_existing, show_file

__all__ = ["identify", "predict"]


def identify(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings, or imported measurements. Several are taken together.")
    ],
    output: Output,
    model: Annotated[
        str, typer.Option(help="Kind of model: nonlinear-mode, linear, force-surface or exciter.")
    ] = "nonlinear-mode",
    modes: Annotated[Path | None, typer.Option(help="Linear model whose mode shapes the nonlinear mode uses.")] = None,
    estimator: Annotated[str, typer.Option(help="Of a linear model's responses: instrument, H1 or H2.")] = "instrument",
    band: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Lines of a linear or exciter model, Hz.")
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", help="Number of modes of a linear model; found if left out.", min=1)
    ] = None,
    resistance: Annotated[
        float | None, typer.Option(metavar="OHM", help="Of an exciter's coil, cable and amplifier, if measured.")
    ] = None,
    amplifier_gain: Annotated[
        float | None, typer.Option(metavar="V/V", help="Of the exciter's voltage amplifier; 1 if left out.")
    ] = None,
    stinger_stiffness: Annotated[
        float | None, typer.Option(metavar="N_PER_M", help="Of the exciter's stinger (E A / l), if known.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Turn recordings into a model."""
    from rig.models.files import save
    from rig.models.identify import Request, identify_model

    keep_existing(files, output, overwrite)
    request = Request(
        kind=model,
        modes=modes,
        estimator=estimator,
        band_hz=band,
        count=count,
        resistance_ohm=resistance,
        amplifier_gain=amplifier_gain,
        stinger_stiffness_n_m=stinger_stiffness,
    )
    save(identify_model(files, request), output)
    show_file(output, json)


def predict(
    model: Annotated[Path, typer.Argument(help="Nonlinear mode or force surface.")],
    output: Output,
    frequency_response: Annotated[
        list[float] | None,
        typer.Option(metavar="FORCE_N", help="Predict the frequency response at this constant force; may be repeated."),
    ] = None,
    force: Annotated[
        str, typer.Option(help="What is constant: fundamental (peak), rms, or pure-sine.")
    ] = "fundamental",
    sweep: Annotated[
        list[Path] | None, typer.Option(help="Predict the sweeps of this recording; may be repeated.")
    ] = None,
    planned_sweep: Annotated[
        list[str] | None,
        typer.Option(metavar="PLAN", help="Predict the sweeps of this plan, yet to be made; may be repeated."),
    ] = None,
    exciter: Annotated[
        Path | None, typer.Option(help="Exciter model: sweeps are predicted from the voltage, not from the force.")
    ] = None,
    zero_crossings: Annotated[
        str | None,
        typer.Option(
            metavar="WHICH",
            help="Read an imposed force between its zero crossings, as the paper did: half-periods (between all of them) or "
            "periods (those in the same direction).",
        ),
    ] = None,
    modes: Annotated[Path | None, typer.Option(help="Linear model: other modes and other sensors.")] = None,
    reference: Annotated[
        list[Path] | None,
        typer.Option(help="Stepped sines to compare with (recorded or imported); may be repeated."),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(
            help="Compare over frequency or phase, which tells all branches apart. "
            "If left out: phase where the measured frequency turns back."
        ),
    ] = None,
    allow_extrapolation: Annotated[
        bool, typer.Option("--allow-extrapolation", help="Answer beyond twice the largest amplitude identified.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Predict vibrations with a model, and compare them with recordings."""
    from rig.models.files import save
    from rig.models.predict import PredictionRequest, predict_vibrations

    given = [path for path in (model, exciter, modes, *(sweep or ()), *(reference or ())) if path is not None]
    keep_existing(given, output, overwrite)
    request = PredictionRequest(
        forces_n=tuple(frequency_response or ()),
        held=force,
        sweeps=tuple(sweep or ()),
        planned=tuple(planned_sweep or ()),
        exciter=exciter,
        zero_crossings=zero_crossings,
        modes=modes,
        references=tuple(reference or ()),
        over=over,
        allow_extrapolation=allow_extrapolation,
    )
    save(predict_vibrations(model, request), output)
    show_file(output, json)
