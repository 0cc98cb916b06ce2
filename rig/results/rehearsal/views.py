"""Storage and table of rehearsals: every draw with its unknowns, its end, its points and its harmonic balance."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from identification.common import Arrays, Attributes
from rig.rehearsal.rehearsal import Draw, Effect, Rehearsal, RehearsalFacts
from rig.rehearsal.report import Summary, lines, summary
from rig.rehearsal.trial import Trial, TrialPoint
from rig.rehearsal.truth import TrueBackbone
from rig.results.kind import Storage, Table

_FACTS, _TRIED = TypeAdapter(RehearsalFacts), TypeAdapter(tuple[Effect, ...])
"""Readers of facts and remedies, as a file stores them."""
TRIAL = ("end", "text", "tripped", "completed", "channel", "level", "duration_s")


POINT = tuple(one.name for one in fields(TrialPoint))


def _pack(rehearsal: Rehearsal) -> tuple[Arrays, Attributes]:
    """Return arrays over draws [n], over all their points, and over all balanced points."""
    draws = rehearsal.draws
    unknowns = sorted({name for draw in draws for name in draw.unknowns})
    limits = sorted({name for draw in draws for name in draw.trial.shares})
    arrays: dict[str, NDArray[Any]] = {
        "number": np.array([draw.number for draw in draws]),
        "unknowns": _table([draw.unknowns for draw in draws], unknowns),
        "shares": _table([draw.trial.shares for draw in draws], limits),
    }
    for name in TRIAL:
        arrays[name] = np.array([getattr(draw.trial, name) for draw in draws])
    arrays["points/draw"] = np.array([draw.number for draw in draws for _ in draw.trial.points], int)
    for name in POINT:
        values = [getattr(point, name) for draw in draws for point in draw.trial.points]
        arrays[f"points/{name}"] = np.array(values, dtype=str if name in ("quality", "reason") else None)
    arrays["balanced/draw"] = np.array([draw.number for draw in draws for _ in draw.truth.numbers], int)
    for name, column in (("number", "numbers"), ("frequency_hz", "frequency_hz"), ("damping_ratio", "damping_ratio")):
        arrays[f"balanced/{name}"] = np.array([value for draw in draws for value in getattr(draw.truth, column)], float)
    attributes = {
        "facts": asdict(rehearsal.facts),
        "finished": rehearsal.finished,
        "unknowns": unknowns,
        "limits": limits,
        "tried": [asdict(one) for one in rehearsal.tried],
        "at_most": rehearsal.at_most,
    }
    return arrays, attributes


def _table(rows: Sequence[Mapping[str, float]], names: Sequence[str]) -> NDArray[np.float64]:
    """Return float[len(rows), len(names)]; NaN where a row has no value."""
    return np.array([[row.get(name, np.nan) for name in names] for row in rows], float).reshape(len(rows), len(names))


def _unpack(arrays: Arrays, attributes: Attributes) -> Rehearsal:
    point_draws, truth_draws = arrays["points/draw"], arrays["balanced/draw"]
    columns = {name: arrays[f"points/{name}"].tolist() for name in POINT if f"points/{name}" in arrays}
    draws = []
    for row, number in enumerate(arrays["number"].tolist()):
        points = tuple(
            TrialPoint(**{name: values[i] for name, values in columns.items()})
            for i in np.flatnonzero(point_draws == number).tolist()
        )
        balanced = truth_draws == number
        truth = TrueBackbone(
            numbers=tuple(int(n) for n in arrays["balanced/number"][balanced]),
            frequency_hz=tuple(arrays["balanced/frequency_hz"][balanced].tolist()),
            damping_ratio=tuple(arrays["balanced/damping_ratio"][balanced].tolist()),
        )
        one_trial: dict[str, Any] = {name: arrays[name].tolist()[row] for name in TRIAL}
        trial = Trial(shares=_row(arrays["shares"][row], attributes["limits"]), points=points, **one_trial)
        unknowns = _row(arrays["unknowns"][row], attributes["unknowns"])
        draws.append(Draw(number=int(number), unknowns=unknowns, trial=trial, truth=truth))
    return Rehearsal(
        facts=_FACTS.validate_python(attributes["facts"]),
        draws=tuple(draws),
        finished=str(attributes["finished"]),
        tried=_TRIED.validate_python(attributes.get("tried", ())),
        at_most=attributes.get("at_most"),
    )


def _row(values: NDArray[np.float64], names: Sequence[str]) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True) if not np.isnan(value)}


STORAGE = Storage(_pack, _unpack)


def _say(found: dict[str, Any]) -> None:
    for line in lines(Summary.model_validate(found)):
        print(line)


def _summarise(rehearsal: Rehearsal) -> dict[str, Any]:
    return summary(rehearsal).model_dump(by_alias=True)


TABLE = Table(_summarise, _say)
