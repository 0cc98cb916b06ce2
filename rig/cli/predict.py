"""``rig predict``: predict vibrations with models."""

from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json, Output, Overwrite, keep_existing, show_file


def predict(
    model: Annotated[Path, typer.Argument(help="Nonlinear mode, PNLSS model, structured model or force surface.")],
    output: Output,
    forces_n: Annotated[
        list[float] | None,
        typer.Option(
            "--frequency-response",
            metavar="FORCE_N",
            help="Predict the frequency response at this constant force; may be repeated.",
        ),
    ] = None,
    voltages_v: Annotated[
        list[float] | None,
        typer.Option(
            "--voltage-response",
            metavar="VOLT",
            help="Predict the frequency response of a PNLSS or structured model at this constant voltage (peak), of its input "
            "or of the exciter; may be repeated.",
        ),
    ] = None,
    held: Annotated[
        str | None,
        typer.Option(
            "--force",
            help="What is constant: fundamental (peak), rms, or pure-sine. If left out: fundamental; of a PNLSS or structured "
            "model driven by a force, and without an exciter, pure-sine.",
        ),
    ] = None,
    sweeps: Annotated[
        list[Path] | None, typer.Option("--sweep", help="Predict the sweeps of this recording; may be repeated.")
    ] = None,
    multisines: Annotated[
        list[Path] | None,
        typer.Option(
            "--multisine",
            help="Simulate the realisations of this recording with a PNLSS or structured model; may be repeated.",
        ),
    ] = None,
    planned: Annotated[
        list[str] | None,
        typer.Option(
            "--planned-sweep", metavar="PLAN", help="Predict the sweeps of this plan, yet to be made; may be repeated."
        ),
    ] = None,
    planned_multisines: Annotated[
        list[str] | None,
        typer.Option(
            "--planned-multisine",
            metavar="PLAN",
            help="Simulate the multisines of this plan, yet to be made, with a PNLSS or structured model; may be repeated.",
        ),
    ] = None,
    constants: Annotated[
        list[str] | None,
        typer.Option(
            "--constant",
            metavar="NAME=VALUE",
            help="Hold this input of a PNLSS model at a value; may be repeated. That of --constant-input holds by itself.",
        ),
    ] = None,
    exciter: Annotated[
        Path | None,
        typer.Option(
            help="Exciter model: sweeps are predicted from the voltage, recorded ones and planned ones. With a PNLSS or "
            "structured model driven by a force also responses and references at constant fundamental, RMS or voltage, with "
            "the harmonics that the exciter makes; one driven by the voltage has its own."
        ),
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
    references: Annotated[
        list[Path] | None,
        typer.Option("--reference", help="Stepped sines to compare with (recorded or imported); may be repeated."),
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
    bands: Annotated[
        bool,
        typer.Option(
            "--bands",
            help="Give the responses of a structured model 95 % bands, from 40 models that its fit allows; takes as long as "
            "40 responses. Models with scatter have them anyway.",
        ),
    ] = False,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Import the functions that a structured or PNLSS model names.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Predict vibrations with a model, and compare them with recordings."""
    from rig.results.files import save
    from rig.results.predict import predict_vibrations
    from rig.results.predictions.request import PredictionRequest

    given = (model, exciter, modes, *(sweeps or ()), *(multisines or ()), *(references or ()))
    keep_existing([path for path in given if path is not None], output, overwrite)
    request = PredictionRequest(
        forces_n=tuple(forces_n or ()),
        voltages_v=tuple(voltages_v or ()),
        held=held,
        sweeps=tuple(sweeps or ()),
        multisines=tuple(multisines or ()),
        planned=tuple(planned or ()),
        planned_multisines=tuple(planned_multisines or ()),
        constants=tuple(constants or ()),
        exciter=exciter,
        zero_crossings=zero_crossings,
        modes=modes,
        references=tuple(references or ()),
        over=over,
        allow_extrapolation=allow_extrapolation,
        bands=bands,
        trust_code=trust_code,
    )
    save(predict_vibrations(model, request), output)
    show_file(output, json)
