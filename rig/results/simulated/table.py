"""Tables of models that are simulated: errors by experiment, scatter from run to run."""

from typing import Any

from identification import RunScatter
from identification.experiments import EXPLAINED, lacks_something
from rig.results.simulated.driven_models import DrivenModel
from rig.results.simulated.model import SimulatedModel
from rig.text.column import Column
from rig.text.console import number, print_rows, print_table


def rows_of_scatter(of: RunScatter) -> list[dict[str, Any]]:
    """Return the widths of a scatter, one row for each effect."""
    return [
        {
            "effect": str(effect),
            "width": width.width,
            "width_low": width.low,
            "width_high": width.high,
            "mean_std": width.mean_std,
            "recordings": len(of.runs),
            "settled": of.settled,
        }
        for effect, width in zip(of.effects, of.widths, strict=True)
    ]


def say_scatter(rows: list[dict[str, Any]] | None) -> None:
    """Print the widths of the scatter, if there is any."""
    if not rows:
        return
    print(
        f"shifts from run to run, {rows[0]['recordings']} runs; the model describes an average run; errors are those "
        "with each run's shifts"
    )
    ends = [[number(row[end], ".3g", 100.0) for end in ("width_low", "width_high")] for row in rows]
    print_rows(
        [{**row, "interval": " to ".join(pair)} for row, pair in zip(rows, ends, strict=True)],
        Column("effect", "shift of"),
        Column("width", "standard deviation", "%", ".3g", 100.0),
        Column("interval", "95 % interval"),
        Column("mean_std", "+- of the middle", "%", ".2g", 196.0),
    )
    if not rows[0]["settled"]:
        print("the shifts had not settled when the fit ended")


def summary_of(found: SimulatedModel, model: DrivenModel) -> dict[str, Any]:
    """Return what ``rig show --json`` prints of every such model: channels, rate, scatter and errors."""
    return {
        "specimen": model.specimen,
        "inputs": [channel.name for channel in model.inputs],
        "outputs": [channel.name for channel in model.outputs],
        "sample_rate_hz": model.sample_rate_hz,
        "scatter": None if found.scatter is None else rows_of_scatter(found.scatter),
        "errors": [run.row() for run in found.runs],
        "linear_errors": [run.row() for run in found.linear_runs],
        "training": list(model.training),
        "seconds": found.seconds,
    }


def say_errors(summary: dict[str, Any]) -> None:
    """Print the errors of all experiments, if there are any, and whether noise explains them."""
    runs = summary["errors"]
    if not runs:
        return
    print("relative errors of the model, in brackets those of its linear start, %")
    linear = summary["linear_errors"] or [None] * len(runs)
    is_known = any(_over_noise(run) for run in runs)
    print_table(
        ("experiment", "use", *summary["outputs"], "range use", *(["residual/noise"] if is_known else [])),
        [
            (
                run["name"],
                run["use"],
                *(_error(run, before, name) for name in summary["outputs"]),
                "unbounded" if run["unbounded"] else number(run["range_use"], ".2f"),
                *([number(max(_over_noise(run).values(), default=None), ".3g")] if is_known else []),
            )
            for run, before in zip(runs, linear, strict=True)
        ],
    )
    if verdict := noise_verdict(runs):
        print(verdict)


def noise_verdict(runs: list[dict[str, Any]]) -> str:
    """Say whether noise explains the residual of the training data; empty where the noise is unknown."""
    ratios = [
        (ratio, run["errors"][name], f"{name}, {run['name']}")
        for run in runs
        if run["use"] == "training"
        for name, ratio in _over_noise(run).items()
    ]
    if not ratios:
        return ""
    largest, error, where = max(ratios)
    if largest <= EXPLAINED:
        return f"noise explains the residual of the training data: at most {largest:.2g} times the noise"
    beyond = [one for one in ratios if lacks_something(*one[:2])]
    if not beyond:
        return f"the residual is {largest:.3g} times the noise, but small, {100.0 * error:.2g} % ({where})"
    largest, error, where = max(beyond)
    return (
        f"the residual is {largest:.3g} times the noise, {100.0 * error:.2g} % ({where}): the model lacks something, or its "
        "fit ended in a local minimum"
    )


def _over_noise(run: dict[str, Any]) -> dict[str, float]:
    """Return the residual over the noise by output, where it is known."""
    return {name: ratio for name, ratio in run["over_noise"].items() if ratio is not None}


def _error(run: dict[str, Any], before: dict[str, Any] | None, name: str) -> str:
    own = "unbounded" if run["unbounded"] else number(run["errors"][name], ".3f", 100.0)
    return own if before is None else f"{own} ({number(before['errors'][name], '.2f', 100.0)})"
