"""``rig identify``: identify models from recordings."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json, Output, Overwrite, keep_existing, show_file


def identify(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings, or imported measurements. Several are taken together.")
    ],
    output: Output,
    kind: Annotated[
        str,
        typer.Option(
            "--model",
            help="Kind of model: nonlinear-mode, decay, linear, force-surface, exciter, pnlss or structured.",
        ),
    ] = "nonlinear-mode",
    modes: Annotated[
        Path | None,
        typer.Option(help="Linear model: shapes of a nonlinear mode, start of a structured model."),
    ] = None,
    estimator: Annotated[
        str, typer.Option(help="Of the responses: instrument (by the drive voltage), H1 or H2.")
    ] = "instrument",
    band_hz: Annotated[
        tuple[float, float] | None,
        typer.Option("--band", metavar="LOW HIGH", help="Lines of a linear or exciter model, Hz."),
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", help="Number of modes of a linear model; found if left out.", min=1)
    ] = None,
    near: Annotated[
        str | None,
        typer.Option(
            "--near",
            metavar="LIST",
            help="Frequencies of a linear model or a decay, Hz, with commas: one mode near each.",
            show_default="found",
        ),
    ] = None,
    order: Annotated[
        int | None,
        typer.Option(
            "--order", help="Highest order of a linear model's stabilisation diagram.", show_default="40", min=2
        ),
    ] = None,
    weighting: Annotated[
        str,
        typer.Option(help="Of the lines of a linear model: auto, total (with distortion), noise or relative."),
    ] = "auto",
    resistance_ohm: Annotated[
        float | None,
        typer.Option("--resistance", metavar="OHM", help="Of an exciter's coil, cable and amplifier, if measured."),
    ] = None,
    amplifier_gain: Annotated[
        float | None, typer.Option(metavar="V/V", help="Of the exciter's voltage amplifier; 1 if left out.")
    ] = None,
    stinger_stiffness_n_m: Annotated[
        float | None,
        typer.Option("--stinger-stiffness", metavar="N_PER_M", help="Of the exciter's stinger (E A / l), if known."),
    ] = None,
    states: Annotated[
        int | None, typer.Option("--states", help="Of a PNLSS model: two per mode of vibration.", show_default="2")
    ] = None,
    degrees: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help='Degrees of a PNLSS model\'s monomials; "" for none.',
            show_default="2,3; none beside --saturating",
        ),
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Sample rate of a PNLSS or structured model; by default 25 per period of the highest frequency.",
        ),
    ] = None,
    input: Annotated[
        str | None, typer.Option("--input", help="Of a PNLSS model: force or voltage.", show_default="force")
    ] = None,
    outputs: Annotated[
        str | None,
        typer.Option(metavar="LIST", help="Outputs of a PNLSS or structured model; all motions if left out."),
    ] = None,
    no_output_polynomials: Annotated[
        bool,
        typer.Option("--no-output-polynomials", help="A PNLSS model whose outputs are linear in states and input."),
    ] = False,
    saturating: Annotated[
        int | None,
        typer.Option(
            metavar="K",
            help="Saturating features (tanh) of a PNLSS model, in place of the monomials; with --degrees, beside them.",
        ),
    ] = None,
    function: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Function of the saturating features: tanh, square, cube, or MODULE:NAME of your own.",
            show_default="tanh",
        ),
    ] = None,
    trust_code: Annotated[
        bool, typer.Option("--trust-code", help="Import the function of --function, or of the model that goes on.")
    ] = False,
    constant_input: Annotated[
        bool,
        typer.Option("--constant-input", help="A constant input of a PNLSS model beside the others, against offsets."),
    ] = False,
    iterations: Annotated[
        int | None,
        typer.Option(help="Most iterations of a PNLSS model's fit; it ends sooner.", show_default="1000"),
    ] = None,
    validation: Annotated[
        list[Path] | None,
        typer.Option(
            help="Recording that chooses a PNLSS model's iterate, or judges a structured model; may be repeated."
        ),
    ] = None,
    hold_out: Annotated[
        int | None,
        typer.Option(
            "--hold-out",
            help="Realisations of each level, the last ones, that do so in place of --validation; of "
            "five settled points and more every fourth does too. 0: none.",
            show_default="1",
        ),
    ] = None,
    relative: Annotated[
        bool,
        typer.Option(
            "--relative-errors",
            help="Of a PNLSS or structured model: small levels count as much as large ones in the fit.",
        ),
    ] = False,
    scatter: Annotated[
        str | None,
        typer.Option(
            metavar="LIST",
            help="What shifts from one recording to the next in a PNLSS or structured model: frequency, damping, gain.",
            show_default="nothing",
        ),
    ] = None,
    laws: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LIST",
            help="Laws of a structured model's element, with @OUTPUT or @OUTPUT:OUTPUT where it acts; repeated for further "
            "elements, which are kept while they pay.",
            show_default="polynomial-spring,polynomial-damper",
        ),
    ] = None,
    suspension_stiffness_n_m: Annotated[
        float | None,
        typer.Option(
            "--suspension-stiffness",
            metavar="N_PER_M",
            help="Of the exciter below a structured model, as in `rig show EXCITER`; 0 for none.",
            show_default="fitted",
        ),
    ] = None,
    start_s: Annotated[
        float | None,
        typer.Option("--start", metavar="S", help="Where a free decay begins; found if left out."),
    ] = None,
    stop_s: Annotated[
        float | None,
        typer.Option("--stop", metavar="S", help="Where a free decay ends; at the noise if left out."),
    ] = None,
    levels: Annotated[
        int | None, typer.Option(help="Levels of each mode of a decay.", min=1, show_default="15")
    ] = None,
    drive_mode_shape: Annotated[
        float | None,
        typer.Option(metavar="PHI", help="Of a decay: mass-normalised shape at the drive point, kg^-1/2."),
    ] = None,
    point: Annotated[
        int | None, typer.Option(help="Recorded point with the decay, from 1, if there are several.", min=1)
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the PNLSS model in OUTPUT, from the same files.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Turn recordings into a model."""
    from rig.results.decay_backbone.options import DecayOptions
    from rig.results.files import save
    from rig.results.identify import identify_model
    from rig.results.identify_request import Request
    from rig.results.pnlss.options import PnlssOptions
    from rig.results.simulated.options import DataOptions
    from rig.results.structured.options import StructuredOptions
    from rig.show.progress import FitLines
    from rig.system.stop_signals import escalating

    keep_existing([*files, *(validation or ())], output, overwrite or resume)
    request = Request(
        kind=kind,
        modes=modes,
        estimator=estimator,
        band_hz=band_hz,
        count=count,
        near=near,
        order=order,
        weighting=weighting,
        resistance_ohm=resistance_ohm,
        amplifier_gain=amplifier_gain,
        stinger_stiffness_n_m=stinger_stiffness_n_m,
        pnlss=PnlssOptions(
            states=states,
            degrees=degrees,
            output_polynomials=False if no_output_polynomials else None,
            saturating=saturating,
            function=function,
            trust_code=True if trust_code else None,
            constant_input=True if constant_input else None,
            iterations=iterations,
            resume=output if resume else None,
        ),
        structured=StructuredOptions(laws=tuple(laws or ()), suspension_stiffness_n_m=suspension_stiffness_n_m),
        decay=DecayOptions(
            start_s=start_s,
            stop_s=stop_s,
            levels=levels,
            drive_mode_shape=drive_mode_shape,
            point=point,
        ),
        data=DataOptions(
            rate_hz=rate_hz,
            input=input,
            outputs=outputs,
            validation=tuple(validation or ()),
            hold_out=hold_out,
            relative=True if relative else None,
            scatter=scatter,
        ),
    )
    with escalating() as signals:
        lines = FitLines(signals.check)
        try:
            found = identify_model(files, request, progress=lines)
        finally:
            lines.close()
    save(found, output)
    show_file(output, json)
    if kind == "pnlss" and found.fit is not None and found.fit.limited:
        print(f"rig: the fit was {found.fit.message}; --resume with more --iterations goes on", file=sys.stderr)
    if kind == "pnlss" and found.fit is not None and found.fit.interrupted:
        print(f"rig: interrupted; the best so far is in {output}, and --resume goes on", file=sys.stderr)
        raise typer.Exit(1)
