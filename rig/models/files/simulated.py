"""What files of models that are simulated have in common: errors by experiment, spectra and a stretch of one experiment."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from typing import Any, Self

import numpy as np

from identification import (
    ErrorSpectra,
    Experiment,
    OutputStretch,
    SimulatedRun,
    error_spectra,
    output_stretch,
    simulated_run,
)
from identification.packing import pack_all, unpack_all
from identification.pnlss.simulators import Simulator
from rig.models.files.kind import Arrays, Attributes
from rig.text.console import number, print_table
from vibrolock.results import Result

__all__ = ["SimulatedModel", "errors_in", "packed_errors", "say_errors", "unpacked_errors"]


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedModel(Result):
    """A model with its errors on the data with which it was identified.

    Parameters
    ----------
    model
        The model.
    runs, linear_runs
        Every experiment as simulated by the model, and by the linear start; the latter may be empty.
    spectra
        Spectra of one periodic experiment, of validation data if there is any; None if there is no periodic experiment.
    stretch
        A short stretch of one experiment over time, of validation data if there is any; None if it was not kept.
    seconds
        Wall time of the identification; NaN if unknown.
    notes
        Remarks on the data for the user, one line each.
    data
        Fingerprint that identifies the data of the fit; empty if unknown.
    uses
        ``training`` or ``validation``, by the fingerprint of each experiment; empty if unknown.
    """

    model: Simulator
    runs: tuple[SimulatedRun, ...] = ()
    linear_runs: tuple[SimulatedRun, ...] = ()
    spectra: ErrorSpectra | None = None
    stretch: OutputStretch | None = None
    seconds: float = float("nan")
    notes: tuple[str, ...] = ()
    data: str = ""
    uses: Mapping[str, str] = field(default_factory=dict)

    @property
    def linear(self) -> Simulator | None:
        """Linear start of the fit; None if unknown."""
        return None

    def judged(
        self,
        training: Sequence[Experiment],
        validation: Sequence[Experiment],
        initial_states: Iterable[np.ndarray] = (),
    ) -> Self:
        """Return it with its errors on all data, with spectra and a stretch over time.

        ``initial_states``: those of the training experiments that do not begin at rest, in their order.
        """
        every = [(one, "training") for one in training] + [(one, "validation") for one in validation]
        begins = iter(initial_states)
        states = [
            next(begins) if use == "training" and one.initial_state == "estimated" else None for one, use in every
        ]
        moved = [bool(np.all(np.any(one.counted_outputs != 0.0, axis=1))) for one, _ in every]
        both, known = list(compress(every, moved)), list(compress(states, moved))
        still = [
            f"{one.name}: an output is zero throughout, so that it has no errors"
            for (one, _), is_moved in zip(every, moved, strict=True)
            if not is_moved
        ]
        linear = self.linear
        found = replace(
            self,
            runs=tuple(
                simulated_run(self.model, one, initial_state=begin, use=use)
                for (one, use), begin in zip(both, known, strict=True)
            ),
            linear_runs=() if linear is None else tuple(simulated_run(linear, one, use=use) for one, use in both),
            notes=(*self.notes, *still),
        )
        return found.on(training, validation)

    def on(self, training: Sequence[Experiment], validation: Sequence[Experiment]) -> Self:
        """Return it with spectra and a stretch over time of the last experiment, preferably periodic and of validation data."""
        every = [*training, *validation]
        periodic = [one for one in validation if one.period_samples] or [one for one in training if one.period_samples]
        spectra = error_spectra(self.model, self.linear, periodic[-1]) if periodic else None
        return replace(self, spectra=spectra, stretch=output_stretch(self.model, (periodic or every)[-1]))


def packed_errors(found: SimulatedModel) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return arrays and attributes of everything but the model."""
    arrays: dict[str, Any] = {}
    attributes = {
        "seconds": found.seconds,
        "notes": list(found.notes),
        "data": found.data,
        "uses": dict(found.uses),
    }
    kept_runs = {"runs": found.runs, "linear_runs": found.linear_runs}
    ones = {"spectra": found.spectra, "stretch": found.stretch}
    for name, things in (kept_runs | {name: () if one is None else (one,) for name, one in ones.items()}).items():
        inside, of_things = pack_all(name, things)
        arrays, attributes = arrays | inside, attributes | of_things
    return arrays, attributes


def unpacked_errors(arrays: Arrays, attributes: Attributes) -> dict[str, Any]:
    """Invert `packed_errors`: return the fields of a `SimulatedModel` by name, without the model."""
    kinds: dict[str, type] = {"runs": SimulatedRun, "linear_runs": SimulatedRun, "spectra": ErrorSpectra}
    parts: dict[str, Any] = {name: unpack_all(kind, name, arrays, attributes) for name, kind in kinds.items()}
    spectra = parts.pop("spectra")
    stretch = unpack_all(OutputStretch, "stretch", arrays, attributes) if "stretch" in attributes else ()
    return parts | {
        "spectra": spectra[0] if spectra else None,
        "stretch": stretch[0] if stretch else None,
        "seconds": float(attributes["seconds"]),
        "notes": tuple(attributes["notes"]),
        "data": str(attributes.get("data", "")),
        "uses": {str(name): str(use) for name, use in attributes.get("uses", {}).items()},
    }


def errors_in(found: SimulatedModel) -> dict[str, Any]:
    """Return the errors as ``rig show --json`` prints them."""
    return {
        "errors": [run.row() for run in found.runs],
        "linear_errors": [run.row() for run in found.linear_runs],
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
    """Return one error of the model, with the error of the linear start in brackets."""
    own = "unbounded" if run["unbounded"] else number(run["errors"][name], ".3f", 100.0)
    return own if before is None else f"{own} ({number(before['errors'][name], '.2f', 100.0)})"
