"""``rig reproduce``: the whole campaign of the paper on a virtual rig, or a reference study on data of others."""

import contextlib
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.cli.options import Json
from rig.errors import ConfigurationError
from rig.show.waiting import heard


def reproduce_(
    context: typer.Context,
    specimen: Annotated[
        str,
        typer.Argument(
            help="magnet-beam or friction-beam; or a reference study on measured data: silverbox, bouc-wen, brake-reuss."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="FOLDER", help="Folder to keep everything in; taken up if it exists."),
    ],
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Folder with the files of a reference study; without it, where to get them."
        ),
    ] = None,
    models: Annotated[
        str,
        typer.Option(
            metavar="N",
            help="Models of each training set, or paper: as many as the paper has. Of a reference study: to choose from.",
        ),
    ] = "5",
    scatter: Annotated[
        float,
        typer.Option(help="Scatter of modal frequencies from run to run, relative; each realisation then is a run."),
    ] = 0.0,
    model: Annotated[str, typer.Option("--model", help="Kind of the models: pnlss or structured.")] = "pnlss",
    shifts: Annotated[
        bool, typer.Option("--shifts", help="Fit the modes of every run with shifts of their own; with --scatter.")
    ] = False,
    input: Annotated[str, typer.Option("--input", help="What goes into the models: force or voltage.")] = "force",
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PLAN", help="Fit its points beside the multisines: backbone-fine, harmonics-varied. Repeatable."
        ),
    ] = None,
    saturating: Annotated[int, typer.Option(help="Saturating features in place of the monomials.", min=0, max=100)] = 0,
    states: Annotated[
        int | None, typer.Option(help="States of the models; default: the paper's.", min=1, max=20)
    ] = None,
    realisations: Annotated[
        int | None, typer.Option(help="Realisations of each level that a model is fitted to, at most.", min=1)
    ] = None,
    iterations: Annotated[
        int | None, typer.Option(help="Iterations of a fit, at most; default: by the specimen.", min=1, max=10_000)
    ] = None,
    levels: Annotated[int | None, typer.Option(help="Levels of the specimen, from the lowest; default: all.")] = None,
    channel: Annotated[str, typer.Option(help="Output whose errors the tables have.")] = "drive",
    without: Annotated[
        list[str] | None, typer.Option(metavar="PART", help="Leave out steady or sweeps; may be repeated.")
    ] = None,
    bench: Annotated[
        str | None, typer.Option(help="Virtual bench to use instead of the specimen's: a name or TOML file.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Models that are identified at the same time; -1 for all cores.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of noise, scatter and phases.", min=0)] = 0,
    json: Json = False,
) -> None:
    """Record the paper's campaign on a virtual rig, identify all its models, and hold their predictions against the rig.

    A reference study identifies models from the files in ``--data`` and puts published figures beside ours.
    """
    from studies.reproduce.references.studies import STUDIES

    if specimen in STUDIES:
        _reference(context, specimen, output, data, models, seed, json)
        return
    from rig.bench import load_bench
    from rig.text.console import print_json
    from studies.reproduce.figures import draw_study
    from studies.reproduce.options import Options
    from studies.reproduce.report import say_study, write_tables
    from studies.reproduce.specimens import SPECIMENS
    from studies.reproduce.study import reproduce

    if specimen not in SPECIMENS:
        raise ConfigurationError(f"specimen {specimen!r}: allowed is {', '.join([*SPECIMENS, *STUDIES])}")
    of = SPECIMENS[specimen]
    if data is not None:
        raise ConfigurationError(f"`data` {data}: is for reference studies, {', '.join(STUDIES)}; leave it out")
    given = {name: value for name, value in context.params.items() if name in Options.__dataclass_fields__}
    changed: dict[str, Any] = {"models": int(models) if models.isdecimal() else models, "beside": tuple(beside or ())}
    changed |= {"without": frozenset(without or ()), "specimen": of, "bench": load_bench(bench or of.name)}
    options = Options(**given | changed, folder=output)
    study = reproduce(options, _say)
    write_tables(study)
    draw_study(study)
    if json:
        print_json(study.summary())
    else:
        say_study(study)


_OF_REFERENCES = ("specimen", "output", "data", "models", "seed", "json")


def _reference(
    context: typer.Context, name: str, output: Path, data: Path | None, models: str, seed: int, json: bool
) -> None:
    from rig.text.console import print_json
    from studies.reproduce.references.data import found
    from studies.reproduce.references.output import prepared, say_reference, summary_of, write_reference
    from studies.reproduce.references.studies import STUDIES

    for option in context.params:
        source = context.get_parameter_source(option)
        if option not in _OF_REFERENCES and source is not None and source.name != "DEFAULT":
            raise ConfigurationError(f"is of the paper's campaign, not of {name}", field=option, hint="leave it out")
    if not models.isdecimal() or not int(models):
        raise ConfigurationError(f"`models` {models}: allowed is a number from 1")
    study = STUDIES[name]
    paths = found(study.data, data)
    prepared(output)
    begun = time.perf_counter()
    result = study.run(paths, int(models), seed, _say)
    result = replace(result, seconds=time.perf_counter() - begun)
    write_reference(result, study.data, output)
    if json:
        print_json(summary_of(result, study.data))
    else:
        say_reference(result, study.data)


def _say(line: str) -> None:
    with contextlib.suppress(OSError):  # the reader has closed the stream; the study goes on
        print(line, file=sys.stderr, flush=True)
    heard()
