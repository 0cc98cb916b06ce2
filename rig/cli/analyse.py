"""``rig analyse``: analyses of a virtual bench without a test."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from rig.cli.group import Group
from rig.cli.run_options import with_options

if TYPE_CHECKING:
    from rig.analysis.study import Study
    from rig.analysis.subject import Subject

    Show = Callable[[Callable[[Subject], Study]], None]

app = typer.Typer(cls=Group, no_args_is_help=True, help="What can be known of a virtual bench without a test.")

BenchName = Annotated[str, typer.Option("--bench", help="Shipped bench or TOML file, with the virtual driver.")]
NearHz = Annotated[float | None, typer.Option(help="Mode under test, nearest to this, Hz; default: the bench's.")]
Figure = Annotated[Path | None, typer.Option("-o", "--output", help="Figure to write: .png, .pdf, .svg or .html.")]
Json = Annotated[bool, typer.Option("--json", help="Print all numbers as one JSON document; complex as pairs re, im.")]
Harmonics = Annotated[int, typer.Option(help="Highest harmonic that is balanced.", min=1, max=200)]
FromHz = Annotated[float | None, typer.Option(help="Lowest frequency, Hz.")]
ToHz = Annotated[float | None, typer.Option(help="Highest frequency, Hz.")]


def of_a_bench(bench: BenchName, near_hz: NearHz = None, output: Figure = None, json: Json = False) -> "Show":
    """Return what makes an analysis of a bench, prints and draws it."""
    return partial(_show, bench, near_hz, output, json)


@app.command("modes")
@with_options(of_a_bench)
def modes_(*, options: "Show") -> None:
    """Linear modes of the structure, with their shapes at the channels, and of the coupled rig."""
    from rig.analysis.modes import modes

    options(modes)


@app.command("responses")
@with_options(of_a_bench)
def responses_(
    *,
    options: "Show",
    from_hz: FromHz = None,
    to_hz: ToHz = None,
    points: Annotated[int, typer.Option(help="Number of frequencies, beside more around every resonance.")] = 500,
) -> None:
    """Linear frequency responses: voltage to force and accelerations, force to accelerations."""
    from rig.analysis.linear_responses import responses

    options(partial(responses, from_hz=from_hz, to_hz=to_hz, points=points))


@app.command("backbone")
@with_options(of_a_bench)
def backbone_(
    *,
    options: "Show",
    from_n: Annotated[float | None, typer.Option(help="Lowest force, N (peak of the fundamental).")] = None,
    to_n: Annotated[float | None, typer.Option(help="Highest force, N; default: as the bench's limits allow.")] = None,
    from_v: Annotated[float | None, typer.Option(help="Lowest voltage, V, instead of a force.")] = None,
    to_v: Annotated[float | None, typer.Option(help="Highest voltage, V, instead of a force.")] = None,
    points: Annotated[int, typer.Option(help="Number of levels.")] = 15,
    harmonics: Harmonics = 15,
) -> None:
    """Phase-resonance backbone by harmonic balance of the coupled rig, with the hysteresis of its joints."""
    from rig.analysis.backbone import backbone
    from rig.errors import ConfigurationError

    by_voltage = from_v is not None or to_v is not None
    if by_voltage and (from_n is not None or to_n is not None):
        raise ConfigurationError("--from-v, --to-v: given with --from-n or --to-n, allowed is one of the two")
    lowest, highest = (from_v, to_v) if by_voltage else (from_n, to_n)
    by: Literal["voltage", "force"] = "voltage" if by_voltage else "force"
    options(partial(backbone, by=by, lowest=lowest, highest=highest, points=points, harmonics=harmonics))


@app.command("constant-force")
@with_options(of_a_bench)
def constant_force_(
    *,
    options: "Show",
    force_n: Annotated[list[float] | None, typer.Option(help="Peak of the fundamental force, N; repeatable.")] = None,
    points: Annotated[int, typer.Option(help="Number of phase lags along each curve.")] = 141,
    harmonics: Harmonics = 15,
) -> None:
    """Response curves at constant force with their unstable branches, and the backbone."""
    from rig.analysis.constant_force import constant_force

    options(lambda subject: constant_force(subject, force_n or (), points=points, harmonics=harmonics))


@app.command("forced")
@with_options(of_a_bench)
def forced_(
    *,
    options: "Show",
    voltage_v: Annotated[float | None, typer.Option(help="Amplitude of the voltage, V.")] = None,
    from_hz: FromHz = None,
    to_hz: ToHz = None,
    points: Annotated[int, typer.Option(help="Number of frequencies, half of them around resonance.")] = 401,
    harmonics: Harmonics = 15,
) -> None:
    """Steady response to a constant voltage, up and down: what a slow uncontrolled sweep sees."""
    from rig.analysis.forced import forced

    options(partial(forced, voltage_v=voltage_v, from_hz=from_hz, to_hz=to_hz, points=points, harmonics=harmonics))


def _show(
    bench: str, near_hz: float | None, figure: Path | None, json: bool, analyse: "Callable[[Subject], Study]"
) -> None:
    """Analyse, print and draw; exit with status 1 if not everything requested was found."""
    from rig.analysis.study import draw
    from rig.analysis.subject import subject_of
    from rig.drawing.page import check_ending
    from rig.text.console import print_json

    if figure is not None:
        check_ending(figure)
    study = analyse(subject_of(bench, near_hz))
    if figure is not None:
        draw(study, figure)
    if json:
        print_json(study.summary())
    else:
        study.print_summary()
    if not study.complete:
        raise typer.Exit(1)
