"""`rig reproduce`: record, identify, test and predict in sequence, and keep all results in a folder."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from identification import ErrorTable, IdentificationError, PnlssModel, StructuredModel
from identification.scatter import OwnModel
from rig.results.simulated.table import rows_of_scatter
from studies.reproduce.folder import prepare
from studies.reproduce.identified import Models, identify_all
from studies.reproduce.options import Options
from studies.reproduce.recordings import multisines, segments
from studies.reproduce.steady import Steady, steady
from studies.reproduce.sweeps import SweepResult, simulated_sweeps
from studies.reproduce.true_responses import Truth

VARIANTS: dict[str, dict[str, Callable[[Any], PnlssModel | StructuredModel | None]]] = {
    "pnlss": {
        "chosen on validation data": lambda fit: fit.model,
        "last iterate": lambda fit: fit.last,
        "chosen, monomials bounded": lambda fit: fit.model.bounded(),
        "linear start": lambda fit: fit.linear,
    },
    "structured": {
        "fitted": lambda fit: fit.model,
        "start": lambda fit: fit.start,
    },
}
"""Models that a single fit offers, by the kind and by their name in tables. The first is the identified model itself."""

OWN_SHIFTS = "with each run's own shifts"
"""Name of the identified model in tables, if its shifts are estimated for every run that it is compared with."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Study:
    """All results of a study."""

    options: Options
    """Options of the study."""
    models: Models
    """All models."""
    tables: Mapping[str, ErrorTable]
    """Error tables by variant."""
    steady: Sequence[Steady] = ()
    """Steady predictions of the selected models."""
    truths: Sequence[Truth] = ()
    """True responses of the rig."""
    sweeps: Sequence[SweepResult] = ()
    """Sweeps simulated by the selected models."""

    @property
    def table(self) -> ErrorTable:
        """Error table of the identified models themselves."""
        return next(iter(self.tables.values()))

    def summary(self) -> dict[str, Any]:
        """Return everything in one JSON-able dictionary."""
        options = self.options
        return {
            "kind": "reproduction",
            "specimen": options.specimen.name,
            "model": options.model,
            "input": options.input,
            "beside": list(options.beside),
            "saturating": options.saturating,
            "scatter": options.scatter,
            "shifts": [
                {"model": name, **row}
                for name, scatter in self.models.scatter.items()
                for row in rows_of_scatter(scatter)
            ],
            "seed": options.seed,
            "states": options.model_states,
            "realisations": options.realisations,
            "iterations": options.fit_settings.iterations,
            "output": self.table.output,
            "selected": self.table.selected,
            "failures": dict(self.models.failures),
            "times": self.models.times(),
            "errors": {name: table.rows() for name, table in self.tables.items()},
            "steady": [one.row() for one in self.steady],
            "sweeps": [one.row() for one in self.sweeps],
        }


def reproduce(options: Options, say: Callable[[str], None]) -> Study:
    """Carry out a study, or the parts of it that are missing in its folder.

    ``say`` receives a line for everything that begins or is finished. Raises `rig.errors.RigError` if something cannot be
    recorded or written, `identification.IdentificationError` if no model can be identified, and `KeyboardInterrupt` after
    Ctrl-C. The same call then resumes the study in its folder.
    """
    prepare(options)
    levels = multisines(options, say)
    beside = segments(options, say)
    models = identify_all(options, levels, beside, say)
    if not models.fits:
        name, reason = next(iter(models.failures.items()))
        raise IdentificationError(f"no model could be identified; {name}: {reason}")
    variants: dict[str, dict[str, Any]] = {
        name: {model: of(fit) for model, fit in models.fits.items()} for name, of in VARIANTS[options.model].items()
    }
    if models.scatter:
        first = next(iter(variants.values()))
        own = {name: OwnModel(first[name], scatter) for name, scatter in models.scatter.items()}
        variants = {OWN_SHIFTS: own} | variants
    tables = {}
    for name, of in variants.items():
        known_models = {model: one for model, one in of.items() if one is not None}
        tables[name] = ErrorTable.of(
            known_models, models.jobs, levels, output=options.channel, failures=models.failures
        )
    table = next(iter(tables.values()))
    selected = {name: (model, models.fits[model].model) for name, model in table.selected.items()}
    found: list[Steady] = []
    known: tuple[Truth, ...] = ()
    if "steady" not in options.without:
        say("steady responses")
        found, known = steady(options, selected, say)
    swept: list[SweepResult] = []
    if "sweeps" not in options.without:
        swept = simulated_sweeps(options, selected, say)
    return Study(options=options, models=models, tables=tables, steady=found, truths=known, sweeps=swept)
