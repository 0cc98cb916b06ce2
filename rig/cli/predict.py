"""``rig predict``: predict vibrations with models."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.kind_group import KindGroup, kind_app, parameter
from rig.cli.options import keep_existing, show_file

if TYPE_CHECKING:
    from rig.results.kind import Prediction


class PredictGroup(KindGroup):
    """``rig predict``."""

    text = "Predict vibrations with a model, and compare them with recordings."
    usage = "[KIND] FILE -o OUTPUT [OPTIONS]"
    after = (
        "All kinds have -o, --overwrite (replace OUTPUT) and --json (print JSON); `rig predict KIND --help` shows the others. "
        "Without KIND it is that of the model in FILE; a file with the name of a kind is written ./pnlss."
    )
    files = parameter("model", Annotated[Path, typer.Argument(help="Model of one of the kinds that predict.")])

    def kinds(self) -> "Mapping[str, Prediction]":
        """Return how models predict, by their kinds."""
        from rig.results.kinds import predictions

        return predictions()

    def run(self, word: str, output: Path, overwrite: bool, json: bool, values: dict[str, Any]) -> None:
        """Predict with a model and show the predictions."""
        from rig.cli.option_parameters import given_in
        from rig.results.files import save
        from rig.results.predict import predict_vibrations
        from rig.results.predictions.sweeps import expected_duration
        from rig.show.waiting import Waiting

        model = values.pop("model")
        given = given_in(values)
        sources = [one for value in given.values() for one in (value if isinstance(value, list) else [value])]
        keep_existing([model, *(one for one in sources if isinstance(one, Path))], output, overwrite)
        usual = partial(expected_duration, given.get("sweeps") or (), given.get("planned") or ())
        with Waiting(f"predicting with {model}", usual):
            save(predict_vibrations(model, given, kind=word), output)
        show_file(output, json)


app = kind_app(PredictGroup)
