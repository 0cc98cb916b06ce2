"""Tables of models that are simulated: errors by experiment, scatter from run to run."""

from typing import Any

from identification import RunScatter
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
        f"shifts from run to run, {rows[0]['recordings']} runs; the model is that of a run in the middle, errors are those "
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
    """Print the errors of all experiments, if there are any."""
    if not summary["errors"]:
        return
    print("relative errors of the model, in brackets those of its linear start, %")
    linear = summary["linear_errors"] or [None] * len(summary["errors"])
    print_table(
        ("experiment", "use", *summary["outputs"], "range use"),
        [
            (
                run["name"],
                run["use"],
                *(_error(run, before, name) for name in summary["outputs"]),
                "unbounded" if run["unbounded"] else number(run["range_use"], ".2f"),
            )
            for run, before in zip(summary["errors"], linear, strict=True)
        ],
    )


def _error(run: dict[str, Any], before: dict[str, Any] | None, name: str) -> str:
    own = "unbounded" if run["unbounded"] else number(run["errors"][name], ".3f", 100.0)
    return own if before is None else f"{own} ({number(before['errors'][name], '.2f', 100.0)})"
